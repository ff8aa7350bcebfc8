"""One effect beside a fitted base: what is tried of it, in which shape it is fitted, and what it is worth."""

import os
import signal
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from wandering import posed, swing

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import _problem
from cosim.diagnosis.effects.candidates import Candidate
from cosim.diagnosis.evidence import comparison as evidence
from cosim.diagnosis.evidence.comparison import NONE, Comparison
from cosim.diagnosis.measure.law_selection import proposed_law
from cosim.diagnosis.search import side_by_side
from cosim.diagnosis.search.candidate_fit import CandidateFit, contest, is_small, owed_to_base, weighed
from cosim.diagnosis.search.global_test import Scores, _groups, global_test
from cosim.diagnosis.search.rivals import refitted_from_here
from cosim.diagnosis.search.side_by_side import SideBySide
from cosim.diagnosis.search.stages import InTurn, best_of, holds_at_rest, least, refitted, search, stage, starts
from cosim.estimation.fit import Fit, with_values
from cosim.support.cell import Cell
from cosim_studies.proof.generator import make_case, write_case
from cosim_studies.proof.tool import given
from pyfmi_models.effects import Cogging, LocalFriction, PeriodicFriction, StribeckEffect, TorqueOffset
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

LEVEL = 2.0


def compared(extra: object) -> tuple[Comparison, Fit]:
    """An axis with dry friction that nobody doubts and `extra(q, v)`, recorded twice; its refitted base."""
    t = np.arange(10_000) / 500
    recordings, rng = [], np.random.default_rng(1)
    for run in (0.0, 2.0):
        q, v, acceleration = swing(t, [(0.5, 0.11, run), (0.1, 0.37, 1.0 + run), (0.02, 0.9, 2.0)])
        noise = 0.002 * rng.standard_normal(len(t))
        tau = 5 * acceleration + LEVEL * np.sign(v) + v + extra(q, v) + noise
        recordings.append(Recording(f"run_{run}", {"t": t, "tau": tau, "q": q}))
    mount = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=LEVEL, sigma2=1.0))
    problem = posed(mount, recordings, 20.0, 0.02)
    base = problem.fit(mount, 25)
    return Comparison.of(problem, base, POLICY), base


@pytest.mark.parametrize("delta", [1.0, 2.0])
def test_a_stribeck_curve_has_the_exponent_of_the_recorded_friction(delta: float) -> None:
    comparison, base = compared(lambda _, v: 1.6 * np.exp(-((np.abs(v) / 0.08) ** delta)) * np.sign(v))
    found = refitted(comparison, base, StribeckEffect(Fs=3.0, Vs=0.05), 1).effect
    assert found.delta == pytest.approx(delta, abs=0.15)
    assert found.Vs == pytest.approx(0.08, rel=0.15)


def spot(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return 1.5 * np.exp(-(((q - 0.1) / 0.04) ** 2) / 2) * np.sign(v)


def test_what_is_there_is_tried_though_another_imitates_it_or_it_is_another_in_each_recording() -> None:
    comparison, base = compared(spot)
    screened, levels = comparison.screen(base), iter((0.2, 1.0))
    assert {LocalFriction, PeriodicFriction} <= {one.form for one in screened}, "a wave is better than a first guess"
    assert LocalFriction in {type(effect) for effect, _ in starts(screened, POLICY)}
    comparison, base = compared(lambda q, _: next(levels) + 0 * q)
    assert TorqueOffset in {type(effect) for effect, _ in starts(comparison.screen(base), POLICY)}


def best_beside(extra: object) -> CandidateFit:
    comparison, base = compared(extra)
    return best_of(comparison, stage(comparison, base))


@pytest.mark.parametrize("share", [0.01, 0.1])
def test_a_small_ripple_over_a_quiet_axis_is_seen_and_its_size_is_right(share: float) -> None:
    amplitude = share * LEVEL * np.sqrt(2)
    best = best_beside(lambda q, _: amplitude * np.sin(40 * q))
    assert isinstance(best.effect, Cogging)
    assert best.evidence > POLICY.clear
    assert best.effect.amplitude == pytest.approx(amplitude, rel=0.1)


def test_what_is_slow_counts_beside_loud_fast_noise() -> None:
    rng = np.random.default_rng(4)
    best = best_beside(lambda q, _: 0.15 * np.sin(q + 0.3) + 0.5 * rng.standard_normal(len(q)))
    assert best.effect.id in ("gravity_unbalance", "cable_wrap")
    assert best.evidence > POLICY.clear


def test_beside_a_strong_effect_a_further_one_must_be_stronger_than_alone() -> None:
    asked = [least(POLICY, largest, POLICY.half - 0.01) for largest in (0.0, 1.0, 100.0, 1e4)]
    assert asked == [POLICY.clear, POLICY.clear, 50.0, POLICY.sure]
    assert least(POLICY, 1e4, POLICY.half) == POLICY.clear, "but where it removes half of what they leave"


def test_a_rival_is_fitted_from_where_the_others_stand_too_as_alone_they_may_have_gone_astray() -> None:
    comparison, _ = compared(lambda q, v: spot(q, v) + q)
    problem = comparison.problem
    there, astray = (LocalFriction(q_center=q, width=0.04, relative_amplitude=0.7) for q in (0.1, -0.5))
    alone = problem.fit(replace(problem.mount, effects=(astray,)), 4)
    stuck = refitted(comparison, alone, CableWrap(stiffness=1.0, home=0.0), 3)
    found = refitted_from_here(comparison, replace(alone.mount, effects=(there,)), alone, stuck)
    assert (found.effect.id, found.many) == ("cable_wrap", 3)
    assert found.evidence > stuck.evidence + 100
    assert found.fit.rms < 0.2 * stuck.fit.rms
    assert refitted_from_here(comparison, alone.mount, alone, found) is found


def test_a_candidate_without_values_beside_a_structure_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """A walk through a gap beside a spring of 10 kHz has none; a diagnosis ended with an error for it."""
    comparison, base = compared(lambda q, _: 0.3 * np.sin(40 * q))
    whole, columns_of = comparison.screen(base), evidence.columns_of
    lacking = whole[0].candidate.effect

    def without(mount: Mount, tried: Sequence[Candidate], *more: object) -> list[np.ndarray]:
        columns = columns_of(mount, tried, *more)
        return [np.full_like(c, np.nan) if one.effect == lacking else c for one, c in zip(tried, columns, strict=True)]

    monkeypatch.setattr(evidence, "columns_of", without)
    rest = comparison.screen(base)
    assert {one.candidate.effect for one in rest} == {one.candidate.effect for one in whole} - {lacking}


def test_a_spring_does_not_start_from_a_negative_mass() -> None:
    rng = np.random.default_rng(2)
    comparison, base = compared(lambda q, _: 0.3 * rng.standard_normal(len(q)))
    springs = [one for one in comparison.screen(base) if one.candidate.effect == "compliance"]
    negative = [one for one in springs if one.coefficients[0] <= 0]
    assert negative
    assert all(one.evidence == -np.inf and one.plain == 0 for one in negative)


@pytest.mark.parametrize(
    ("at_rest", "evidence", "holds"),
    [(0.9, 100.0, True), (0.89, 100.0, False), (0.9, 99.0, False), (1.0, 500.0, False)],
)
def test_what_surely_holds_an_axis_at_rest_need_not_bend_by_what_recordings_show(at_rest, evidence, holds):
    """1.0 is that of an effect that gives the model no memory."""
    _, base = compared(lambda q, v: 0 * q)
    found = CandidateFit(Presliding(sigma0=1e9), base, evidence, 0.0, 0.5, at_rest=at_rest)
    assert holds_at_rest(found, POLICY) is holds


def test_in_a_contest_of_names_the_bases_merit_counts_as_little_as_rows_do() -> None:
    """Twenty nats that the base gained in 400 rows are no twenty where twenty ways of being wrong count."""
    rng = np.random.default_rng(7)
    comparison, base = compared(lambda q, _: 0.3 * np.sin(40 * q) + 0.02 * rng.standard_normal(len(q)))
    one, other = (
        CandidateFit(effect, fit, 0.0, price, 0.5, few)
        for effect, fit, price, few in (
            (Cogging(cycles_per_rev=40.0, amplitude=0.3), stage(comparison, base).tried[0].fit, 20.0, 0.5),
            (TorqueOffset(torque=1.0), base, 0.0, 0.0),
        )
    )
    dear = replace(one, price_of_forms=20.0)
    assert contest(comparison, one, other) == pytest.approx(contest(comparison, dear, other) + 19.5)


def test_friction_that_bends_in_a_way_of_its_own_is_told_beside_the_law() -> None:
    """A friction level that is 6 % off its law, in a wave over speed; and one that is none."""
    rng = np.random.default_rng(3)
    comparison, base = compared(lambda _, v: 0.06 * LEVEL * np.cos(9 * np.abs(v) + 0.5) * np.sign(v))
    law = proposed_law(comparison.problem, base)
    assert (law["base"], law["proposed"]) == ("coulomb", "coulomb")
    assert law["curve"] > POLICY.half
    comparison, base = compared(lambda q, _: 0.02 * rng.standard_normal(len(q)))
    assert proposed_law(comparison.problem, base)["curve"] == 0.0


def test_what_is_small_is_taken_if_it_is_all_there_is_and_ends_the_search() -> None:
    rng = np.random.default_rng(5)
    comparison, base = compared(lambda q, _: 0.005 * np.sin(40 * q) + 0.02 * rng.standard_normal(len(q)))
    first = stage(comparison, base)
    best = best_of(comparison, first)
    assert best.effect.id == "cogging"
    assert is_small(best, POLICY)
    assert best_of(comparison, first, 1.0) is None, "beside another effect it may be what that one's equation lacks"
    assert [len(one.current.mount.effects) for one in search(comparison, base).stages] == [0, 1]


def test_what_the_base_gains_by_other_numbers_of_its_own_is_no_merit_of_an_effect() -> None:
    comparison, base = compared(lambda q, _: 0 * q)
    beside = comparison.problem.fit(replace(base.mount, effects=(TorqueOffset(torque=1e-9),)), 1)

    def at(inertia: float) -> Fit:
        return comparison.problem.fit(with_values(base.mount, ["axis.inertia"], np.array([inertia])), 1)

    def with_card(inertia: float) -> Comparison:
        axis = replace(comparison.problem.mount.axis, inertia=inertia)
        return replace(comparison, problem=replace(comparison.problem, mount=replace(base.mount, axis=axis)))

    assert comparison.evidence(beside) - comparison.evidence(at(0.1)) > POLICY.clear
    assert weighed(with_card(0.1), beside, at(0.1)).evidence < 1.0
    assert owed_to_base(with_card(2.5), beside, at(2.5), NONE) == (0.0, 0.0), "within what owners may be off"
    assert owed_to_base(comparison, beside, at(0.1), NONE) == (0.0, 0.0), "the base comes back to the card"


def test_a_curve_is_found_where_the_refitted_friction_has_taken_its_level_over() -> None:
    """Friction that falls over all recorded speeds: refitted without a curve, twice its level."""
    comparison, base = compared(lambda _, v: 2.0 * np.exp(-((v / 0.8) ** 2)) * np.sign(v))
    level = float(base.mount.friction.Fc)
    assert level > 1.9 * LEVEL
    found = refitted(comparison, base, StribeckEffect(Fs=level, Vs=0.01), 1)
    assert found.effect.Fs == pytest.approx(2 * LEVEL, rel=0.05)
    assert comparison.problem.error(found.fit) < 0.3 * comparison.problem.error(base)


def test_a_phase_is_told_within_a_turn() -> None:
    comparison, base = compared(lambda q, _: 0.3 * np.cos(11 * q + 1.0))
    far = replace(base.mount, effects=(Cogging(amplitude=0.3, cycles_per_rev=11.0, phase=1.0 + 200 * np.pi),))
    assert comparison.problem.fit(far, 10).mount.effects[-1].phase == pytest.approx(1.0, abs=0.05)


# Is anything missing at all: the largest score of the catalogue, and what a null would give.


def score_of(effects: list[str], folder: Path) -> dict[str, float]:
    """The test on a case of the home generator."""
    folder.mkdir()
    write_case(make_case(5101, effects, duration=20), folder)
    card, train, _ = given(str(folder))
    problem = _problem(train, card)
    base = problem.fit(problem.mount, 25)
    return global_test(Comparison.of(problem, base, POLICY), base)


def test_what_is_missing_has_a_score_that_no_null_reaches(tmp_path: Path) -> None:
    concealed, nothing = score_of(["cogging"], tmp_path / "cogging"), score_of([], tmp_path / "nothing")
    assert concealed["p"] == 1 / 200
    assert concealed["statistic"] > 3 * concealed["threshold"]
    assert nothing["statistic"] < concealed["statistic"] / 2  # friction laws that disagree are something, too


@pytest.mark.filterwarnings("error")
def test_columns_that_are_nothing_or_known_already_score_nothing() -> None:
    """What the base explains leaves rounding, of either sign; a column of zeros has a prior without end."""
    columns = [np.zeros((50, 1)), np.full((50, 2), 1e-3)]
    form: Any = SimpleNamespace(instances=(object(),), finite=False)
    scores = object.__new__(Scores)
    scores._tests = np.column_stack([np.zeros(50), np.full(50, 1e-19), -np.full(50, 1e-19)])
    scores._gram = np.array([[0, 0, 0], [0, -1e-17, -1e-17], [0, -1e-17, -1e-17]])
    scores._groups = list(_groups([form, form], columns, 1.0))
    assert np.abs(scores.of(np.ones((50, 3)))).max() < 1


# Refits in two processes: the same as in one, whatever happens to the other.


@pytest.fixture(scope="module")
def problem() -> Any:
    """A comparison, its base, and what is worth a refit; a play among it, which takes longest."""
    comparison, base = compared(lambda q, _: 0.5 * np.sin(6 * q + 0.3))
    play = Backlash(gap_rad=0.01, load_share=0.3, load_friction=0.5, load_viscous=0.1)
    return comparison, base, [*starts(comparison.screen(base), comparison.policy)[:3], (play, 4)]


@pytest.fixture(scope="module")
def alone(problem: Any) -> list[CandidateFit]:
    """What one process finds."""
    return InTurn()(*problem)


def assert_same(found: list[CandidateFit], expected: list[CandidateFit]) -> None:
    for one, other in zip(found, expected, strict=True):
        assert (one.effect, one.fit.mount, one.evidence) == (other.effect, other.fit.mount, other.evidence)
        assert np.array_equal(one.fit.slopes, other.fit.slopes)


def counted(monkeypatch: pytest.MonkeyPatch, before: Callable[[Cell], None] = lambda _: None) -> list[object]:
    """What the other process was asked for, which this one waits for; something happens to it before that."""
    asked, call, here, begun = [], Cell.call, side_by_side.refitted, Event()

    def counting(cell: Cell, function: Any, *arguments: Any) -> Any:
        if function is side_by_side._refitted:
            before(cell)
            asked.append(arguments[0])
            begun.set()
        return call(cell, function, *arguments)

    def patient(*arguments: Any) -> CandidateFit:
        assert begun.wait(60)
        return here(*arguments)

    monkeypatch.setattr(Cell, "call", counting)
    monkeypatch.setattr(side_by_side, "refitted", patient)
    return asked


def test_two_processes_find_what_one_finds(problem, alone, monkeypatch):
    said: list[str] = []
    asked = counted(monkeypatch)
    with SideBySide(said.append) as both:
        assert_same(both(*problem), alone)
        assert_same(both(*problem), alone)
    assert asked
    assert said[:1] == ["Backlash (1 of 4)"]
    assert len(asked) + len(said) == 8


def test_what_a_process_had_taken_when_it_was_killed_is_done_here(problem, alone, monkeypatch):
    asked = counted(monkeypatch, lambda cell: os.kill(cell.pid, signal.SIGKILL))
    with SideBySide() as both:
        assert_same(both(*problem), alone)
        assert len(asked) == 1
        assert_same(both(*problem), alone)
    assert len(asked) == 1


def test_where_no_process_can_be_started_one_does_it_all(problem, alone, monkeypatch):
    monkeypatch.setattr(Cell, "begin", Mock(side_effect=OSError("no room")))
    with SideBySide() as both:
        assert_same(both(*problem), alone)


def test_what_fails_here_ends_both(problem: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(side_by_side, "refitted", Mock(side_effect=KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt), SideBySide() as both:
        both(*problem)
    assert both._cell.pid == 0


@pytest.mark.parametrize(("cores", "kind"), [(1, InTurn), (2, SideBySide)])
def test_one_core_has_one_process(cores: int, kind: type[InTurn], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(side_by_side, "cores", lambda: cores)
    with side_by_side.side_by_side(lambda _: None) as made:
        assert type(made) is kind
