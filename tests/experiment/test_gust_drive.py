"""What driver and wind do on the drive, and what is unknown on many runs of it."""

import numpy as np

from luenberger.experiment.gust_drive import ADVERSARIES, CONSTANT, choices, windy_road

ROAD = {
    "speed": (6.05, 19.85),
    "modes": (8.5, 13.55, 18.05),
    "ends": (6.0, 11.0, 16.0, 19.899),
    "steering": 0.031,
    "steering_period": 7.5,
    "gust": 800.0,
    "gust_period": 10.0,
}


def test_the_drive_passes_every_mode_up_and_down_once() -> None:
    road = windy_road(500, 0.06, **ROAD)
    assert np.isclose(road.speed.min(), 6.05)
    assert np.isclose(road.speed.max(), 19.85, atol=1e-3)
    changes = np.diff(road.mode)[np.diff(road.mode) != 0]
    assert changes.tolist() == [1, 1, -1, -1]
    assert np.array_equal(road.local, np.array(ROAD["modes"])[road.mode])
    inside = [(ROAD["ends"][m] <= v < ROAD["ends"][m + 1]) for m, v in zip(road.mode, road.speed, strict=True)]
    assert all(inside)


def test_a_gust_comes_from_either_side_and_pauses() -> None:
    road = windy_road(500, 0.06, **ROAD)
    assert road.gust.max() == 800.0
    assert road.gust.min() == -800.0
    # It rises within half a second, so no step adds more than 0.06 / 0.5 of it.
    assert np.abs(np.diff(road.gust)).max() <= 800.0 * 0.06 / 0.5 + 1e-9
    assert not road.gust[road.time < 3.9].any()
    assert (road.gust == 0).mean() > 0.5


def test_choices_stay_within_their_bounds_and_hold_all_kinds_of_runs() -> None:
    found = choices(60, random=6, seed=2)
    count = 6 + CONSTANT + ADVERSARIES
    assert found.start.shape == (count, 2)
    assert found.stiffness.shape == found.noise.shape == (60, count, 2)
    for values in (found.start, found.stiffness, found.noise):
        assert np.abs(values).max() <= 1
    assert (np.abs(found.stiffness[:, :3]) == 1).all()
    assert (np.abs(found.stiffness[:, 3:6]) < 1).all()
    constant = found.stiffness[:, 6 : 6 + CONSTANT]
    assert (constant == constant[0]).all()
    assert len({tuple(c) for c in constant[0]}) == 4
    assert found.adversary[-ADVERSARIES:].tolist() == [1, -1, 1, -1]
    assert found.drops[-ADVERSARIES:].tolist() == [False, False, True, True]
    assert not found.adversary[:-ADVERSARIES].any()


def test_choices_follow_their_seed() -> None:
    one, again, other = (choices(20, random=2, seed=s).noise for s in (1, 1, 2))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)
