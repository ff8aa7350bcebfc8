"""How large what is left is, and when a fitted effect is none: on motions of which every number is known."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from cosim.diagnosis import admissibility
from cosim.diagnosis.adequacy import over_time, share_left, share_there
from cosim.diagnosis.admissibility import in_time, is_admissible, is_degenerate, needs_turns

Array = npt.NDArray[np.float64]
RATE = 200
"""Rows in a second."""


@dataclass
class Motion:
    """Recordings one after the other, each from its time 0, as the parts of a diagnosis see them."""

    columns: dict[str, list[Array]]
    asked: list[bool] = field(default_factory=list)

    @property
    def pieces(self) -> list[Any]:
        speeds = self.columns["v"]
        many = [len(one) for one in speeds]
        q = self.columns.get("q", [np.zeros(count) for count in many])
        asked = self.asked or [True] * len(many)
        rows = {"dt": 1 / RATE, "cutoff": RATE}
        return [
            SimpleNamespace(
                kept=np.arange(len(v)),
                t=np.arange(len(v)) / RATE,
                q=place,
                v=v,
                inside=slice(1, -1),
                asked=wanted,
                **rows,
            )
            for v, place, wanted in zip(speeds, q, asked, strict=True)
        ]

    @property
    def recording_of(self) -> Array:
        return np.concatenate([np.full(len(one), k) for k, one in enumerate(self.columns["v"])])

    def stacked(self, name: str) -> Array:
        if name == "t":
            return np.concatenate([piece.t for piece in self.pieces])
        return np.concatenate(self.columns[name])


def comparing(motion: Motion, level: float | Array, weight: Array | None = None) -> Any:
    rows = len(motion.stacked("v"))
    problem = SimpleNamespace(prepared=motion, weight=np.ones(rows) if weight is None else weight)
    return SimpleNamespace(problem=problem, nuisances=SimpleNamespace(level=np.broadcast_to(level, rows)))


def steady(*seconds: int, speed: float = 1.0, torque: float = 2.0) -> Motion:
    many = [one * RATE for one in seconds]
    return Motion({"v": [np.full(one, speed) for one in many], "tau": [np.full(one, torque) for one in many]})


def left(residual: Array) -> Any:
    return SimpleNamespace(residual=residual)


RIGHT, RIGHT_LONG = left(np.zeros(2 * RATE)), left(np.zeros(4 * RATE))
"""Structures that leave nothing in training."""


def elsewhere(v: Array, moved: Array | None = None) -> Any:
    """Held-out recordings at a speed, and what may be otherwise there."""
    columns = np.empty((len(v), 0)) if moved is None else moved
    return SimpleNamespace(prepared=Motion({"v": [v]}), moved=lambda _: columns)


def test_a_constant_rest_counts_whole_and_one_that_changes_within_a_quarter_of_a_second_not_at_all() -> None:
    comparison = comparing(steady(4), 2.0)
    fast = np.tile([1.0, -1.0], 2 * RATE)
    assert share_left(comparison, left(np.full(4 * RATE, 0.5))) == pytest.approx(0.25, rel=1e-12)
    assert share_left(comparison, left(fast)) == pytest.approx(0.0, abs=1e-12)
    assert share_left(comparison, left(0.5 + fast)) == pytest.approx(0.25, rel=1e-12)


def test_cells_of_a_quarter_of_a_second_do_not_reach_into_the_next_recording() -> None:
    """A rest that changes its sign each quarter stays whole; the second recording begins a cell of its own."""
    comparison = comparing(steady(1, 1), 1.0)
    signs = np.repeat([1.0, -1.0, 1.0, -1.0], RATE // 4)
    assert share_left(comparison, left(np.concatenate([signs, -signs]))) == pytest.approx(1.0, rel=1e-12)
    assert share_left(comparison, left(np.roll(np.concatenate([signs, signs]), RATE // 8))) < 0.6


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


def test_what_is_left_elsewhere_is_told_by_the_friction_of_training() -> None:
    there = elsewhere(np.repeat([1.0, 0.0], RATE))
    rest = np.repeat([1.0, 50.0], RATE)
    assert share_there(comparing(steady(2), 4.0), RIGHT, rest, there) == pytest.approx(0.25, rel=1e-12)


@pytest.mark.parametrize(("open_", "expected"), [(2.0, 0.0), (0.02, 0.125), (0.0, 0.25)])
def test_what_training_leaves_open_is_not_left_elsewhere(open_: float, expected: float) -> None:
    """A rest of 1 N m; a number whose error there is `open_` N m moves by one error, as cells are wrong by .04 N m."""
    there = elsewhere(np.ones(RATE), np.full((RATE, 1), open_))
    four = np.ones(4)
    told = 1 - open_**2 * (four @ four) / (open_**2 * (four @ four) + 0.04**2)
    found = share_there(comparing(steady(2), 4.0), RIGHT, np.ones(RATE), there)
    assert found == pytest.approx(0.25 * told, rel=1e-9)
    assert found == pytest.approx(expected, abs=0.01)


def test_cells_elsewhere_are_as_uncertain_as_those_of_training_are_wrong() -> None:
    there = elsewhere(np.ones(RATE), np.full((RATE, 1), 0.1))
    wrong = left(np.full(2 * RATE, 0.4))
    assert share_there(comparing(steady(2), 4.0), wrong, np.ones(RATE), there) == pytest.approx(0.25 / 1.25, rel=1e-9)


def test_friction_of_training_is_that_of_clear_motion_by_its_weight() -> None:
    there = elsewhere(np.ones(RATE))
    motion = Motion({"v": [np.repeat([1.0, 0.0], 2 * RATE)], "tau": [np.full(4 * RATE, 2.0)]})
    level, weight = (
        np.repeat([2.0, 6.0, 70.0], [RATE, RATE, 2 * RATE]),
        np.repeat([3.0, 1.0, 5.0], [RATE, RATE, 2 * RATE]),
    )
    clear = np.r_[np.full(RATE, 3.0), np.full(RATE - 1, 1.0)]  # the last row before the rest is near a turn
    expected = 1.0 / np.sqrt(clear @ level[: 2 * RATE - 1] ** 2 / clear.sum())
    assert share_there(comparing(motion, level, weight), RIGHT_LONG, np.ones(RATE), there) == pytest.approx(
        expected, rel=1e-3
    )


@pytest.mark.parametrize("size", [1.0, 1e-6])
def test_a_torque_or_a_friction_level_over_time_whichever_explains_more(size: float) -> None:
    seconds = np.arange(8 * RATE) / RATE
    drift = size * np.sin(2 * np.pi * seconds / 8)
    turning = np.sign(np.sin(2 * np.pi * seconds) + 1e-9)
    motion = Motion({"v": [turning, turning], "tau": [turning, turning]})
    comparison = comparing(motion, np.tile(turning, 2))
    assert over_time(comparison, left(np.concatenate([drift, 0.5 * drift]))) == "time"
    assert over_time(comparison, left(np.tile(turning * drift, 2))) == "friction level over time"
    assert over_time(comparison, left(np.concatenate([turning * drift, 0.5 * drift]))) == "friction level over time"


def test_what_begins_late_in_a_recording_counts_as_what_is_there_from_its_start() -> None:
    seconds = np.arange(8 * RATE) / RATE
    turning = np.sign(np.sin(2 * np.pi * seconds) + 1e-9)
    motion = Motion({"v": [turning], "tau": [turning]})
    late = np.clip(seconds - 4, 0, 1)
    early = 0.2 * np.clip(2 - seconds, 0, 1)
    comparison = comparing(motion, turning)
    assert over_time(comparison, left(late + turning * early)) == "time"
    assert over_time(comparison, left(turning * late + early)) == "friction level over time"


# Admissibility


class Hypothesis:
    """What an effect declares, as a table."""

    sizes = ()

    def __init__(
        self,
        plausible: bool = True,
        shown: bool = True,
        degenerate: bool = False,
        back: float = 0.0,
        timing: bool = True,
    ) -> None:
        self.plausible, self.shown, self.degenerate = plausible, shown, degenerate
        self.back, self.is_timing = back, timing

    def is_plausible(self, effect: object, mount: object) -> bool:
        return self.plausible

    def shows(self, effect: object, mount: object, prepared: object) -> bool:
        return self.shown

    def is_degenerate(self, problem: object, effect: object) -> bool:
        return self.degenerate

    def way_back(self, effect: object, mount: object) -> float:
        return self.back


@dataclass(frozen=True)
class Effect:
    broken: str = ""

    def broken_rule(self) -> str:
        return self.broken


def asked(monkeypatch: pytest.MonkeyPatch, at_bound: bool = False, **said: Any) -> None:
    monkeypatch.setattr(admissibility, "hypothesis_of", lambda effect: Hypothesis(**said))
    monkeypatch.setattr(admissibility, "at_bound", lambda effect, sizes: at_bound)


def to_and_fro(*reach: float) -> Motion:
    """Each recording goes from 0 to 1 and back by so much; its first and last row are not inside."""
    q = [np.array([-9.0, 0.0, 0.5, 1.0, 1.0 - back, 9.0]) for back in reach]
    return Motion({"v": [np.ones(6) for _ in reach], "q": q})


@pytest.mark.parametrize(("back", "needed"), [(0.29, False), (0.3, False), (0.31, True)])
def test_friction_is_told_by_the_longest_way_back_of_any_recording(
    back: float, needed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked(monkeypatch, back=back)
    for motion in (to_and_fro(0.3, 0.1), to_and_fro(0.1, 0.3)):
        assert needs_turns(Effect(), None, motion) is needed  # type: ignore[arg-type]
    down = Motion({"v": [np.ones(6)], "q": [-one for one in to_and_fro(0.3).columns["q"]]})
    assert needs_turns(Effect(), None, down) is needed, "whichever way it goes first"  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("effect", "said", "degenerate", "admissible"),
    [
        (Effect(), {}, False, True),
        (Effect("a rule"), {}, True, False),
        (Effect(), {"at_bound": True}, True, False),
        (Effect(), {"degenerate": True}, True, False),
        (Effect(), {"plausible": False}, False, False),
        (Effect(), {"shown": False}, False, False),
        (Effect(), {"back": 0.5}, False, False),
    ],
)
def test_an_effect_is_admissible_if_nothing_speaks_against_it(
    effect: Effect, said: dict[str, Any], degenerate: bool, admissible: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked(monkeypatch, **said)
    problem: Any = SimpleNamespace(prepared=to_and_fro(0.3))
    one: Any = SimpleNamespace(effect=effect, fit=SimpleNamespace(mount=None))
    assert is_degenerate(problem, effect) is degenerate  # type: ignore[arg-type]
    assert is_admissible(problem, one) is admissible


def timed(residual: Array, torque: Array, **more: Any) -> bool:
    motion = Motion({"v": [np.ones(4), np.ones(4)], "tau": [torque[:4], torque[4:]]}, **more)
    problem: Any = SimpleNamespace(prepared=motion, weight=np.ones(8))
    return in_time(problem, SimpleNamespace(effect=Effect(), fit=SimpleNamespace(residual=residual)))  # type: ignore[arg-type]


def test_timing_is_told_where_half_of_the_torques_changes_are_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    asked(monkeypatch)
    torque = np.array([0.0, 2.0, 0.0, 2.0, 100.0, 102.0, 100.0, 102.0])
    assert timed(torque * 0.7, torque), "0.49 of the energy is left"
    assert not timed(torque * 0.71, torque), "0.504 of the energy is left"
    assert not timed(torque * np.repeat([1.0, 0.0], 4), torque), "exactly half"
    wild = np.concatenate([torque[:4] * 0.1, torque[4:] * 5 + 1e6])
    assert not timed(wild, torque)
    assert timed(wild, torque, asked=[True, False]), "nothing is asked in the second recording"
    asked(monkeypatch, timing=False)
    assert timed(torque * 9, torque), "no effect of timing"


def test_rows_without_weight_and_the_step_between_recordings_tell_nothing_of_timing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked(monkeypatch)
    torque = np.array([0.0, 2.0, 0.0, 2.0, 0.0, 2.0, 0.0, 2.0])
    rest = 0.1 * torque + np.repeat([0.0, 1e3], 4)
    assert timed(rest, torque), "the jump from one recording to the next is no change"
    rest = replace_at(0.1 * torque, 2, 1e3)
    motion = Motion({"v": [np.ones(8)], "tau": [torque]})
    one: Any = SimpleNamespace(effect=Effect(), fit=SimpleNamespace(residual=rest))
    whole, without = (
        SimpleNamespace(prepared=motion, weight=weight) for weight in (np.ones(8), replace_at(np.ones(8), 2, 0.0))
    )
    assert not in_time(whole, one)  # type: ignore[arg-type]
    assert in_time(without, one)  # type: ignore[arg-type]


def replace_at(values: Array, place: int, value: float) -> Array:
    changed = values.copy()
    changed[place] = value
    return changed
