"""How large what is left is: on motions of which every number is known."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from motions import RATE, TORQUE, Array, Motion

from cosim.diagnosis.evidence.adequacy import over_time, share_left, share_there


def comparing(motion: Motion, level: float | Array, weight: Array | None = None) -> Any:
    rows = len(motion.stacked("v"))
    problem = SimpleNamespace(prepared=motion, weight=np.ones(rows) if weight is None else weight)
    return SimpleNamespace(problem=problem, nuisances=SimpleNamespace(level=np.broadcast_to(level, rows)))


def steady(*seconds: int, speed: float = 1.0, torque: float = TORQUE) -> Motion:
    many = [one * RATE for one in seconds]
    return Motion({"v": [np.full(one, speed) for one in many], "tau": [np.full(one, torque) for one in many]})


def left(residual: Array) -> Any:
    return SimpleNamespace(residual=residual)


RIGHT = left(np.zeros(4 * RATE))
"""A structure that leaves nothing in training."""


def elsewhere(v: Array, moved: Array | None = None, **other: Array) -> Any:
    """Held-out recordings at a speed, and what may be otherwise there."""
    columns = np.empty((len(v), 0)) if moved is None else moved
    return SimpleNamespace(
        prepared=Motion({"v": [v], **{name: [one] for name, one in other.items()}}), moved=lambda _: columns
    )


FAST = np.tile([1.0, -1.0], 2 * RATE)


@pytest.mark.parametrize(("rest", "share"), [(0.5 + 0 * FAST, 0.25), (FAST, 0.0), (0.5 + FAST, 0.25)])
def test_a_constant_rest_counts_whole_and_one_that_changes_within_a_quarter_of_a_second_not_at_all(
    rest: Array, share: float
) -> None:
    assert share_left(comparing(steady(4), 2.0), left(rest)) == pytest.approx(share, rel=1e-12, abs=1e-12)


def test_only_rows_in_clear_motion_count_by_their_weight() -> None:
    motion = Motion({"v": [np.repeat([1.0, 0.0], 2 * RATE)], "tau": [np.full(4 * RATE, 2.0)]})
    rest = np.repeat([0.5, 9.0], 2 * RATE)
    assert share_left(comparing(motion, np.repeat([1.0, 7.0], 2 * RATE)), left(rest)) == pytest.approx(0.5, rel=1e-12)
    weight = np.repeat([1.0, 0.0, 1.0], [RATE, RATE, 2 * RATE])
    rest = np.repeat([0.5, 3.0, 9.0], [RATE, RATE, 2 * RATE])
    assert share_left(comparing(motion, 1.0, weight), left(rest)) == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize(("level", "expected"), [(2.0, 0.25), (0.3, 0.5 / 0.3), (0.1, 0.5 / 0.2), (0.0, 0.5 / 0.2)])
def test_where_friction_is_small_a_tenth_of_the_torque_stands_for_it(level: float, expected: float) -> None:
    assert share_left(comparing(steady(2), level), left(np.full(2 * RATE, 0.5))) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("open_", "wrong", "expected"), [(2.0, 0.0, 0.0), (0.02, 0.0, 0.125), (0.0, 0.0, 0.25), (0.1, 0.4, 0.2)]
)
def test_what_training_leaves_open_is_not_left_elsewhere(open_: float, wrong: float, expected: float) -> None:
    """A rest of 1 N m of 4; a number whose error there is `open_` N m moves by one error.

    Cells are as uncertain as those of training are wrong, .04 N m at least.
    """
    there = elsewhere(np.ones(RATE), np.full((RATE, 1), open_))
    moved = 4 * open_**2
    told = 1 - moved / (moved + max(wrong, 0.04) ** 2)
    found = share_there(comparing(steady(2), 4.0), left(np.full(2 * RATE, wrong)), np.ones(RATE), there)
    assert found == pytest.approx(0.25 * told, rel=1e-9)
    assert found == pytest.approx(expected, abs=0.01)


def test_friction_of_training_is_that_of_clear_motion_by_its_weight() -> None:
    there = elsewhere(np.ones(RATE))
    motion = Motion({"v": [np.repeat([1.0, 0.0], 2 * RATE)], "tau": [np.full(4 * RATE, 2.0)]})
    level, weight = (
        np.repeat([2.0, 6.0, 70.0], [RATE, RATE, 2 * RATE]),
        np.repeat([3.0, 1.0, 5.0], [RATE, RATE, 2 * RATE]),
    )
    clear = np.r_[np.full(RATE, 3.0), np.full(RATE - 1, 1.0)]  # the last row before the rest is near a turn
    expected = 1.0 / np.sqrt(clear @ level[: 2 * RATE - 1] ** 2 / clear.sum())
    assert share_there(comparing(motion, level, weight), RIGHT, np.ones(RATE), there) == pytest.approx(
        expected, rel=1e-3
    )


SECONDS = np.arange(8 * RATE) / RATE
TURNING = np.sign(np.sin(2 * np.pi * SECONDS) + 1e-9)
DRIFT = np.sin(2 * np.pi * SECONDS / 8)
LATE, EARLY = np.clip(SECONDS - 4, 0, 1), 0.2 * np.clip(2 - SECONDS, 0, 1)


@pytest.mark.parametrize("size", [1.0, 1e-6])
@pytest.mark.parametrize(
    ("rests", "shown"),
    [
        pytest.param([DRIFT, 0.5 * DRIFT], "time", id="a torque over time"),
        pytest.param([TURNING * DRIFT] * 2, "friction level over time", id="a friction level over time"),
        pytest.param([TURNING * DRIFT, 0.5 * DRIFT], "friction level over time", id="the level in the louder one"),
        pytest.param([LATE + TURNING * EARLY], "time", id="a torque that begins late"),
        pytest.param([TURNING * LATE + EARLY], "friction level over time", id="a level that begins late"),
    ],
)
def test_a_torque_or_a_friction_level_over_time_whichever_explains_more(
    rests: list[Array], shown: str, size: float
) -> None:
    turning = [TURNING] * len(rests)
    comparison = comparing(Motion({"v": turning, "tau": turning}), np.concatenate(turning))
    assert over_time(comparison, left(size * np.concatenate(rests))) == shown


@pytest.mark.parametrize("axis", ["q", "v", "tau"])
def test_what_is_left_where_training_never_was_is_nothing_left(axis: str) -> None:
    comparison, rest = comparing(steady(4), 2.0), np.repeat([0.0, 1.0], 2 * RATE)
    rows = {"q": np.zeros(4 * RATE), "v": np.ones(4 * RATE), "tau": np.full(4 * RATE, TORQUE)}
    inside = elsewhere(**{name: one.copy() for name, one in rows.items()})
    assert share_there(comparison, RIGHT, rest, inside) > 0.3
    rows[axis][2 * RATE :] += 0.1
    assert share_there(comparison, RIGHT, rest, elsewhere(**rows)) < 0.01
