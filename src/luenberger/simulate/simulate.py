"""Simulate a truth model: states, outputs, inputs and sensor readings as one trajectory."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax
import numpy as np

from luenberger.core import BadInput, LuenbergerError, Signal, Trajectory
from luenberger.core.checks import finite_array
from luenberger.simulate.inputs import Input, as_input, jumps
from luenberger.simulate.integrate import integrate, iterate
from luenberger.simulate.sensors import Sensor, measure


@runtime_checkable
class Model(Protocol):
    """What `simulate` asks of a truth model; every `System` is one, and so is a `TruthModel`."""

    @property
    def states(self) -> tuple[str, ...]: ...
    @property
    def inputs(self) -> tuple[str, ...]: ...
    @property
    def outputs(self) -> tuple[str, ...]: ...
    @property
    def scheduling_names(self) -> tuple[str, ...]: ...
    @property
    def units(self) -> Mapping[str, str]: ...
    @property
    def dt(self) -> float | None: ...
    @property
    def name(self) -> str: ...
    @property
    def dynamics(self) -> Callable[[Any, Any, Any, Any], Any]: ...
    @property
    def output(self) -> Callable[[Any, Any, Any, Any], Any]: ...


@dataclass(frozen=True)
class TruthModel:
    """A truth model from two JAX functions, for plants richer than a `System`: tyres, roads, actuators.

    Args:
        dynamics: (t, x, u, r) -> dx/dt, or next x for a discrete model; shape (nx,).
        output: (t, x, u, r) -> y, shape (ny,).
        states: names, nx of them.
        inputs: names, nu of them.
        outputs: names, ny of them; a name may repeat a state only where both are the same signal.
        scheduling_names: names of r.
        units: name -> SI unit text.
        dt: sample time [s] of a discrete model, None for a continuous one.
        name: how the model is called.
    """

    dynamics: Callable[[Any, Any, Any, Any], Any]
    output: Callable[[Any, Any, Any, Any], Any]
    states: tuple[str, ...]
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    scheduling_names: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    dt: float | None = None
    name: str = "truth"


def simulate(
    model: Model,
    *,
    time: Any,
    x0: Any,
    u: Any = None,
    r: Any = None,
    interpolation: str = "held",
    jump_times: Any = (),
    sensors: Sequence[Sensor] = (),
    seed: int = 0,
    rtol: float = 1e-10,
    atol: float = 1e-12,
    solver: Any = None,
    max_steps: int | None = None,
    name: str = "",
) -> Trajectory:
    """Integrate a truth model and return its states, outputs, inputs, scheduling and sensor readings.

    Args:
        model: a `System`, a `TruthModel`, or anything with their attributes.
        time: sample times [s], increasing; those of a discrete model in steps of its dt.
        x0: state at time[0], shape (nx,).
        u: input: JAX function of time, or samples (nt, nu); may be left out for a model without inputs.
        r: scheduling: JAX function of time, or samples (nt, nr).
        interpolation: samples are "held" to the next one, as observers assume, or joined "linear".
        jump_times: times [s] at which a function u or r jumps; jumps of held samples are known.
        sensors: readings to add.
        seed: seed of the sensors.
        rtol: relative tolerance a solver step.
        atol: absolute tolerance a solver step [unit of the states].
        solver: a diffrax solver, default Dopri8.
        max_steps: solver steps allowed, default 200 a sample and 10 000 more.
        name: name of the trajectory, default that of the model.

    Returns:
        Trajectory with the names and units of the model, sensor readings under `Sensor.measured_name`.

    Raises:
        BadInput: shapes, times or signals that do not fit the model.
        LuenbergerError: the integration did not reach the last time.
    """
    times, start = _times(model, time), finite_array("x0", x0)
    if start.shape != (len(model.states),):
        raise BadInput(
            f"`x0` has shape {start.shape} but the model has {len(model.states)} states; give one value for each."
        )
    inputs = as_input("u", u, times, len(model.inputs), interpolation)
    scheduling = as_input("r", r, times, len(model.scheduling_names), interpolation)
    _shapes(model)
    if model.dt is None:
        breaks = np.concatenate([jumps(inputs), jumps(scheduling), finite_array("jump_times", jump_times).reshape(-1)])
        breaks = np.unique(breaks[(breaks > times[0]) & (breaks < times[-1])])
        limit = 200 * times.size + 10_000 if max_steps is None else max_steps
        x = _integrated(model, times, start, inputs, scheduling, breaks, rtol, atol, solver, limit)
    else:
        x = np.asarray(iterate(model.dynamics, times, start, inputs, scheduling))
    trajectory = _trajectory(model, times, x, inputs, scheduling, name or model.name)
    return measure(trajectory, sensors, seed) if sensors else trajectory


@eqx.filter_jit
def _solve(dynamics: Any, *arguments: Any, **options: Any) -> Any:
    time, x0, u, r, breaks = arguments
    return integrate(dynamics, time, x0, u, r, jump_times=breaks, **options)


def _integrated(
    model: Model,
    time: np.ndarray,
    x0: np.ndarray,
    u: Input,
    r: Input,
    breaks: np.ndarray,
    rtol: float,
    atol: float,
    solver: Any,
    limit: int,
) -> np.ndarray:
    done = _solve(model.dynamics, time, x0, u, r, breaks, rtol=rtol, atol=atol, solver=solver, max_steps=limit)
    x = np.asarray(done.x)
    if not bool(done.succeeded):
        good = int(np.isfinite(x).all(axis=1).argmin()) - 1
        raise LuenbergerError(
            f"The integration of `{model.name}` came to t = {time[good]:g} s of {time[-1]:g} s with {int(done.steps)} solver steps "
            f"({limit} allowed); the last state is {np.array2string(x[good], precision=4)}. If it grows without bound the model or "
            "its input is at fault; if it is stiff give solver=diffrax.Kvaerno5(); else raise `max_steps` or the tolerances."
        )
    return x


def _times(model: Model, time: Any) -> np.ndarray:
    times = finite_array("time", time)
    if times.ndim != 1 or times.size < 2 or (np.diff(times) <= 0).any():
        raise BadInput(
            f"`time` has shape {times.shape}; at least two strictly increasing times [s] in shape (nt,) are needed."
        )
    if model.dt is not None:
        steps = np.diff(times)
        worst = int(np.abs(steps - model.dt).argmax())
        if abs(steps[worst] - model.dt) > 1e-6 * model.dt:
            raise BadInput(
                f"`time` steps by {steps[worst]:g} s at sample {worst + 1} but `{model.name}` is discrete with dt = {model.dt:g} s; "
                "give times in steps of dt."
            )
    return times


def _shapes(model: Model) -> None:
    counts = [len(names) for names in (model.states, model.inputs, model.scheduling_names)]
    like = [jax.ShapeDtypeStruct((), float), *(jax.ShapeDtypeStruct((n,), float) for n in counts)]
    for what, function, names in (("dynamics", model.dynamics, model.states), ("output", model.output, model.outputs)):
        shape = jax.eval_shape(function, *like).shape
        if shape != (len(names),):
            raise BadInput(
                f"`{what}` of `{model.name}` returns shape {shape} but its names are {list(names)}; ({len(names)},) is needed."
            )


def _trajectory(model: Model, time: np.ndarray, x: np.ndarray, u: Input, r: Input, name: str) -> Trajectory:
    u_samples, r_samples = (np.asarray(jax.vmap(signal)(time)) for signal in (u, r))
    y = np.asarray(jax.vmap(model.output)(time, x, u_samples, r_samples))
    if not np.isfinite(y).all():
        k, channel = np.argwhere(~np.isfinite(y))[0]
        raise LuenbergerError(
            f"The output `{model.outputs[channel]}` of `{model.name}` is {y[k, channel]} at t = {time[k]:g} s; the model leaves its domain there."
        )
    signals: dict[str, Signal] = {}
    groups = (
        (model.states, x, "state"),
        (model.inputs, u_samples, "input"),
        (model.scheduling_names, r_samples, "scheduling"),
        (model.outputs, y, "output"),
    )
    for names, values, kind in groups:
        for k, channel in enumerate(names):
            signal = Signal(channel, model.units.get(channel, ""), values[:, k], f"{kind} of {model.name}")
            known = signals.setdefault(channel, signal)
            if known is not signal and not np.allclose(known.values, signal.values, rtol=1e-12, atol=1e-12):
                raise BadInput(
                    f"`{channel}` of `{model.name}` names two different signals ({known.description}, {signal.description}); rename one."
                )
    return Trajectory(time, list(signals.values()), name, f"simulation of {model.name}")
