"""Guaranteed estimates along many runs of the drive: how wide they are and how often they are left."""

from functools import cache

from luenberger.experiment.gust_runs import VARIANTS, WORDS, Enclosure, enclosed
from luenberger.experiment.published.ifqir_car import NOISE, SHARE, SPEEDS, START, STATE_BOUND, STEP, Axles, switched
from luenberger.experiment.published.ifqir_estimates import runs
from luenberger.observers.unknown_input import UnknownInputObserver

__all__ = ["VARIANTS", "WORDS", "Enclosure", "enclosed", "observer", "variant_enclosure"]


@cache
def observer(
    variant: str = "c4",
    *,
    bounded: bool = True,
    share: float = SHARE,
    noise: float = NOISE,
    steering_error: float = 0.0,
) -> UnknownInputObserver:
    """Return the observer of the printed car with the gain that leaves only the zero; made once, so that a run compiles once.

    Args:
        variant: key of `VARIANTS`.
        bounded: with the printed bounds of the state.
        share: uncertainty of both stiffnesses.
        noise: bound of the error of the gyro [rad/s].
        steering_error: bound of the error of the steering angle [rad].
    """
    uncertainty, reuse, closed = VARIANTS[variant]
    modes = [Axles.at(v).decoupled(STEP) for v in SPEEDS]
    return UnknownInputObserver(
        switched(share, noise, steering_error),
        [m.K for m in modes],
        [m.H for m in modes],
        initial_half_width=[START, START],
        state_bound=STATE_BOUND if bounded else None,
        uncertainty=uncertainty,
        reuse_noise=reuse,
        closed_loop=closed,
    )


@cache
def variant_enclosure(variant: str, steering_error: float = 0.0) -> Enclosure:
    """Return the bounds of one variant along all runs.

    Args:
        variant: key of `VARIANTS`.
        steering_error: bound of the error of the steering angle [rad].
    """
    road, found = runs(steering_error)
    chosen = observer(variant, steering_error=steering_error) if steering_error else observer(variant)
    return enclosed(chosen, found, road.speed[:, None])
