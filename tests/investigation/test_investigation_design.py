"""Which motion tells two structures apart: the one on which they differ after a refit, whichever of them is right.

The next experiment of a diagnosis differs most where the rival cannot follow, and stays where the axis has been.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from investigations import CABLE, written

from cosim.data.recording import Recording
from cosim.diagnosis.measure import experiment
from cosim.estimation.prepare import Piece, Prepared, prepare
from cosim.estimation.problem import Problem
from cosim.system.scenario import read_scenario
from cosim_investigation.design import Plan, Rated, allowed, best, piece_of, plans, shown_by_motion, spare, strayed
from cosim_investigation.families import creep, fast_sweeps, fast_tone, reversal_ladder, slow_sweep, stop_and_go, tone
from cosim_investigation.ground import new_ground, visited
from cosim_investigation.limits import Limits
from cosim_investigation.machine import CoSimulated
from cosim_investigation.motions import Motion, Rest, Room, room_of
from cosim_investigation.questions import Duel, Question, problem_of
from pyfmi_models.card import read_card
from pyfmi_models.effects import CATALOGUE, ActuatorLag, Cogging, Delay, Effect, GravityUnbalance, TorqueOffset

LIMITS = Limits(-1.5, 1.5, 1.0, 3.0, 60.0, 2.4)
SET, DOUBT = Question("set", ("cable_wrap", "torque_offset"), "set"), Question("uncertain", ("cable_wrap",), "doubt")
(CABLE_WRAP, OFFSET) = (CATALOGUE[name][0] for name in ("cable_wrap", "torque_offset"))


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    folder: Path = tmp_path_factory.mktemp("axis")
    scenario, card, machine = written(folder, CABLE)
    loop = CoSimulated(read_scenario(scenario), machine)
    return problem_of([loop.record(loop.own(), 0, folder / "first.parquet")], read_card(card))


def duel(problem: Problem, question: Question, other: Effect | None) -> Duel:
    ours = replace(problem.mount, effects=(CABLE_WRAP(stiffness=2.0, home=0.05),))  # type: ignore[call-arg]
    rival = replace(problem.mount, effects=(other,) if other else ())
    return Duel(question, problem.fit(ours, 15), problem.fit(rival, 15))


def rated(problem: Problem, one: Duel) -> Rated:
    return plans(room_of(LIMITS, 0.0, 12.0, 1, False), problem, one.ours, [one], LIMITS, 0.0)


def nats(found: Rated) -> dict[str, float]:
    return {plan.motion.family: plan.nats[0] for plan in found.plans}


def test_a_long_stroke_tells_a_cable_from_a_weight_and_a_fast_tone_does_not(problem: Problem) -> None:
    found = rated(problem, duel(problem, SET, GravityUnbalance(mgl=2.0, phase=0.0)))
    told = nats(found)
    assert told["slow sweep"] > 10 * told["fast tone"]
    chosen = best(found.plans, True)
    assert chosen.worth == 10.0  # what settles it; of those, the one of most new ground


def test_a_doubtful_name_a_special_case_and_an_effect_not_proven_are_asked_from_the_general_side(problem) -> None:
    """With the cable a model follows one without it, so the other side alone would never promise anything."""
    cable = CABLE_WRAP(stiffness=2.0, home=0.05)  # type: ignore[call-arg]
    fits = (problem.fit(replace(problem.mount, effects=one), 15) for one in ((), (cable,)))
    for one, general in (
        (duel(problem, DOUBT, None), "ours"),
        (duel(problem, SET, OFFSET(torque=0.1)), "ours"),  # type: ignore[call-arg]
        (Duel(Question("unproven", ("cable_wrap",), "unproven"), *fits), "other"),
    ):
        assert one.general == general
        assert nats(rated(problem, one))["slow sweep"] > 10.0


def test_a_motion_that_tells_less_than_a_set_asks_for_is_not_run() -> None:
    still = replace(fast_tone(room_of(LIMITS, 0.0, 12.0, 1, False)), parts=(Rest(12.0),))
    assert best([Plan(still, (1.9,), 1.0)], True) is None
    assert best([Plan(still, (), 0.5)], False, ("fast tone",)) is None
    assert best([Plan(still, (), 0.5)], False) is not None
    assert best([Plan(still, (), 0.05)], False) is None  # hardly anything that was not visited
    assert np.isclose(Plan(still, (30.0, 4.0), 0.0).worth, 14.0)


def test_what_could_not_be_tested_is_shown_before_new_ground_is_sought_if_a_motion_can(problem: Problem) -> None:
    """What needs columns of a neighbour is shown by no motion."""
    room = room_of(LIMITS, 0.0, 12.0, 1, False)
    fast, slow = fast_tone(room), slow_sweep(room)
    assert best([Plan(fast, (), 0.9, 0), Plan(slow, (), 0.2, 1)], False) == Plan(slow, (), 0.2, 1)
    ours, names = problem.fit(problem.mount, 5), ("axis_coupling", "compliance")
    piece, _ = piece_of(fast, 0.0, problem.prepared.cutoff, LIMITS)
    assert shown_by_motion(names, ours, [piece], 0.1) == {"compliance"}
    found = plans(room, problem, ours, [], LIMITS, 0.0, names)
    assert {one.motion.family: one.shows for one in found.plans}["fast tone"] == 1


def test_what_a_model_may_lack_grows_beyond_what_was_recorded(problem: Problem) -> None:
    """Twice as fast, or twice as far from the middle, a drag or a cable that hardens may be eight times as large."""
    known = problem.prepared
    (low, high), top = known.ranges["q"], max(map(abs, known.ranges["v"]))
    middle, half = (low + high) / 2, (high - low) / 2
    hard = np.abs(known.stacked("a")).max()
    rows = {"q": middle + np.array([0.0, 0.9, 2.0, 0.0, 0.0]) * half, "v": np.array([0.9, 0.0, 0.0, -2.0, 0.0]) * top}
    rows["a"] = np.array([0.9, 0.0, 0.0, 0.0, 3.0]) * hard
    assert spare(known, replace(known.pieces[0], **rows), 0.5) == pytest.approx([2.0, 2.0, 16.0, 16.0, 54.0])


def test_spare_torque_covers_a_drag_beside_the_best_line_through_what_was_recorded(problem: Problem) -> None:
    known = problem.prepared
    v, piece = known.stacked("v"), known.pieces[0]
    line = np.column_stack([np.sign(v), v])
    found = np.linalg.lstsq(line, v * np.abs(v), rcond=None)[0]
    left = v * np.abs(v) - line @ found
    for s in (1.0, 1.5, 2.0, 4.0):
        fast = np.array([s * np.abs(v).max()])
        off = abs(fast**2 - found[0] - found[1] * fast)
        there = replace(piece, q=np.full(1, np.mean(known.ranges["q"])), v=fast, a=np.zeros(1))
        assert off < spare(known, there, float(np.sqrt(np.mean(left**2))))


def test_a_motion_far_beyond_any_recording_is_slowed_and_shortened_where_torque_is_scarce(problem: Problem) -> None:
    ours, tops = problem.fit(problem.mount, 5), []
    for torque in (1e6, 60.0, 25.0):
        limits = replace(LIMITS, speed=2.0, acceleration=6.0, torque=torque)
        room = room_of(limits, 0.0, 12.0, 1, False)
        _, piece, refused = allowed(fast_sweeps, room, ours, problem.prepared, limits, 0.0)
        assert refused == ""
        tops.append((np.abs(piece.v).max(), np.abs(piece.q).max()))
    wide, slower, nearer = tops
    assert slower[0] < 0.7 * wide[0]
    assert nearer[1] < 0.7 * wide[1]


def test_a_motion_leaves_room_for_what_the_axis_strayed_from_its_set_point(problem: Problem) -> None:
    """A tenth of the way and of the speed is kept anyway; a loop that overshoots by more is asked for less."""
    known = problem.prepared
    far, fast = strayed(known)
    assert 0 < far < 0.01
    (piece,) = known.pieces
    disturbed = piece.extras["q_d"] + 0.02 * np.sin(2 * np.pi * 2.0 * piece.t)
    loose = replace(known, pieces=(replace(piece, extras=piece.extras | {"q_d": disturbed}),))
    assert strayed(loose)[0] == pytest.approx(0.02, abs=far + 1e-3)
    assert strayed(loose)[1] == pytest.approx(0.25, abs=fast + 0.01)
    limits, ours = replace(LIMITS, speed=0.5), problem.fit(problem.mount, 5)
    room = room_of(limits, 0.0, 12.0, 1, False)
    tops = [np.abs(allowed(fast_sweeps, room, ours, one, limits, 0.0)[1].v).max() for one in (known, loose)]
    assert tops[1] == pytest.approx(0.5 * tops[0], rel=0.1)


def test_short_moves_are_allowed_by_the_torque_that_they_ask_for_not_by_what_a_low_pass_leaves_of_it(problem) -> None:
    """A move of .05 s at 3.9 rad/s2 was planned with 2.8: one of 1000 motions needed 1.3 % more torque than allowed."""
    known, ours = replace(problem.prepared, cutoff=12.0), problem.fit(problem.mount, 5)
    heavy = replace(ours, mount=replace(ours.mount, axis=replace(ours.mount.axis, inertia=20.0)))
    short = replace(LIMITS, low=-0.01, high=0.01)
    hardest = []
    for torque in (60.0, 46.0):
        limits = replace(short, torque=torque)
        motion, _, refused = allowed(creep, room_of(limits, 0.0, 12.0, 1, False), heavy, known, limits, 0.0)
        assert refused == ""
        hardest.append(20.0 * np.abs(motion.sampled(np.arange(0.0, motion.seconds, 1e-3))[2]).max())
        assert hardest[-1] < torque
    assert hardest[0] > 45.0  # what is allowed with more is not made smaller


# The next experiment of a diagnosis.


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
    found = experiment.best(lag, delay, ("actuator_lag", "delay"), night)
    assert found.signal.kind in ("chirp", "multisine")
    assert found.difference > 0.05
    (tmp_path / "next_experiment.toml").write_text(experiment.scenario(found, card))
    read = read_scenario(tmp_path / "next_experiment.toml")
    assert set(read.records) == {"tau", "q", "q_d"}
    assert read.stop == 40.0
    assert experiment.in_words(found, True)["scenario"] == "next_experiment.toml"
    assert "scenario" not in experiment.in_words(found, False)


def test_what_a_rival_can_imitate_is_no_difference(night: Prepared) -> None:
    base = read_card("paper_mount").plant()
    one, other = (replace(base, effects=(TorqueOffset(torque=torque),)) for torque in (0.5, 0.1))
    found = experiment.best(one, other, ("torque_offset", "torque_offset"), night)
    assert found is None or found.difference < 1e-6


def test_motions_stay_where_the_axis_has_been(night: Prepared) -> None:
    low, high = night.ranges["q"]
    base = read_card("paper_mount").plant()
    ripple = replace(base, effects=(Cogging(cycles_per_rev=20, amplitude=0.5, phase=0.0),))
    found = experiment.best(ripple, base, ("cogging", "none"), night)
    for _, signal in experiment.motions(found.visited):
        q, v, _ = signal.stream(0.01)(np.arange(4000))
        assert low - 1e-9 <= found.visited.middle + q.min() <= found.visited.middle + q.max() <= high + 1e-9
        assert signal.kind not in ("sine", "slews") or np.abs(v).max() <= 1.05 * found.visited.speed


# What counts as new ground: each kind of motion that no recording held, not only places and speeds.

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
