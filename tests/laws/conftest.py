"""Every row of the catalogue is designed once for all laws."""

from functools import cache
from typing import Any

import pytest

from catalogue import ROWS, SWITCHED_ROWS, Row
from luenberger.design import Design
from luenberger.synthesize import synthesize


@cache
def designed(row: Row) -> Any:
    return synthesize(row.system(), row.method)


@pytest.fixture(params=ROWS, ids=lambda row: row.name)
def row(request: pytest.FixtureRequest) -> Row:
    return request.param


@pytest.fixture
def design(row: Row) -> Design:
    return designed(row)


@pytest.fixture(params=(*ROWS, *SWITCHED_ROWS), ids=lambda row: row.name)
def any_row(request: pytest.FixtureRequest) -> Row:
    """Rows of both tables, for laws that hold with and without modes."""
    return request.param


@pytest.fixture
def any_design(any_row: Row) -> Any:
    return designed(any_row)
