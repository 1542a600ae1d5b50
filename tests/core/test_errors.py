"""The tree decides what a caller may catch, so its shape is fixed here."""

import pytest

from luenberger.core import (
    BadInput,
    Infeasible,
    LuenbergerError,
    MissingExtra,
    NotAccepted,
    NotCertified,
    ReplayFailed,
)


@pytest.mark.parametrize("kind", [BadInput, Infeasible, MissingExtra, NotAccepted, NotCertified, ReplayFailed])
def test_every_error_is_caught_by_the_root(kind: type[LuenbergerError]) -> None:
    with pytest.raises(LuenbergerError, match="why"):
        raise kind("why")


def test_python_habits_still_catch() -> None:
    assert issubclass(BadInput, ValueError)
    assert issubclass(MissingExtra, ImportError)
    assert not issubclass(NotAccepted, ValueError)
    assert not issubclass(Infeasible, ValueError)


def test_infeasible_carries_the_block_and_the_nearest_level() -> None:
    error = Infeasible("No gain.", block="decay", nearest=3.2)
    assert (str(error), error.block, error.nearest) == ("No gain.", "decay", 3.2)


def test_infeasible_without_a_nearest_level() -> None:
    error = Infeasible("No gain.")
    assert error.block == ""
    assert error.nearest is None
