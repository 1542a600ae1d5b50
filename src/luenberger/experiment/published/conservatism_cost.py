"""How many scalars the inequality of a design leaves open."""

from luenberger.experiment.published.conservatism_entrants import BestRiccati
from luenberger.methods.channels import Channels
from luenberger.methods.full_block import FullBlockLuenberger
from luenberger.methods.method import Method, scheduled_variable
from luenberger.methods.printed_two_dof import PrintedTwoDof
from luenberger.methods.structured_lipschitz import StructuredLipschitz
from luenberger.methods.two_dof import TwoDofLuenberger
from luenberger.systems import System
from luenberger.systems.jacobian_box import as_floats


def unknowns(system: System, method: Method) -> int:
    """Return the number of scalar unknowns beside one storage matrix, one gain and its bound, those included.

    Args:
        system: what the method is given.
        method: one of the comparison.
    """
    nx, ny = system.nx, system.ny
    storage = nx * (nx + 1) // 2
    if isinstance(method, BestRiccati):
        # The gain follows from storage and weight.
        return storage + 1
    if isinstance(method, TwoDofLuenberger | PrintedTwoDof):
        return storage + _gain(system, nx, "ACF") + 1 + _multipliers(system, method)
    basic = storage + _gain(system, nx, "AC") + 1
    if isinstance(method, StructuredLipschitz):
        return basic + 1
    if isinstance(method, FullBlockLuenberger):
        return basic + _full_block(system)
    assert ny > 0
    return basic


def _gain(system: System, rows: int, like: str) -> int:
    shown = [as_floats(getattr(system, letter)) for letter in like]
    return sum(v.size for v in scheduled_variable(rows, system.ny, shown, system.scheduling_names, "Y")[1].values())


def _multipliers(system: System, method: TwoDofLuenberger | PrintedTwoDof) -> int:
    second = method.argument_gain_limit != 0
    if isinstance(method, PrintedTwoDof):
        return 1 + (_gain(system, system.nx, "ACF") if second else 0)
    channels = Channels.of(system, method.shift)
    if not second:
        return len(channels.pick)
    arguments = len(channels.arguments)
    return arguments + _gain(system, arguments, "ACF")


def _full_block(system: System) -> int:
    f = system.nonlinearity
    assert f is not None
    size = f.size + f.H.shape[0]
    shown = [as_floats(getattr(system, letter)).degree for letter in "ACF"]
    terms = 1
    for name in system.scheduling_names:
        terms *= 1 + max(d.get(name, 0) for d in shown)
    return terms * size * (size + 1) // 2
