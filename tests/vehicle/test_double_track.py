"""The double track: balances of load, force and energy, its limits, and the linear single track it has to contain."""

from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from luenberger.core import BadInput, Trajectory
from luenberger.simulate import Model, integrate, simulate
from luenberger.vehicle import Quantity, SingleTrack, VehicleParameters, carmaker_car, slip_angles, wang_car
from luenberger.vehicle.combined_tyres import DugoffTyre
from luenberger.vehicle.double_track import DoubleTrack, magic_formula_wheels
from luenberger.vehicle.double_track_parameters import DoubleTrackParameters
from luenberger.vehicle.parameters import GRAVITY
from luenberger.vehicle.road import Road

WANG = DoubleTrackParameters.of(wang_car)
TRACK = DoubleTrack(WANG)
STATE = {name: k for k, name in enumerate(DoubleTrack.states)}
OUTPUT = {name: k for k, name in enumerate(DoubleTrack.outputs)}
# What changes sign when left and right change places; the slips of the two sides also change places.
ODD = np.array([1, -1, -1, 1, -1, -1, -1, -1, -1, 1, -1, -1, -1, -1])
TIME = np.arange(0.0, 5.0, 0.02)
SIDES = [*range(10), 11, 10, 13, 12]


def states(seed: int, count: int) -> np.ndarray:
    """Driving from walking pace to motorway, sliding, rolling and steering hard."""
    spread = np.array([50, 5, 3, 20, 4, 1.5, 0.1, 1.0, 0.4, 8, 0.3, 0.3, 0.3, 0.3])
    middle = np.zeros(14)
    middle[3] = 22.0
    return middle + spread * np.random.default_rng(seed).uniform(-1, 1, (count, 14))


def run(model: DoubleTrack, speed: float, angle: Any, demand: Any = 0.0, **more: float) -> Trajectory:
    """Five seconds from straight running; one length and one solver for all, so that few compilations serve every test."""
    u = np.stack([np.broadcast_to(angle, TIME.shape), np.broadcast_to(demand, TIME.shape)], axis=1)
    x0 = np.array(model.start(speed))
    for name, value in more.items():
        x0[STATE[name]] = value
    options = {"interpolation": "linear", "rtol": 1e-7, "atol": 1e-9, "solver": diffrax.Tsit5()}
    return simulate(model, time=TIME, x0=x0, u=u, **options)


def test_it_is_a_model_with_a_unit_for_every_name() -> None:
    assert isinstance(TRACK, Model)
    names = {*TRACK.states, *TRACK.inputs, *TRACK.outputs}
    assert {name for name in names if not TRACK.units.get(name)} == set()
    assert set(TRACK.units) == names


def test_wheel_loads_carry_the_car_and_are_never_negative() -> None:
    extreme = states(1, 400) * np.array([1, 1, 1, 1, 1, 1, 4, 4, 1, 4, 1, 1, 1, 1])
    loads = np.asarray(jax.vmap(lambda x: TRACK.wheels(x, jnp.zeros(2)).load)(jnp.asarray(extreme)))
    np.testing.assert_allclose(loads.sum(axis=1), 800.0 * GRAVITY, rtol=1e-14)
    assert loads.min() >= 0
    assert (loads == 0).any()


def test_forces_stay_in_the_friction_circle_of_each_wheel() -> None:
    draw = np.random.default_rng(2)
    u = np.stack([np.zeros(100), draw.uniform(-12, 12, 100)], axis=1)
    wheels = jax.vmap(TRACK.wheels)(states(3, 100), u)
    used = np.hypot(wheels.longitudinal, wheels.lateral)
    assert (used <= 0.85 * np.asarray(wheels.load) * (1 + 1e-12)).all()
    assert (used > 0.8 * np.asarray(wheels.load)).any()
    np.testing.assert_allclose(np.hypot(wheels.forward, wheels.sideward), used, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("along", ["x", "y"])
def test_wheels_move_and_stand_where_complex_numbers_say(along: str) -> None:
    a, b, f, r = 0.948, 1.422, WANG.front_track / 2, WANG.rear_track / 2
    place = np.array([a + 1j * f, a - 1j * f, -b + 1j * r, -b - 1j * r])
    split = DoubleTrack(WANG, Road.lanes([0.0], [0.2, 0.8], along=along, transition=8.0))
    for x in states(6, 20) * np.array([0.05, 0.2, *[1] * 12]):
        steer = np.array([x[8], x[8], 0, 0])
        velocity = (x[3] + 1j * x[4] + 1j * x[5] * place) * np.exp(-1j * steer)
        wheels = split.wheels(jnp.asarray(x), jnp.array([0.0, -50.0]))
        rolling = np.maximum(np.abs(velocity.real), 0.5)
        np.testing.assert_allclose(wheels.slip, -np.arctan(velocity.imag / rolling), atol=1e-13)
        np.testing.assert_allclose(wheels.rolling, rolling, rtol=1e-13)
        # Full braking shows the friction below each wheel.
        found = x[0] + 1j * x[1] + np.exp(1j * x[2]) * place
        friction = np.asarray(split.road.friction(found.real, found.imag))
        np.testing.assert_allclose(wheels.longitudinal, -0.95 * friction * np.asarray(wheels.load), rtol=1e-12)


def test_left_and_right_are_mirror_images() -> None:
    for x in states(4, 40):
        u = np.array([0.1, -3.0])
        mirrored = TRACK.dynamics(0.0, (ODD * x)[SIDES], u * [-1, 1])
        # Sums of forces of 1e4 N over inertias of 1e2 kg m^2: rounding near 1e-12.
        np.testing.assert_allclose(mirrored, (ODD * np.asarray(TRACK.dynamics(0.0, x, u)))[SIDES], atol=1e-10)


def test_energy_changes_by_the_power_at_the_contacts_and_the_dampers_alone() -> None:
    p, car = WANG, wang_car
    springs = p.roll_stiffness - car.mass * GRAVITY * p.centre_height

    def energy(x: Any) -> Any:
        body = x[4] - p.centre_height * x[7]
        motion = car.mass * (x[3] ** 2 + body**2) + car.yaw_inertia * x[5] ** 2 + p.roll_inertia * x[7] ** 2
        return (motion + springs * x[6] ** 2) / 2

    a, b, f, r = car.front_axle_distance, car.rear_axle_distance, p.front_track / 2, p.rear_track / 2
    for x in states(5, 40):
        u = jnp.array([0.0, -2.0])
        power = jax.jvp(energy, (jnp.asarray(x),), (TRACK.dynamics(0.0, x, u),))[1]
        wheels = TRACK.wheels(jnp.asarray(x), u)
        at = zip([a, a, -b, -b], [f, -f, r, -r], wheels.forward, wheels.sideward, strict=True)
        contacts = sum(Fx * (x[3] - y * x[5]) + Fy * (x[4] + z * x[5]) for z, y, Fx, Fy in at)
        assert float(power) == pytest.approx(float(contacts) - p.roll_damping * x[7] ** 2, rel=1e-10, abs=1e-6)


@pytest.mark.parametrize("car", [wang_car, carmaker_car], ids=lambda c: c.name)
@pytest.mark.parametrize("speed", [8.0, 20.0, 30.0])
def test_gentle_steady_cornering_is_that_of_the_linear_single_track(car: VehicleParameters, speed: float) -> None:
    linear, delta = SingleTrack(car), 0.002
    at_rest = [linear(0.0, np.zeros(2), np.array([delta]), np.array([speed]))]
    slopes = jax.jacfwd(lambda x: linear(0.0, x, np.array([delta]), np.array([speed])))(np.zeros(2))
    vy, yaw_rate = np.linalg.solve(np.asarray(slopes), -np.asarray(at_rest[0]))
    found = run(DoubleTrack(DoubleTrackParameters.of(car)), speed, delta)
    # 1 %: what is left is load transfer and the tyre curve, of second order in the steering angle.
    assert found["yaw_rate"].values[-1] == pytest.approx(yaw_rate, rel=0.01)
    assert found["lateral_speed"].values[-1] == pytest.approx(vy, rel=0.01, abs=1e-4)
    assert found["lateral_acceleration"].values[-1] == pytest.approx(speed * yaw_rate, rel=0.01)


def test_hard_steering_leaves_the_linear_single_track() -> None:
    gentle, hard = (run(TRACK, 20.0, delta)["lateral_acceleration"].values for delta in (0.002, 0.08))
    # Linear tyres would ask for 13 m/s^2 where the road gives 8.
    assert 40 * gentle[-1] > 13.0
    assert 7.0 < np.abs(hard).max() < 0.85 * GRAVITY


def test_the_car_stands_still_when_it_stands() -> None:
    for steering, demand in ((0.0, 0.0), (0.5, -6.0), (-0.3, -1.0)):
        x = TRACK.start(0.0).at[STATE["steering"]].set(steering)
        np.testing.assert_array_equal(TRACK.dynamics(0.0, x, jnp.array([steering, demand])), np.zeros(14))


def test_braking_ends_at_standstill_and_not_in_reverse() -> None:
    found = run(TRACK, 10.0, 0.05, -5.0)
    speed = found["speed"].values
    # The brake fades as exp(-10 t) below 0.5 m/s; steered tyres wound up by the stop swing the car back a little.
    assert speed.min() > -1e-4
    assert abs(speed[-1]) < 1e-4
    assert np.abs(found.table(["lateral_speed", "yaw_rate", "roll_rate"])[-1]).max() < 1e-3


def test_a_sideways_push_dies_out_at_standstill_with_the_brakes_on() -> None:
    found = run(TRACK, 0.0, 0.3, -3.0, lateral_speed=1.0, yaw_rate=0.5, steering=0.3)
    assert np.abs(found.table(["speed", "lateral_speed", "yaw_rate"])[-1]).max() < 0.02


@pytest.mark.parametrize("friction", [0.2, 0.4, 0.85])
def test_friction_bounds_what_a_corner_can_give(friction: float) -> None:
    icy = DoubleTrack(WANG, Road.uniform(friction))
    peak = np.abs(run(icy, 20.0, 0.04 * TIME)["lateral_acceleration"].values).max()
    # All four wheels would have to peak together to reach mu g.
    assert 0.85 * friction * GRAVITY < peak < friction * GRAVITY


def test_the_road_below_each_wheel_counts() -> None:
    split = DoubleTrack(WANG, Road.lanes([0.0], [0.2, 0.9], transition=0.2))
    wheels = split.wheels(split.start(20.0), jnp.array([0.0, -8.0]))
    np.testing.assert_allclose(
        wheels.longitudinal[jnp.array([1, 3])], -0.95 * 0.2 * wheels.load[jnp.array([1, 3])], rtol=1e-12
    )
    # More friction on the left turns the car to the left.
    assert float(split.dynamics(0.0, split.start(20.0), jnp.array([0.0, -8.0]))[STATE["yaw_rate"]]) > 1.0
    turned = split.start(20.0).at[STATE["yaw"]].set(jnp.pi)
    assert float(split.dynamics(0.0, turned, jnp.array([0.0, -8.0]))[STATE["yaw_rate"]]) < -1.0


def test_a_soft_stretch_scales_the_stiffness_and_not_the_peak() -> None:
    soft = DoubleTrack(WANG, Road.lanes([50.0], [0.85, 0.85], [1.0, 0.6], along="x"))
    slip = jnp.array([1e-5, 1e-5, 1e-5, 1e-5])
    before, behind = (soft.start(20.0).at[0].set(place).at[10:].set(slip) for place in (0.0, 80.0))
    forces = [np.asarray(soft.wheels(x, jnp.zeros(2)).lateral) for x in (before, behind)]
    np.testing.assert_allclose(forces[1], 0.6 * forces[0], rtol=1e-6)
    sweep = jax.vmap(lambda x, s: soft.wheels(x.at[10:].set(s), jnp.zeros(2)).lateral[0], (None, 0))
    peaks = [float(sweep(x, jnp.linspace(0, 0.8, 400)).max()) for x in (before, behind)]
    assert peaks[1] == pytest.approx(peaks[0], rel=1e-4)


def test_braking_in_a_corner_takes_lateral_force() -> None:
    x = TRACK.start(20.0).at[10:].set(0.05)
    free, braked = (np.asarray(TRACK.wheels(x, jnp.array([0.0, d])).lateral) for d in (0.0, -6.0))
    assert (braked < free).all()
    used = 0.65 * 800 * 6 / 2 / (0.85 * float(TRACK.wheels(x, jnp.zeros(2)).load[0]))
    assert braked[0] == pytest.approx(free[0] * np.sqrt(1 - used**2), rel=1e-12)


def test_acceleration_follows_the_demand_until_friction_ends() -> None:
    assert run(TRACK, 20.0, 0.0, -4.0)["acceleration"].values[100] == pytest.approx(-4.0, rel=1e-12)
    hard = run(TRACK, 20.0, 0.0, -30.0)
    assert hard["acceleration"].values[100] == pytest.approx(-0.95 * 0.85 * GRAVITY, rel=1e-9)
    front = hard["load_front_left"].values + hard["load_front_right"].values
    moved = 800.0 * 0.5 * 0.95 * 0.85 * GRAVITY / wang_car.wheelbase
    # The load lags by 0.1 s: exp(-20) after 2 s.
    assert front[100] == pytest.approx(wang_car.mass * GRAVITY * 0.6 + moved, rel=1e-5)


def test_relaxation_has_the_time_constant_of_its_length() -> None:
    soft = eqx.tree_at(lambda m: (m.front_tyre.cornering, m.rear_tyre.cornering), TRACK, (jnp.asarray(1e-6),) * 2)
    for speed in (5.0, 25.0):
        # Without tyre forces the car runs straight, and the front slip is the steering angle, lagging.
        found = run(soft, speed, 0.001, steering=0.001)["lagged_slip_front_right"].values
        # The contact renews at vx cos(delta), 5e-7 less than vx; the rest is the solver.
        np.testing.assert_allclose(found, 0.001 * (1 - np.exp(-TIME * speed / 0.4)), rtol=1e-6, atol=3e-9)


def test_the_steering_lags_and_has_a_greatest_rate() -> None:
    small, large = (run(TRACK, 20.0, delta)["steering"].values for delta in (0.01, 0.4))
    # The solver's tolerance.
    np.testing.assert_allclose(small, 0.01 * (1 - np.exp(-TIME / 0.05)), atol=1e-7)
    rates = np.diff(large) / 0.02
    assert rates.max() == pytest.approx(0.8, rel=1e-6)
    np.testing.assert_allclose(rates[:10], 0.8, rtol=1e-6)


def test_the_body_leans_outwards_by_the_spring_law() -> None:
    found = run(TRACK, 15.0, 0.03)
    lean, ay = found["roll"].values[-1], found["lateral_acceleration"].values[-1]
    tipping = 800.0 * GRAVITY * 0.5
    assert lean == pytest.approx(800.0 * 0.5 * ay / (WANG.roll_stiffness - tipping), rel=0.005)
    reading = found["lateral_accelerometer"].values[-1]
    assert reading == pytest.approx(ay * np.cos(lean) + GRAVITY * np.sin(lean), rel=1e-12)
    right = found["load_front_right"].values[-1] - found["load_front_left"].values[-1]
    # Roll moment at the front axle over half the track; the body is nearly at rest.
    assert right == pytest.approx(2 * 0.55 * WANG.roll_stiffness * lean / WANG.front_track, rel=0.01)


def test_outputs_are_what_their_names_say() -> None:
    found = run(TRACK, 20.0, 0.06 * np.sin(3 * TIME), -1.0)
    vy, r, vx, delta = (found[name].values for name in ("lateral_speed", "yaw_rate", "speed", "steering"))
    front, rear = slip_angles(vy, r, vx, delta, wang_car)
    np.testing.assert_allclose(found["front_slip"].values, front, atol=1e-14)
    np.testing.assert_allclose(found["rear_slip"].values, rear, atol=1e-14)
    np.testing.assert_allclose(found["front_slip_exact"].values, delta - np.arctan((vy + 0.948 * r) / vx), atol=1e-14)
    np.testing.assert_allclose(found["sideslip"].values, np.arctan(vy / vx), atol=1e-14)
    # Central differences at 0.02 s of signals below 1 Hz: third derivatives of some 10 m/s^4 times 0.02^2 / 6.
    rate = np.gradient(vx, found.time)[1:-1]
    np.testing.assert_allclose(found["acceleration"].values[3:-3], rate[2:-2], atol=0.02)
    body = found["body_lateral_speed"].values
    inertial = np.gradient(body, found.time) + vx * r
    np.testing.assert_allclose(found["lateral_acceleration"].values[10:-3], inertial[10:-3], atol=0.05)


def test_parameters_vary_under_vmap() -> None:
    masses = jnp.array([700.0, 800.0, 1000.0])
    time = jnp.linspace(0.0, 1.0, 11)

    def yaw_rate(mass: Any) -> Any:
        model = eqx.tree_at(lambda m: m.mass, TRACK, mass)
        held = integrate(
            model.dynamics,
            time,
            model.start(20.0),
            lambda t: jnp.array([0.03, 0.0]),
            lambda t: None,
            solver=diffrax.Tsit5(),
        )
        return held.x[-1, STATE["yaw_rate"]]

    together = jax.jit(jax.vmap(yaw_rate))(masses)
    assert len(np.unique(np.round(together, 4))) == 3
    np.testing.assert_allclose(together, [yaw_rate(mass) for mass in masses], rtol=1e-8)


def test_other_tyres_may_be_fitted() -> None:
    front, rear = (
        DugoffTyre(t.cornering, t.slip_stiffness, t.nominal_load, t.peak_load) for t in magic_formula_wheels(WANG)
    )
    other = DoubleTrack(WANG, front_tyre=front, rear_tyre=rear)
    gentle = [run(model, 20.0, 0.002)["yaw_rate"].values[-1] for model in (TRACK, other)]
    hard = [run(model, 20.0, 0.035)["rear_slip"].values[-1] for model in (TRACK, other)]
    assert gentle[1] == pytest.approx(gentle[0], rel=0.01)
    # Dugoff bends later: at 0.6 g it needs less slip for the same force.
    assert hard[1] < 0.97 * hard[0]


def test_pairs_of_wheels_have_the_stiffness_of_the_axle_at_static_load() -> None:
    for tyre, stiffness, load in zip(magic_formula_wheels(WANG), (76500.0, 51000.0), (0.6, 0.4), strict=True):
        assert 2 * float(tyre.cornering_at(800.0 * GRAVITY * load / 2)) == pytest.approx(stiffness, rel=1e-14)


def test_every_number_has_a_unit_and_a_source() -> None:
    rows = DoubleTrackParameters.of(carmaker_car, "a data sheet", front_track=1.55).table()
    named = {row.name: row for row in rows}
    assert len(named) == len(rows)
    assert all(row.source not in ("", "not stated") and row.meaning for row in rows)
    assert (named["front_track"].value, named["front_track"].source) == (1.55, "a data sheet")
    assert named["centre_height"].value == carmaker_car.centre_height
    assert named["centre_height"].source == carmaker_car.source("centre_height")
    assert named["rear_track"].source.startswith("assumed")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: DoubleTrackParameters.of(wang_car, front_width=1.0), "Did you mean `front_track`|unknown key"),
        (lambda: DoubleTrackParameters.of(wang_car, front_track=-1.0), "`front_track` .* is -1 m"),
        (lambda: DoubleTrackParameters.of(wang_car, front_roll_share=1.2), "is 1.2 ; a share from 0 to 1|share"),
        (lambda: DoubleTrackParameters.of(wang_car, tyre_shape=2.5), "from 1 to below 2"),
        (lambda: DoubleTrackParameters.of(wang_car, roll_stiffness=1e3), "more than m g h = 3922"),
        (lambda: DoubleTrackParameters.stated(wang_car, friction=Quantity(0.9, "", "guess")), "lacks `centre_height`"),
    ],
)
def test_what_is_no_double_track_is_refused(make: Any, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        make()


def test_a_wrong_unit_is_refused() -> None:
    rows = [r for r in WANG.table() if r.name not in {row.name for row in wang_car.table()} - {"friction"}]
    quantities = {row.name: Quantity(row.value, row.unit, row.source) for row in rows}
    assert DoubleTrackParameters.stated(wang_car, **quantities) == WANG
    quantities["front_track"] = Quantity(137.0, "cm", "tape measure")
    with pytest.raises(BadInput, match="given in `cm`; it needs to be in `m`"):
        DoubleTrackParameters.stated(wang_car, **quantities)
