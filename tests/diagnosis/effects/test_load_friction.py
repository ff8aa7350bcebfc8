"""Friction that grows with a load: with a weight that the card states, and with all torque that goes through a gear."""

import numpy as np
import pytest
from problems import compared
from wandering import recorded, swing

from cosim.data.recording import Recording
from cosim.diagnosis.answer.result import Finding
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import _problem
from cosim.diagnosis.effects.candidates import at_own_level
from cosim.diagnosis.measure.bounds import not_found
from cosim.diagnosis.measure.findings import _at_own_level
from cosim.diagnosis.search.admissibility import is_degenerate
from cosim.diagnosis.search.sizes import Numbers
from cosim.diagnosis.search.stages import refitted
from pyfmi_models.card import Card, parse_card
from pyfmi_models.effects import Motion
from pyfmi_models.effects.load_dependent_friction import GearLoadFriction, LoadDependentFriction, LoadScaledFriction
from pyfmi_models.effects.torque_saturation import TorqueSaturation

BASE = '[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 3.0\n'
PHASE = 0.2


def card(mgl: float) -> Card:
    """A card that states a load, or none."""
    return parse_card(BASE + (f"[unbalance]\nmgl = {mgl}\nphase = {PHASE}\n" if mgl else ""), "card.toml")


def loaded(mgl: float, seed: int) -> Recording:
    """An axis with that load, 1.2 rad either way."""
    t = np.arange(2000) / 100
    q, v, a = swing(t, [(1.2, 0.7, seed), (0.1, 2.3, 1.0)], per=1)
    noise = 0.05 * np.random.default_rng(seed).standard_normal(len(t))
    return recorded(2 * a + np.sign(v) + 3 * v + mgl * np.sin(q + PHASE) + noise, t, q, f"run_{seed}")


def answered(mgl: float) -> Finding:
    """What is said of it where there is none."""
    problem = _problem([loaded(mgl, seed) for seed in (1, 2)], card(mgl))
    findings = not_found(*compared(problem), [], 0.0)
    return next(one for one in findings if one.effect == "load_dependent_friction")


def test_a_load_of_the_card_gives_a_bound_half_of_it_one_twice_as_large_and_none_the_load_of_a_gear() -> None:
    whole, half, none = (answered(mgl) for mgl in (4.0, 2.0, 0.0))
    for one in (whole, half, none):
        assert one.answer == "not_seen"
        assert one.bound is not None
        assert one.bound.unit == "% of the load"
        assert one.visible_from == one.bound.value
    assert whole.visible_from is not None
    assert 1.0 < whole.visible_from < 6.0
    assert half.visible_from == pytest.approx(2 * whole.visible_from, rel=0.05)


def geared(rise: float, inertia: float, others: float, seed: int) -> Recording:
    """Quick moves of an axis without a weight, friction of which rises by so much per unit through its gear."""
    t = np.arange(4000) / 200
    q, v, a = swing(t, [(1.5 / 1.9, 1.9, seed - np.pi / 2), (0.8 / 5.3, 5.3, 1 - np.pi / 2)], per=1)
    friction = np.sign(v) + 3 * v
    for _ in range(60):  # the friction is part of what goes through, which is part of friction
        friction = (1 + rise * np.abs(inertia * 2 * a + others * friction)) * np.sign(v) + 3 * v
    noise = 0.05 * np.random.default_rng(seed).standard_normal(len(t))
    return recorded(2 * a + friction + noise, t, q, f"run_{seed}")


@pytest.mark.parametrize("others", [0.0, 1.0])
def test_a_gear_is_told_from_a_drive_that_gives_less_and_by_the_side_that_feels_the_torque(others: float) -> None:
    problem = _problem([geared(0.15, 1.0, others, seed) for seed in (1, 2)], card(0.0))
    comparison, base = compared(problem)
    sides = [
        GearLoadFriction(coulomb_per_Nm=0.01, at_level=1.0, inertia_share=1.0, friction_share=one)
        for one in (others, 1 - others)
    ]
    right, wrong, drive = (
        refitted(comparison, base, one, 2) for one in (*sides, TorqueSaturation(knee_torque=8.0, slope=0.5))
    )
    assert right.effect.coulomb_per_Nm == pytest.approx(0.15, rel=0.1)  # type: ignore[attr-defined]
    assert right.evidence > max(wrong.evidence, drive.evidence) + POLICY.clear
    assert not is_degenerate(problem, right.effect)


def test_the_rise_is_told_beside_the_level_that_was_fitted_not_beside_the_one_the_fit_began_with() -> None:
    mount = parse_card(BASE.replace("Fc = 1.0", "Fc = 0.75"), "card.toml").plant()
    begun = LoadScaledFriction(coulomb_per_Nm=0.1, at_level=1.25)
    told = at_own_level(begun, mount)
    assert isinstance(told, LoadScaledFriction)
    assert (told.coulomb_per_Nm, told.at_level) == pytest.approx((0.06, 0.75))
    for payload in (0.0, 3.0):
        motion = Motion(t=0.0, q=0.0, v=1.0, angle=0.0, payload=payload)
        assert float(told.level(0.75, motion)) == pytest.approx(float(begun.level(0.75, motion)))
    numbers = Numbers({"coulomb_per_Nm": 0.1, "at_level": 1.25}, {"coulomb_per_Nm": 0.01})
    assert _at_own_level(begun, numbers, mount)[1].errors == pytest.approx({"coulomb_per_Nm": 0.006})
    plain = LoadDependentFriction(coulomb_per_Nm=0.1)
    assert at_own_level(plain, mount) is plain
