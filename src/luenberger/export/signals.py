"""Names and units of what goes into exported code and comes out of it."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from luenberger.core import BadInput
from luenberger.systems import Switched, System

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")
# Words of C99 that no field can be called.
_KEYWORDS = frozenset(
    [
        "auto",
        "break",
        "case",
        "char",
        "const",
        "continue",
        "default",
        "do",
        "double",
        "else",
        "enum",
        "extern",
        "float",
        "for",
        "goto",
        "if",
        "inline",
        "int",
        "long",
        "register",
        "restrict",
        "return",
        "short",
        "signed",
        "sizeof",
        "static",
        "struct",
        "switch",
        "typedef",
        "union",
        "unsigned",
        "void",
        "volatile",
        "while",
    ]
)


@dataclass(frozen=True)
class Signals:
    """What an observer reads and estimates, by name.

    Args:
        states: estimated states.
        inputs: u.
        outputs: y.
        scheduling: r.
        units: name -> SI unit.

    Raises:
        BadInput: a name that is no C identifier.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    scheduling: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        for name in (*self.states, *self.inputs, *self.outputs, *self.scheduling):
            if not NAME.match(name) or name in _KEYWORDS:
                raise BadInput(f"The signal `{name}` is no C identifier; rename it with letters, digits and `_`.")

    @staticmethod
    def of(system: System | Switched) -> "Signals":
        """Return the signals of a plant.

        Args:
            system: plant.
        """
        plant = system.first if isinstance(system, Switched) else system
        units = dict(plant.units)
        if isinstance(system, Switched) and system.signal:
            units.setdefault(system.signal, system.unit)
        return Signals(plant.states, plant.inputs, plant.outputs, system.scheduling_names, units)


def distinct(names: Sequence[str]) -> list[str]:
    """Return the names with a number behind each that stands before it already.

    Args:
        names: C identifiers.
    """
    found: list[str] = []
    for name in names:
        count, other = 2, name
        while other in found:
            other, count = f"{name}_{count}", count + 1
        found.append(other)
    return found
