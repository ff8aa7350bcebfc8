"""Friction laws written again in plain Python, what a fit may make of them, and where they stop to be passive."""

import math
from dataclasses import replace
from itertools import product
from typing import Any

import casadi as ca
import numpy as np
import pytest

from pyfmi_models.effects.stribeck import StribeckEffect
from pyfmi_models.effects.thermal_viscosity import RubbedViscosity, WarmingViscosity
from pyfmi_models.effects.torque_saturation import TorqueSaturation
from pyfmi_models.friction import Coulomb, Dahl, FrictionLaw, Frictionless, LuGre, MaxwellSlip, Stribeck
from pyfmi_models.friction.dahl import _log1p_ratio
from pyfmi_models.friction.lugre_passive import PassiveLuGre
from pyfmi_models.friction.maxwell_slip import _decayed
from pyfmi_models.model import Pair, Recorded, Variable, parameters_of

FC, FS, VS, DELTA, S0, S1, S2 = 2.0, 3.0, 0.1, 1.5, 800.0, 6.0, 4.0
CURVE: dict[str, float] = {"Fc": FC, "Fs": FS, "Vs": VS, "delta": DELTA}
LUGRE = LuGre(sigma0=S0, sigma1=S1, sigma2=S2, **CURVE)
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
    "lugre": (LUGRE, lugre, lugre_rate),
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


@pytest.mark.parametrize("x", [-3.0, -0.2, 0.0, 1e-3, 0.7, 5.0])
@pytest.mark.parametrize("distance", [0.0, 0.1, 2.0, 9.0])
def test_the_gap_of_an_element_decays_in_its_sinh(x: float, distance: float) -> None:
    assert float(_decayed(x, distance)) == pytest.approx(math.asinh(math.sinh(x) * math.exp(-distance)), abs=1e-12)
    far = math.copysign(1e4, x or 1.0)
    assert float(_decayed(far, distance)) == pytest.approx(math.copysign(1e4 - distance, far), rel=1e-12)


@pytest.mark.parametrize("x", [-0.9, -0.3, -1.01e-4, -0.99e-4, 1e-9, 0.99e-4, 1.01e-4, 0.5, 40.0])
def test_a_logarithm_by_its_argument_is_smooth_through_zero(x: float) -> None:
    assert float(_log1p_ratio(x)) == pytest.approx(math.log1p(x) / x, rel=1e-14)
    assert float(_log1p_ratio(0.0)) == 1.0
    assert float(_log1p_ratio(-2.0)) == pytest.approx(-math.log(1e-15), rel=0.01), "a brittle contact slides fully"


@pytest.mark.parametrize(("share", "passive"), [(1.001, True), (0.999, False)])
def test_a_law_is_passive_from_the_number_on_that_its_docstring_says(share: float, passive: bool) -> None:
    laws = [
        replace(LUGRE, sigma2=share * S1 * (FS - FC) / FC),
        MaxwellSlip(sigma0=S0, sigma1=S1, sigma2=share * S1 * math.tanh(50 * (FS - FC) / FC), **CURVE),
        PassiveLuGre(sigma0=S0, sigma1=S1, Vd=4 * math.sqrt(2 * math.e) * FC / S1 / share, **CURVE),
    ]
    for law in laws:
        assert (law.broken_passivity() == "") == passive
        for sides in (Pair(1.0, 0.5), Pair(0.5, 1.0)):
            pair = replace(law, sigma1=Pair(*(S1 * one for one in sides)))
            assert (pair.broken_passivity() == "") == passive, "the worse direction counts"
    without = replace(LUGRE, Fs=None, Vs=None, sigma2=0.0)
    assert without.broken_passivity() == ""
    assert replace(laws[2], sigma1=0.0).broken_passivity() == ""


def bounds(part: Any, name: str, speed: float = 2.0, torque: float = 10.0) -> tuple[float, float]:
    variable: Variable = next(one for one in parameters_of(part) if one.name == name)
    found: tuple[float, float] = part.fit_bounds(variable, Recorded(speed, torque))
    return found


@pytest.mark.parametrize("law", [LUGRE, StribeckEffect(Fs=FS, Vs=VS)])
def test_a_fitted_curve_lies_within_recorded_speeds_and_five_times_its_start(law: Any) -> None:
    assert bounds(law, "Vs") == (pytest.approx(0.01), 2.0), "a two hundredth of the highest speed"
    assert bounds(law, "Vs", speed=200.0) == (VS, 200.0), "a card's own speed is kept"
    assert bounds(law, "Fs") == (1e-9, 15.0)
    assert bounds(law, "delta") == (0.1, 5.0)


def test_a_fitted_saturation_is_above_a_tenth_of_the_torque_and_lets_something_through() -> None:
    drive = TorqueSaturation(knee_torque=5.0, slope=0.3)
    assert bounds(drive, "knee_torque") == (1.0, math.inf)
    assert bounds(drive, "slope") == (0.02, 1.0)


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
    assert {one.nominal for one in (*LUGRE.states(), *Dahl(sigma0=S0, Fc=FC).states())} == {1.0}
