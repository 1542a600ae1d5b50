"""The error tree: every message says what was given, what is needed, and what to do next."""


class LuenbergerError(Exception):
    """Root of everything this library raises on purpose."""


class BadInput(LuenbergerError, ValueError):
    """An argument, a file or a signal cannot be used as given; nothing was computed and nothing is lost."""


class NotAccepted(LuenbergerError):
    """A method does not apply to this plant; the message names the assumption that fails."""


class Infeasible(LuenbergerError):
    """No gain meets the request; `nearest` holds the closest level that was found, where one was.

    Args:
        message: the whole sentence for the reader.
        block: name of the inequality that the dual certificate charges most, or an empty string.
        nearest: nearest feasible value of the requested level, or None.
    """

    def __init__(self, message: str, block: str = "", nearest: float | None = None):
        super().__init__(message)
        self.block = block
        self.nearest = nearest


class NotCertified(LuenbergerError):
    """The claims of a design could not be proved, so the design is refused."""


class ReplayFailed(LuenbergerError):
    """An observer left the finite numbers during a replay; the message names it and the first bad sample."""


class MissingExtra(LuenbergerError, ImportError):
    """An optional package is needed; the message gives the `pip install` line."""
