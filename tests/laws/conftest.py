"""Every row of the catalogue is designed once for all laws."""

from functools import cache

import pytest

from catalogue import ROWS, Row
from luenberger.design import Design
from luenberger.synthesize import synthesize


@cache
def designed(row: Row) -> Design:
    return synthesize(row.system(), row.method)


@pytest.fixture(params=ROWS, ids=lambda row: row.name)
def row(request: pytest.FixtureRequest) -> Row:
    return request.param


@pytest.fixture
def design(row: Row) -> Design:
    return designed(row)
