"""Linear plants to and from python-control.

Not exported by the room: python-control loads matplotlib, which `import luenberger` should not pay for.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from luenberger.core import BadInput, MissingExtra
from luenberger.systems.system import System

if TYPE_CHECKING:
    from control import StateSpace

try:
    import control
except ImportError:
    control = None


def from_control(plant: "StateSpace") -> System:
    """Return a python-control state-space plant as a `System`, with its names and time base.

    The time base must be definite: dt = 0 is continuous, dt > 0 a step [s]. Units, unknown inputs and bounds are not
    known to python-control; add them with `system.replace(...)`.

    Args:
        plant: linear state-space system.

    Returns:
        plant with the same matrices, state, input and output names.

    Raises:
        MissingExtra: python-control is not installed.
        BadInput: not a `StateSpace`, or a time base of None or True, which leaves the step open.
    """
    library = _library()
    if not isinstance(plant, library.StateSpace):
        raise BadInput(
            f"`plant` is a {type(plant).__name__}; a control.StateSpace is needed. Convert it with `control.ss(plant)`."
        )
    if plant.dt is None or plant.dt is True:
        meaning = "open" if plant.dt is None else "discrete with an open step"
        raise BadInput(
            f"The time base of `{plant.name}` is dt = {plant.dt}, {meaning}; set `plant.dt = 0` for continuous time "
            "or the step in seconds."
        )
    return System.linear(
        plant.A,
        plant.B,
        plant.C,
        plant.D,
        dt=float(plant.dt) or None,
        states=plant.state_labels,
        inputs=plant.input_labels,
        outputs=plant.output_labels,
        name=plant.name,
    )


def to_control(system: System) -> "StateSpace":
    """Return a linear time-invariant plant as a python-control `StateSpace` with its names.

    The time base is 0 for a continuous plant. The unknown input E, the noise direction G and the units have no place
    there and stay behind.

    Args:
        system: plant without nonlinearity and without parameters in its matrices.

    Raises:
        MissingExtra: python-control is not installed.
        BadInput: the plant has no input, or is not linear time-invariant; freeze it first.
    """
    library = _library()
    if system.nonlinearity is not None:
        raise BadInput(
            f"`{system.name}` has a nonlinearity; a StateSpace is linear. Linearise it, or leave the nonlinearity out."
        )
    used = sorted({name for matrix in system.matrices.values() for name in matrix.names})
    if used:
        call = ", ".join(f"{name}=..." for name in used)
        raise BadInput(f"`{system.name}` depends on {used}; a StateSpace is constant. Convert `system.freeze({call})`.")
    if not system.nu:
        raise BadInput(
            f"`{system.name}` has no input, and python-control holds no such plant; give `B` and `D`, zero columns will do."
        )
    A, B, C, D = (np.asarray(matrix({}), dtype=float) for letter, matrix in system.matrices.items() if letter in "ABCD")
    return library.StateSpace(
        A,
        B,
        C,
        D,
        0 if system.dt is None else system.dt,
        states=list(system.states),
        inputs=list(system.inputs),
        outputs=list(system.outputs),
        name=system.name,
        remove_useless_states=False,
    )


def _library() -> Any:
    if control is None:
        raise MissingExtra('python-control is not installed; run `pip install "luenberger[control]"`.')
    return control
