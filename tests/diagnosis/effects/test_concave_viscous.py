"""Grease that thins is asked for, named, and only possible where it makes held-out recordings worse."""

import numpy as np
import pytest

import cosim.diagnosis.diagnose as module
from cosim.data.recording import Recording
from cosim.diagnosis.answer.result import Diagnosis
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.effects import hypothesis_of
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from pyfmi_models.card import Card, parse_card
from pyfmi_models.effects.concave_viscous import ConcaveViscous

CARD = """
[mount]
name = "axis"
inertia = 30.0
[friction]
model = "coulomb"
Fc = 2.5
sigma2 = 4.0
"""


def recording(seed: int, exponent: float) -> Recording:
    """A swing of two tones, friction of 2.5 N m and 12 N m s/rad that thins above 0.1 rad/s with this power."""
    t = np.arange(0, 20, 0.01)
    q = 1.2 * np.sin(2 * np.pi * 0.15 * t) + 0.3 * np.sin(2 * np.pi * 0.43 * t + seed)
    v = np.gradient(q, t)
    viscous = 12 * v * (1 + (v / 0.1) ** 2) ** ((exponent - 1) / 2)
    noise = 0.05 * np.random.default_rng(seed).standard_normal(len(t))
    tau = 30 * np.gradient(v, t) + 2.5 * np.tanh(v / 1e-3) + viscous + noise
    return Recording(f"run_{seed}", {"t": t, "tau": tau, "q": q})


def diagnosed(exponent: float) -> tuple[Diagnosis, Card]:
    train, held = [recording(1, exponent), recording(2, exponent)], [recording(3, exponent)]
    outcome = diagnose(train, held, parse_card(CARD, "axis.toml"))
    return outcome.diagnosis, outcome.card


def test_grease_that_thins_is_named_with_its_speed_and_power_and_predicts_another_day() -> None:
    diagnosis, card = diagnosed(0.2)
    assert diagnosis.verdict == ("concave_viscous",)
    (grease,) = card.effects
    assert grease.thinning_speed == pytest.approx(0.1, rel=0.3)
    assert grease.exponent == pytest.approx(0.2, abs=0.15)
    assert diagnosis.heldout.after_rms < 0.3 * diagnosis.heldout.before_rms


def test_what_makes_the_held_out_error_larger_is_only_possible_and_not_delivered(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "_is_worse", lambda *_: True)
    diagnosis, card = diagnosed(0.2)
    grease = next(one for one in diagnosis.findings if one.effect == "concave_viscous")
    assert (diagnosis.verdict, card.effects, grease.answer) == (("concave_viscous",), (), "ambiguous")
    assert grease.probability <= 0.5


def test_grease_that_does_not_is_not_and_its_bound_says_from_which_speed_it_would_have_shown() -> None:
    diagnosis, _ = diagnosed(1.0)
    assert diagnosis.verdict == ()
    seen = {one.effect: one for one in diagnosis.findings}["concave_viscous"]
    assert seen.answer == "not_seen"
    assert "root of the speed" in str(seen)


@pytest.mark.parametrize(("thinning", "degenerate"), [(0.029, True), (0.031, False)])
def test_what_thins_below_the_speeds_that_are_tried_is_a_level(thinning: float, degenerate: bool) -> None:
    """Its share of the top speed; there it would be the contact's friction, and that nothing."""
    mount, prepared = parse_card(CARD, "axis.toml").plant(), prepare([recording(1, 1.0)], 30.0)
    problem = Problem(mount, prepared, np.ones(len(prepared.recording_of)), 0.01)
    grease = ConcaveViscous(thinning_speed=thinning * problem.top_speed, exponent=0.0)
    assert hypothesis_of(grease).is_degenerate(problem, grease) is degenerate


def test_a_bend_next_to_rest_that_a_law_may_have_left_is_not_enough() -> None:
    mount = parse_card(CARD.replace("4.0", "12.0"), "axis.toml").plant()
    prepared = prepare([recording(1, 1.0)], 30.0)
    bends, levels = ConcaveViscous(thinning_speed=0.1, exponent=0.5), ConcaveViscous(thinning_speed=0.01, exponent=0.05)
    grease = hypothesis_of(bends)
    assert grease.shows(bends, mount, prepared)
    assert not grease.shows(levels, mount, prepared)
