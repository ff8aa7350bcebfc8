"""Friction laws: written again in plain Python, closed forms and limits, and what makes them words of a card."""

import math
from dataclasses import replace
from itertools import product
from typing import Any

import casadi as ca
import numpy as np
import pytest
from friction_laws import EXAMPLES, numeric

from pyfmi_models.card import parse_card, read_card
from pyfmi_models.card_writer import card_text
from pyfmi_models.effects.stribeck import StribeckEffect
from pyfmi_models.effects.thermal_viscosity import RubbedViscosity, WarmingViscosity
from pyfmi_models.effects.torque_saturation import TorqueSaturation
from pyfmi_models.friction import Coulomb, Dahl, FrictionLaw, Frictionless, LuGre, MaxwellSlip, Stribeck
from pyfmi_models.friction.dahl import _log1p_ratio
from pyfmi_models.friction.lugre_passive import PassiveLuGre
from pyfmi_models.model import Pair, Recorded, Variable, parameters_of, symbols_of, with_symbols

FC, FS, VS, DELTA, S0, S1, S2 = 2.0, 3.0, 0.1, 1.5, 800.0, 6.0, 4.0
CURVE: dict[str, float] = {"Fc": FC, "Fs": FS, "Vs": VS, "delta": DELTA}
SMALL = LuGre(sigma0=S0, sigma1=S1, sigma2=S2, **CURVE)
SPEEDS = (-0.7, -0.05, -1e-4, 1e-4, 0.04, 0.3)
STATES = (-1.9, 0.0, 0.4, 1.7)


def level(v: float) -> float:
    return FC + (FS - FC) * math.exp(-(abs(v / VS) ** DELTA))


def lugre_rate(z: float, v: float) -> float:
    return S0 * (v - abs(v) * z / level(v))


def lugre(z: float, v: float) -> float:
    return z + S1 * (v - abs(v) * z / level(v))


def faded(z: float, v: float, vd: float | None) -> float:
    ratio = v / vd if vd else v * S1 / (4 * math.sqrt(2 * math.e) * level(v))
    return z + S1 * math.exp(-(ratio**2)) * (v - abs(v) * z / level(v))


def told(law: FrictionLaw, z: float, v: float) -> tuple[float, float, float]:
    """Contact torque, viscous torque and rate."""
    g, state = law.level(v), ca.DM([z])
    rate = law.rate(state, v, g)
    return float(ca.DM(law.contact(state, v, g))), float(law.viscous(v)), float(rate) if law.states() else 0.0


CASES: dict[str, tuple[FrictionLaw, Any, Any]] = {
    "none": (Frictionless(), lambda z, v: 0.0, None),
    "coulomb": (Coulomb(Fc=FC, sigma2=S2, smoothing=1e-3), lambda z, v: FC * math.tanh(v / 1e-3), None),
    "static": (Stribeck(sigma2=S2, smoothing=1e-3, **CURVE), lambda z, v: level(v) * math.tanh(v / 1e-3), None),
    "lugre": (SMALL, lugre, lugre_rate),
    "lugre_passive": (
        PassiveLuGre(sigma0=S0, sigma1=S1, sigma2=S2, **CURVE),
        lambda z, v: faded(z, v, None),
        lugre_rate,
    ),
    "fading": (
        PassiveLuGre(sigma0=S0, sigma1=S1, sigma2=S2, Vd=0.2, **CURVE),
        lambda z, v: faded(z, v, 0.2),
        lugre_rate,
    ),
    "dahl": (
        Dahl(sigma0=S0, Fc=FC, n=1.7, sigma2=S2),
        lambda z, v: z,
        lambda z, v: S0 * v * (1 - z * math.copysign(1, v) / FC) * abs(1 - z * math.copysign(1, v) / FC) ** 0.7,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_law_is_its_equation(name: str) -> None:
    law, contact, rate = CASES[name]
    for z, v in product(STATES, SPEEDS):
        found = told(law, z, v)
        assert found[0] == pytest.approx(contact(z, v), rel=1e-9, abs=1e-12)
        assert found[1] == pytest.approx(0.0 if name == "none" else S2 * v, rel=1e-12)
        assert found[2] == pytest.approx(rate(z, v) if rate else 0.0, rel=1e-6, abs=1e-9)


def test_elements_of_maxwell_slip_are_stiff_in_a_row_and_each_follows_its_part_of_the_level() -> None:
    law = MaxwellSlip(sigma0=S0, sigma1=S1, sigma2=S2, spread=18.0, attraction=30.0, **CURVE)
    ratio = 18.0 ** (-1 / 7)
    shares = [ratio**k / sum(ratio**n for n in range(8)) for k in range(8)]
    np.testing.assert_allclose(law.stiffness().full().ravel(), [S0 * one for one in shares], rtol=1e-12)
    state = np.linspace(-0.2, 0.3, 8)
    for v in SPEEDS:
        gaps = 1 - math.copysign(1, v) * state * 8 / level(v)
        rates = [S0 * share * v * math.tanh(30 * gap) for share, gap in zip(shares, gaps, strict=True)]
        np.testing.assert_allclose(law.rate(ca.DM(state), v, level(v)).full().ravel(), rates, rtol=1e-9)
        torque = state.sum() + S1 * sum(rates) / S0
        assert float(law.contact(ca.DM(state), v, level(v))) == pytest.approx(torque, rel=1e-9)
        assert float(law.level(v)) == pytest.approx(level(v), rel=1e-9)
        assert float(law.viscous(v)) == pytest.approx(S2 * v, rel=1e-12)
    assert MaxwellSlip.elements == 8
    assert [one.name for one in law.states()] == [f"element_{k}" for k in range(1, 9)]
    assert {one.nominal for one in law.states()} == {0.1}


@pytest.mark.parametrize("x", [-0.9, -1.01e-4, -0.99e-4, 1e-9, 0.99e-4, 1.01e-4, 40.0])
def test_the_logarithm_of_a_brittle_contact_is_smooth_through_zero(x: float) -> None:
    assert float(_log1p_ratio(x)) == pytest.approx(math.log1p(x) / x, rel=1e-14, abs=0)
    assert float(_log1p_ratio(0.0)) == 1.0


@pytest.mark.parametrize(("share", "passive"), [(1.001, True), (0.999, False)])
def test_a_law_is_passive_from_the_number_on_that_its_docstring_says(share: float, passive: bool) -> None:
    laws = [
        replace(SMALL, sigma2=share * S1 * (FS - FC) / FC),
        MaxwellSlip(sigma0=S0, sigma1=S1, sigma2=share * S1 * math.tanh(50 * (FS - FC) / FC), **CURVE),
        PassiveLuGre(sigma0=S0, sigma1=S1, Vd=4 * math.sqrt(2 * math.e) * FC / S1 / share, **CURVE),
    ]
    for law in laws:
        assert (law.broken_passivity() == "") == passive
        for sides in (Pair(1.0, 0.5), Pair(0.5, 1.0)):
            pair = replace(law, sigma1=Pair(*(S1 * one for one in sides)))
            assert (pair.broken_passivity() == "") == passive, "the worse direction counts"
    without = replace(SMALL, Fs=None, Vs=None, sigma2=0.0)
    assert without.broken_passivity() == ""
    assert replace(laws[2], sigma1=0.0).broken_passivity() == ""


def bounds(part: Any, name: str, speed: float = 2.0, torque: float = 10.0) -> tuple[float, float]:
    variable: Variable = next(one for one in parameters_of(part) if one.name == name)
    found: tuple[float, float] = part.fit_bounds(variable, Recorded(speed, torque))
    return found


@pytest.mark.parametrize("law", [SMALL, StribeckEffect(Fs=FS, Vs=VS)])
def test_a_fitted_curve_lies_within_recorded_speeds_and_five_times_its_start(law: Any) -> None:
    assert bounds(law, "Vs") == (pytest.approx(0.01), 2.0), "a two hundredth of the highest speed"
    assert bounds(law, "Vs", speed=200.0) == (VS, 200.0), "a card's own speed is kept"
    assert [bounds(law, name) for name in ("Fs", "delta")] == [(1e-9, 15.0), (0.1, 5.0)]
    drive = TorqueSaturation(knee_torque=5.0, slope=0.3)  # above a tenth of the torque, and lets something through
    assert [bounds(drive, name) for name in ("knee_torque", "slope")] == [(1.0, math.inf), (0.02, 1.0)]


@pytest.mark.parametrize(("seconds", "within"), [(600.0, (2.0, 1e5)), (1.5, (1.5, 1e5)), (2e5, (2.0, 2e5))])
def test_a_fitted_warm_up_takes_seconds_to_a_day_or_the_cards_own(seconds: float, within: tuple[float, float]) -> None:
    warming = WarmingViscosity(viscous_per_degC=-0.04, warm_up_degC=15.0, warm_up_s=seconds)
    rubbed = RubbedViscosity(viscous_per_degC=-0.04, heat_degC_per_rad=8.0, cooling_s=seconds)
    assert bounds(warming, "warm_up_s") == bounds(rubbed, "cooling_s") == within
    assert bounds(warming, "viscous_per_degC") == (-1.0, 1.0)


def test_laws_say_in_which_numbers_they_are_lines_and_what_they_are_compared_with() -> None:
    rivals = {"lugre": ("maxwell_slip",), "maxwell_slip": ("lugre",), "dahl": ("lugre", "maxwell_slip")}
    for law in (Coulomb, Dahl, LuGre, MaxwellSlip, Stribeck):
        assert law.linear == ("Fc", "sigma2")
        assert law.rivals == rivals.get(law.key, ())
        assert law.in_rows == (law is MaxwellSlip)
    assert {one.nominal for one in (*SMALL.states(), *Dahl(sigma0=S0, Fc=FC).states())} == {1.0}


# Closed forms, limits and words of a card.

EACH = pytest.mark.parametrize("law", EXAMPLES.values(), ids=EXAMPLES.keys())
LUGRE, MAXWELL = EXAMPLES["lugre"], EXAMPLES["maxwell_slip"]
BEND = 2.322 / 9.23e4
"""Level over stiffness [rad]: the scale of presliding."""


@pytest.mark.parametrize("elements", [2, 4, 16])
def test_another_number_of_elements_is_a_subclass_with_the_same_limits(elements: int) -> None:
    kind = type("Other", (MaxwellSlip,), {"elements": elements})
    law = kind(sigma0=9.23e4, Fc=2.322)
    assert len(law.states()) == elements
    assert numeric(law)("advance", np.zeros(elements), 1e-10, 1.0).sum() == pytest.approx(9.23e-6, rel=1e-9)
    far = numeric(law).along(np.full(2000, 100 * BEND / 2000), 1.0)
    assert far[:, -1].sum() == pytest.approx(2.322, rel=1e-9)


def test_an_element_that_slips_forgets_what_it_was() -> None:
    """At its level, too, where the step of its torque has no kink: d F_i(dt) / d F_i = exp(-attraction distance)."""
    this = numeric(replace(MAXWELL, Fs=None, Vs=None))
    k, distance = ca.DM(MAXWELL.stiffness()).full().ravel(), 1e-7
    slopes = np.diag(this.slopes("advance", this.start(1.0), 1.0, distance)[1][:, : this.size])
    np.testing.assert_allclose(slopes, np.exp(-50.0 * k * distance / (2.322 / 8)), rtol=1e-9)


@pytest.mark.parametrize("law", [LUGRE, LUGRE.steady(), MAXWELL], ids=lambda law: law.key)
def test_without_break_away_level_there_is_no_stribeck_term(law: LuGre | Stribeck | MaxwellSlip) -> None:
    plain = replace(law, Fs=None, Vs=None)
    assert all(float(plain.level(v)) == law.Fc for v in (0.0, 1e-7, 3e-3, 0.04, 0.7))
    assert {"Fs", "Vs"}.isdisjoint(variable.name for variable in parameters_of(plain))
    assert float(law.level(0.0)) == pytest.approx(law.Fs, rel=1e-12)
    assert float(law.level(10.0)) == pytest.approx(law.Fc, rel=1e-12)


def test_a_pair_is_two_parameters_and_the_direction_picks_one() -> None:
    law = replace(LUGRE, Fc=Pair(2.0, 2.5), Fs=Pair(3.0, 4.0))
    variables = parameters_of(law, "friction")
    starts = {variable.name: variable.start for variable in variables}
    assert starts["friction.Fc.positive"] == 2.0
    assert starts["friction.Fc.negative"] == 2.5
    assert "friction.Fc" not in starts
    assert starts["friction.sigma0"] == LUGRE.sigma0
    p, symbols = symbols_of(variables)
    w = ca.SX.sym("w")
    level = ca.Function("level", [w, p], [with_symbols(law, symbols, w, "friction").level(w)])
    for v, side in ((5.0, 0), (-5.0, 1), (1e-9, 0), (-1e-9, 1)):
        expected = law.Fc[side] if abs(v) > 1 else law.Fs[side]
        assert float(level(v, list(starts.values()))) == pytest.approx(expected, rel=1e-6)


@EACH
def test_a_card_says_every_law_and_reads_it_back(law: Any) -> None:
    written = replace(read_card("paper_mount"), friction=law)
    assert parse_card(card_text(written), "again.toml").friction == law
