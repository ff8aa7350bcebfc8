"""Friction laws resist, waste energy, remember what they should and agree with each other."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from pyfmi_models.card import read_card
from pyfmi_models.friction import LAWS, Coulomb, FrictionLaw, Frictionless, LuGre, Stribeck
from pyfmi_models.friction.base import stribeck_decay
from pyfmi_models.model import Pair, parameters_of, symbols_of, with_symbols

LUGRE = LuGre(sigma0=9.23e4, sigma1=497.0, sigma2=32.77, Fc=2.322, Fs=3.322, Vs=0.04129, delta=1.292)
ALL: tuple[FrictionLaw, ...] = (Frictionless(), Coulomb(Fc=2.0, sigma2=30.0), LUGRE.steady(), LUGRE)
EACH = pytest.mark.parametrize("law", ALL, ids=lambda law: law.key)
SPEEDS = np.array([1e-7, 1e-4, 3e-3, 0.04, 0.7])
speeds = st.floats(-1, 1).filter(lambda v: abs(v) > 1e-9)
Formula = Callable[[Any, Any], Any]


def evaluate(formula: Formula, state: Any, v: Any) -> np.ndarray:
    """Values of a formula of bristle torque and speed, through symbols as in a plant."""
    x, w = ca.SX.sym("x"), ca.SX.sym("w")
    function = ca.Function("f", [x, w], [formula(x, w)])
    pairs = np.broadcast_arrays(np.asarray(state, float), np.asarray(v, float))
    return np.array([float(function(*pair)) for pair in zip(*map(np.ravel, pairs), strict=True)])


def torque(law: FrictionLaw) -> Formula:
    return lambda x, v: law.contact(x, v, law.level(v)) + law.viscous(v)


def sliding(law: FrictionLaw, v: np.ndarray) -> np.ndarray:
    """Torque in steady sliding, where a bristle carries the whole level."""
    level = evaluate(lambda _, w: law.level(w) + 0 * w, 0, v)
    return evaluate(torque(law), level * np.sign(v), v)


def advanced(law: LuGre, z: float, v: float, dt: float) -> float:
    return float(evaluate(lambda x, w: law.advance(x, w, law.level(w), dt), z, v)[0])


def test_a_card_has_a_word_for_each_law() -> None:
    assert {key: law.key for key, law in LAWS.items()} == {key: key for key in ("none", "coulomb", "static", "lugre")}


@pytest.mark.parametrize("v", [-0.3, -0.002, 5e-5, 0.04])
@pytest.mark.parametrize("z", [-2.0, 0.0, 3.0])
def test_bristle_friction_is_the_equations_of_the_contract(v: float, z: float) -> None:
    """Written out by hand, with z as the torque sigma0 z."""
    g = 2.322 + (3.322 - 2.322) * np.exp(-((abs(v) / 0.04129) ** 1.292))
    rate = v - abs(v) * z / g
    assert float(LUGRE.level(v)) == pytest.approx(g, rel=1e-9)
    assert evaluate(torque(LUGRE), z, v)[0] == pytest.approx(z + 497.0 * rate + 32.77 * v, rel=1e-9)
    assert evaluate(lambda x, w: LUGRE.rate(x, w, LUGRE.level(w)), z, v)[0] == pytest.approx(9.23e4 * rate, rel=1e-9)


@EACH
def test_friction_is_odd_in_the_direction_of_motion(law: FrictionLaw) -> None:
    state = np.linspace(-3, 3, 5)[:, None]
    np.testing.assert_array_equal(evaluate(torque(law), -state, -SPEEDS), -evaluate(torque(law), state, SPEEDS))
    np.testing.assert_array_equal(sliding(law, -SPEEDS), -sliding(law, SPEEDS))


@EACH
def test_friction_resists_steady_sliding(law: FrictionLaw) -> None:
    assert np.all(sliding(law, SPEEDS) * SPEEDS >= 0)
    assert (law.key == "none") == np.all(sliding(law, SPEEDS) == 0)


def test_steady_sliding_of_bristles_is_the_stribeck_map() -> None:
    fast = SPEEDS[20 * LUGRE.steady().smoothing < SPEEDS]  # where the map's smoothed sign is a sign
    np.testing.assert_allclose(sliding(LUGRE, fast), sliding(LUGRE.steady(), fast), rtol=1e-14)


@pytest.mark.parametrize("v", [-0.5, -0.003, 2e-5, 0.04])
def test_bristles_reach_their_level_and_stay(v: float) -> None:
    level = float(LUGRE.level(v))
    assert advanced(LUGRE, 0.0, v, 60.0) == pytest.approx(np.sign(v) * level, rel=1e-14)
    assert abs(float(evaluate(lambda x, w: LUGRE.rate(x, w, level), np.sign(v) * level, v)[0])) < 1e-9


@pytest.mark.parametrize("v", [-0.7, -1e-3, 0.0, 1e-5, 0.05])
@pytest.mark.parametrize("start", [-2.0, 0.0, 3.0])
def test_advance_is_the_exact_solution_at_constant_speed(v: float, start: float) -> None:
    level = float(LUGRE.level(v))
    dt = 1e-4 if abs(v) > 0.01 else 0.05

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        return LUGRE.sigma0 * (v - abs(v) * x / level)

    tight = solve_ivp(rate, (0, dt), [start], method="DOP853", rtol=1e-12, atol=1e-14)
    assert advanced(LUGRE, start, v, dt) == pytest.approx(tight.y[0, -1], rel=1e-10, abs=1e-12)


@given(v=speeds, z=st.floats(-3, 3), first=st.floats(0, 0.1), second=st.floats(0, 0.1))
def test_two_short_advances_are_one_long_one(v: float, z: float, first: float, second: float) -> None:
    level = float(LUGRE.level(v))
    half = float(LUGRE.advance(z, v, level, first))
    assert float(LUGRE.advance(half, v, level, second)) == pytest.approx(
        float(LUGRE.advance(z, v, level, first + second)), rel=1e-9, abs=1e-12
    )


@given(st.lists(speeds, min_size=1, max_size=30))
def test_bristles_never_carry_more_than_break_away(motion: list[float]) -> None:
    z = 0.0
    for v in motion:
        z = float(LUGRE.advance(z, v, LUGRE.level(v), 1e-3))
        assert abs(z) <= LUGRE.Fs * (1 + 1e-12)


@pytest.mark.parametrize("amplitude", [1e-6, 2e-5, 1e-4, 1e-2])
@EACH
def test_a_closed_cycle_wastes_energy(law: FrictionLaw, amplitude: float) -> None:
    """Presliding to sliding, 1 Hz: the work over a cycle in the periodic state is positive, viscous or not."""
    ticks = 4000
    v = 2 * np.pi * amplitude * np.sin(2 * np.pi * (np.arange(2 * ticks) + 0.5) / ticks)
    x, w = ca.SX.sym("x"), ca.SX.sym("w")
    step = ca.Function("step", [x, w], [law.advance(x, w, law.level(w) + 0 * w, 1 / ticks)])
    state = step.mapaccum(len(v))(0, ca.DM(v).T).full().ravel()
    friction = evaluate(torque(law), state, v)
    work = float(friction[ticks:] @ v[ticks:]) / ticks
    assert work > 0 if law.key != "none" else work == 0


def test_small_displacements_meet_a_spring_of_stiffness_sigma0() -> None:
    distance = 1e-9  # 3e-5 of the break-away displacement: what the bristle loses to sliding is 3e-5 of its torque
    assert advanced(LUGRE, 0.0, distance, 1.0) == pytest.approx(LUGRE.sigma0 * distance, rel=1e-4)


@pytest.mark.parametrize("law", [LUGRE, LUGRE.steady()], ids=lambda law: law.key)
def test_without_break_away_level_there_is_no_stribeck_term(law: LuGre | Stribeck) -> None:
    plain = replace(law, Fs=None, Vs=None)
    assert all(float(plain.level(v)) == law.Fc for v in (0.0, *SPEEDS))
    assert {"Fs", "Vs"}.isdisjoint(variable.name for variable in parameters_of(plain))
    assert float(law.level(0.0)) == pytest.approx(law.Fs, rel=1e-12)
    assert float(law.level(10.0)) == pytest.approx(law.Fc, rel=1e-12)


@pytest.mark.parametrize("delta", [0.5, 1.0, 1.29, 2.0, 5.0])
def test_the_stribeck_decay_is_its_formula(delta: float) -> None:
    expected = np.exp(-((SPEEDS / 0.04) ** delta))
    np.testing.assert_allclose([float(stribeck_decay(v, 0.04, delta)) for v in -SPEEDS], expected, rtol=1e-5, atol=0)


@pytest.mark.parametrize("delta", [0.5, 1.0, 1.29, 2.0, 5.0])
@pytest.mark.parametrize("v", [0.0, -1e-300, 1e-9, 50.0, 1e6])
def test_every_derivative_is_finite_at_rest_and_far_above_the_stribeck_speed(v: float, delta: float) -> None:
    law = replace(LUGRE, delta=delta)
    variables = parameters_of(law)
    p, symbols = symbols_of(variables)
    x, w = ca.SX.sym("x"), ca.SX.sym("w")
    this = with_symbols(law, symbols, w)
    level = this.level(w)
    both = ca.vertcat(
        this.contact(x, w, level) + this.viscous(w), this.rate(x, w, level), this.advance(x, w, level, 1e-4)
    )
    everything = ca.vertcat(x, w, p)
    slopes = ca.Function("slopes", [x, w, p], [both, ca.jacobian(both, everything)])
    for values in slopes(1.0, v, [variable.start for variable in variables]):
        assert np.all(np.isfinite(values.full()))


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


def test_a_stiffness_that_depends_on_direction_leaves_the_torque_continuous_at_a_reversal() -> None:
    """The state is the bristle torque, so the jump of 0.45 N m that a state in radians shows does not exist."""
    law = replace(LUGRE, sigma0=Pair(9.85e4, 8.61e4), sigma1=0.0, sigma2=0.0)
    variables = parameters_of(law)
    p, symbols = symbols_of(variables)
    x, w = ca.SX.sym("x"), ca.SX.sym("w")
    this = with_symbols(law, symbols, w)
    friction = ca.Function("friction", [x, w, p], [this.contact(x, w, this.level(w))])
    values = [variable.start for variable in variables]
    assert float(friction(3.0, 1e-12, values)) == pytest.approx(float(friction(3.0, -1e-12, values)), abs=1e-9)


def test_the_shipped_mount_breaks_away_at_the_papers_torque() -> None:
    law = read_card("paper_mount").friction
    ramp = [float(law.level(v)) for v in (1e-6, 1e-3, 0.04129, 0.7)]
    assert ramp == sorted(ramp, reverse=True)
    assert ramp[0] == pytest.approx(3.322, rel=1e-6)  # Table 2, nominal: Fs
    assert ramp[2] == pytest.approx(2.322 + 1 / np.e, rel=1e-6)  # at Vs the rise has fallen to 1/e
