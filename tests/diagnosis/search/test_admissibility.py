"""When a fitted effect is none: on motions of which every number is known."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from motions import Array, Motion

from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.search import admissibility
from cosim.diagnosis.search.admissibility import in_time, is_degenerate, name_rules, needs_turns


class Hypothesis:
    """What an effect declares, as a table."""

    sizes = ()
    may_end = ()

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
    monkeypatch.setattr(admissibility, "at_bound", lambda *_: at_bound)
    monkeypatch.setattr(admissibility, "recorded_by", lambda pieces: None)


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
    one: Any = SimpleNamespace(effect=effect, fit=SimpleNamespace(mount=SimpleNamespace(motion="rotary")))
    assert is_degenerate(problem, effect) is degenerate  # type: ignore[arg-type]
    assert all_pass(name_rules(problem, one)) is admissible


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
