"""The next experiment differs most where the rival cannot follow, stays where the axis has been, and can be run."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.measure.experiment import best, in_words, motions, scenario
from cosim.estimation.prepare import Piece, Prepared, prepare
from cosim.system.scenario import read_scenario
from cosim_investigation.design import piece_of
from cosim_investigation.families import fast_tone, reversal_ladder, slow_sweep, stop_and_go, tone
from cosim_investigation.ground import new_ground, visited
from cosim_investigation.limits import Limits
from cosim_investigation.motions import Motion, Room, room_of
from cosim_investigation.rounds import Rounds
from cosim_investigation.story import Answered, Moved, Story
from pyfmi_models.card import read_card
from pyfmi_models.effects import ActuatorLag, Cogging, Delay, TorqueOffset


@pytest.fixture(scope="module")
def night() -> Prepared:
    t = np.arange(30_000) / 1000
    q = 0.5 + 0.3 * np.sin(0.5 * t) + 0.002 * np.sin(20 * t)
    torque = 30 * (-0.075 * np.sin(0.5 * t) - 0.8 * np.sin(20 * t)) + 3
    return prepare([Recording("night", {"t": t, "tau": torque, "q": q})], 30.0)


def test_a_chirp_tells_a_lag_from_a_delay_in_a_scenario_that_cosim_run_reads(night: Prepared, tmp_path: Path) -> None:
    """Nothing slow does."""
    card = read_card("paper_mount")
    lag, delay = (
        replace(card.plant(), effects=(one,)) for one in (ActuatorLag(time_constant_ms=5.0), Delay(delay_ms=5.0))
    )
    found = best(lag, delay, ("actuator_lag", "delay"), night)
    assert found is not None
    assert found.signal.kind in ("chirp", "multisine")
    assert found.difference > 0.05
    (tmp_path / "next_experiment.toml").write_text(scenario(found, card))
    read = read_scenario(tmp_path / "next_experiment.toml")
    assert set(read.records) == {"tau", "q", "q_d"}
    assert read.stop == 40.0
    assert in_words(found, True)["scenario"] == "next_experiment.toml"
    assert "scenario" not in in_words(found, False)


def test_what_a_rival_can_imitate_is_no_difference(night: Prepared) -> None:
    base = read_card("paper_mount").plant()
    one, other = (replace(base, effects=(TorqueOffset(torque=torque),)) for torque in (0.5, 0.1))
    found = best(one, other, ("torque_offset", "torque_offset"), night)
    assert found is None or found.difference < 1e-6


def test_motions_stay_where_the_axis_has_been(night: Prepared) -> None:
    low, high = night.ranges["q"]
    base = read_card("paper_mount").plant()
    ripple = replace(base, effects=(Cogging(cycles_per_rev=20, amplitude=0.5, phase=0.0),))
    found = best(ripple, base, ("cogging", "none"), night)
    assert found is not None
    for _, signal in motions(found.visited):
        q = found.visited.middle + signal.stream(0.01)(np.arange(4000))[0]
        assert low - 1e-9 <= q.min() <= q.max() <= high + 1e-9


# What counts as new ground: each kind of motion that no recording held, not only places and speeds.

LIMITS = Limits(-1.5, 1.5, 1.0, 3.0, 60.0, 2.4)
CUTOFF = 30.0


def piece(family: Callable[[Room], Motion]) -> Piece:
    found, left = piece_of(family(room_of(LIMITS, 0.0, 12.0, 1, False)), 0.0, CUTOFF, LIMITS)
    assert not left
    return found


def ground(family: Callable[[Room], Motion], *known: Callable[[Room], Motion]) -> float:
    before = Prepared(tuple(map(str, known)), tuple(map(piece, known)), CUTOFF, True)
    return new_ground(piece(family), visited(before, LIMITS), LIMITS)


@pytest.mark.parametrize("family", [tone, stop_and_go, slow_sweep, reversal_ladder])
def test_the_same_motion_again_is_no_new_ground(family: Callable[[Room], Motion]) -> None:
    assert ground(family, family) == 0.0


def test_rests_and_smaller_strokes_are_new_ground_where_nothing_rested_and_all_were_long() -> None:
    assert ground(stop_and_go, tone, fast_tone) > 0.3
    assert ground(stop_and_go, tone, fast_tone) > ground(fast_tone, tone) + 0.1
    seen = ground(reversal_ladder, slow_sweep, stop_and_go)
    assert seen > ground(reversal_ladder, slow_sweep, stop_and_go, reversal_ladder) == 0.0
    assert np.isclose(ground(reversal_ladder, reversal_ladder, tone), 0.0)


# Progress of an investigation: stages count up to at most so many, the best answer is kept, the time comes down.

DIAGNOSIS = ("refitting the base", "Delay (1 of 2)", "proving on the recording that was not fitted")


def answer(after: float, *names: str) -> Answered:
    return Answered(0, names, (), (), 0.8, after, 0.1, 1.0)


def lines(budget: float = 60.0) -> list[str]:
    """What is told of three rounds of two motions of 10 s; each call takes 2 s."""
    said: list[str] = []
    rounds = Rounds(said.append, budget, 10.0, lambda: 2.0 * len(said))
    for number, found in enumerate((answer(0.3, "cogging"), answer(0.2, "cogging", "delay"), answer(0.5))):
        for role in ("train", "heldout"):
            rounds("moving: a sweep")
            rounds.step(Moved(number, "x.parquet", role, "sweep", "a sweep", 10.0))
        for text in DIAGNOSIS:
            rounds(text)
        rounds.step(found)
        if number < 2:
            rounds("designing the next motion")
    return said


def test_stages_count_up_the_best_answer_so_far_stays_and_the_time_to_go_comes_down() -> None:
    said = lines()
    told = [re.match(r"stage (\d+) of (?:at most )?(\d+): ", line) for line in said]
    numbers, most = zip(*[(int(one[1]), int(one[2])) for one in told if one], strict=True)
    assert list(numbers) == sorted(numbers)
    assert set(most) == {8}  # three rounds: move, diagnose, design; the last ends with its diagnosis
    assert numbers[-1] == 8
    assert said[-1].startswith("stage 8 of 8: ")
    assert "of at most 17: " in lines(120.0)[0]
    # the best answer, when a worse one comes
    assert "best so far" not in said[0]
    assert "best so far: cogging, validation error 0.8 -> 0.3" in said[6]
    assert "best so far: cogging, delay, validation error 0.8 -> 0.2" in said[-1]
    # the time to go, in later rounds
    assert "left" not in said[0]
    left = [int(found[1]) for line in said if (found := re.search(r"at most about (\d+) s left", line))]
    assert left[-1] < left[0]
    assert 0 < left[-1] <= 6


def test_a_name_that_is_one_of_a_set_heads_nothing_alone() -> None:
    """The heading names the rivals; that a sure answer was not found twice is no rival."""
    first = answer(0.3, "cogging")
    rivals = Answered(
        1, ("cable_wrap",), ("cable wrap or gravity unbalance", "once more"), ("set", "unconfirmed"), 1, 1, 1, 1
    )
    assert Story((first, rivals), "budget spent").answer == "Cable wrap (open: cable wrap or gravity unbalance)"
    assert Story((rivals, first), "budget spent").answer == "Cogging"
