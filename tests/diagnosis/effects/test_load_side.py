"""The motor drives through a spring and the encoder is on the load: no antiresonance, and a fit that finds which form.

Recordings are closed forms: at a steady advance with tones on it, s = 2 pi i f, with L the torque that the load needs,

    load side:   motor = q + L / (k + d s),   tau = J_motor s^2 motor + L,   L = (J_load s^2 + sigma2 s) q
    motor side:  tau = (J_motor s^2 + sigma2 s) q + J_load s^2 (k + d s) / (J_load s^2 + d s + k) q
"""

from dataclasses import replace

import numpy as np
import pytest
from effect_examples import INERTIA, linear, mount, simulate
from scipy.integrate import solve_ivp
from scipy.linalg import eigvals

from cosim.data.recording import Recording
from cosim.diagnosis.effects import candidates
from cosim.diagnosis.effects.candidates import columns_of
from cosim.diagnosis.search.admissibility import is_degenerate
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Prepared, prepare
from cosim.estimation.problem import Problem
from pyfmi_models.card import CardError, parse_card
from pyfmi_models.card_writer import card_text
from pyfmi_models.effects import Effect, GravityUnbalance
from pyfmi_models.effects.compliance import Compliance, LoadSideCompliance
from pyfmi_models.friction import Coulomb, Frictionless
from pyfmi_models.mount import Axis, Mount

SPRING = LoadSideCompliance(resonance_hz=25.0, encoder_share=0.6, damping_ratio=0.0)
FREE, OIL = Frictionless(), Coulomb(Fc=0.0, sigma2=3.0)
AXIS, MOTOR = 0.6 * INERTIA, 0.4 * INERTIA
STIFFNESS = AXIS * MOTOR / INERTIA * (2 * np.pi * 25.0) ** 2
CARD = '[mount]\ninertia = 2\n[friction]\nmodel = "none"\n[[effects]]\neffect = "compliance"\n'

CUTOFF = 40.0
BELIEVED = Mount(name="m", axis=Axis(inertia=27.0), friction=Coulomb(Fc=2.0, sigma2=40.0))
SHARE, DAMPING = 0.65, 0.03
"""Share of the inertia on the load, and d / k = 2 `DAMPING` / (2 pi fr)."""


def tau(t: float) -> float:
    return 3.0 * np.sin(9.0 * t) + 2.0 * np.sin(70.0 * t)


def test_the_plant_is_that_of_two_masses_written_by_hand() -> None:
    """Absolute positions, explicit method: another way to the same motion."""
    spring, weight = replace(SPRING, damping_ratio=0.05), GravityUnbalance(mgl=4.0, phase=0.3)
    damping = STIFFNESS * 2 * 0.05 / (2 * np.pi * 25.0)

    def rates(t: float, x: np.ndarray) -> list[float]:
        motor, axis, motor_speed, speed = x
        passed = STIFFNESS * (motor - axis) + damping * (motor_speed - speed)
        resisting = 3.0 * speed + 4.0 * np.sin(axis + 0.3)
        return [motor_speed, speed, (tau(t) - passed) / MOTOR, (passed - resisting) / AXIS]

    t = np.linspace(0, 0.5, 50)
    motor, axis, _, speed = solve_ivp(rates, (0, 0.5), np.zeros(4), "DOP853", t, rtol=1e-11, atol=1e-13).y
    run = simulate(mount(weight, spring, friction=OIL).model(), t, tau)
    for name, expected in (("q", axis), ("v", speed), ("q_motor", motor)):
        np.testing.assert_allclose(run[name], expected, rtol=0, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("turned", [False, True])
def test_springs_before_and_behind_the_axis_are_a_chain_in_whatever_order_they_are_written(turned: bool) -> None:
    """Three bodies; closed form: eigenvalues of M^-1 K."""
    behind = Compliance(antiresonance_hz=50.0, resonance_hz=60.0, damping_ratio=0.0)
    tail = AXIS * behind.share()
    k1, k2 = STIFFNESS, tail * (2 * np.pi * 50) ** 2
    stiffness = np.array([[k1, -k1, 0], [-k1, k1 + k2, -k2], [0, -k2, k2]])
    masses = np.array([MOTOR, AXIS - tail, tail])
    expected = np.sqrt(np.sort(eigvals(stiffness / masses[:, None]).real)[1:]) / (2 * np.pi)
    parts = (behind, SPRING) if turned else (SPRING, behind)
    found = np.sort(np.abs(eigvals(linear(mount(*parts, friction=FREE).model())[0])) / (2 * np.pi))
    np.testing.assert_allclose(found[found > 1][::2], expected, rtol=1e-6)


def test_a_card_says_by_its_keys_where_the_encoder_is() -> None:
    load = parse_card(CARD + "resonance_hz = 60\nencoder_share = 0.4\n", "card")
    assert load.effects == (LoadSideCompliance(resonance_hz=60.0, encoder_share=0.4),)
    assert parse_card(card_text(load), "again").effects == load.effects
    motor = parse_card(CARD + "antiresonance_hz = 50\nresonance_hz = 60\n", "card")
    assert motor.effects == (Compliance(antiresonance_hz=50.0, resonance_hz=60.0),)
    with pytest.raises(CardError, match="encoder_share = 1 is outside"):
        parse_card(CARD + "resonance_hz = 60\nencoder_share = 1\n", "card")


def needed(s: np.ndarray, hertz: float, side: str) -> np.ndarray:
    """Torque per position of two masses whose resonance this is, at complex frequencies."""
    total, oil = 30.0, 30.0
    load, motor = SHARE * total, (1 - SHARE) * total
    spring = load * motor / total * (2 * np.pi * hertz) ** 2 * (1 + 2 * DAMPING / (2 * np.pi * hertz) * s)
    if side == "motor":
        return motor * s**2 + oil * s + load * s**2 * spring / (load * s**2 + spring)
    on_load = load * s**2 + oil * s
    return motor * s**2 * (1 + on_load / spring) + on_load


def recorded(hertz: float, side: str, seed: int) -> Recording:
    """A steady advance of 0.2 rad/s with tones up to 30 Hz, and the noise of a good encoder and a drive."""
    rng, t = np.random.default_rng(seed), np.arange(20_000) / 1000
    f = np.array([0.3, 0.7, 1.9, 4.1, 7.3, 11.0, 16.0, 21.0, 26.0, 30.0])
    size, phase, s = 0.3 / (2 * np.pi * np.maximum(f, 2.0)) ** 2, rng.uniform(0, 2 * np.pi, len(f)), 2j * np.pi * f
    waves = size * np.exp(s * t[:, None] + 1j * phase)
    torque = 2.5 + 30.0 * 0.2 + (waves * needed(s, hertz, side)).sum(axis=1).imag
    q = 0.2 * t + waves.sum(axis=1).imag
    return Recording(
        f"{side} {seed}",
        {"t": t, "tau": torque + rng.normal(0, 0.02, len(t)), "q": q + rng.normal(0, 1e-8, len(t))},
    )


def problem(hertz: float, side: str) -> tuple[Problem, Fit]:
    """Two recordings of such a machine, and the fit of the rigid axis."""
    prepared: Prepared = prepare([recorded(hertz, side, seed) for seed in (1, 2)], CUTOFF)
    found = Problem(BELIEVED, prepared, np.ones(len(prepared.recording_of)), 1e-3)
    return found, found.fit(BELIEVED, 25)


def energy(given: Problem, base: Fit, *effects: Effect) -> tuple[float, Effect]:
    """Share of the rigid axis' residual energy that the best of these starts leaves, and what it came to."""
    fits = [given.fit(replace(base.mount, effects=(one,)), 40) for one in effects]
    best = min(fits, key=given.error)
    return (given.error(best) / given.error(base)) ** 2, best.mount.effects[0]


LOAD_STARTS = [LoadSideCompliance(resonance_hz=hertz, encoder_share=0.5) for hertz in (35.0, 90.0)]
MOTOR_STARTS = [Compliance(antiresonance_hz=hertz, resonance_hz=1.2 * hertz) for hertz in (15.0, 30.0)]


@pytest.mark.parametrize("hertz", [32.0, 120.0])
def test_a_fit_finds_the_resonance_without_knowing_the_shares(hertz: float) -> None:
    given, base = problem(hertz, "load")
    left, found = energy(given, base, *LOAD_STARTS)
    assert found.resonance_hz == pytest.approx(hertz, rel=0.05)
    assert found.encoder_share == 0.5  # left as it was
    assert left < 0.05
    assert energy(given, base, *MOTOR_STARTS)[0] > 4 * left


def test_the_other_form_is_told_as_well() -> None:
    given, base = problem(40.0, "motor")
    left, found = energy(given, base, *MOTOR_STARTS)
    assert found.resonance_hz == pytest.approx(40.0, rel=0.05)
    assert found.antiresonance_hz == pytest.approx(40.0 * np.sqrt(1 - SHARE), rel=0.05)
    assert energy(given, base, *LOAD_STARTS)[0] > 4 * left


@pytest.mark.parametrize("hertz", [32.0, 120.0])
def test_the_candidate_most_like_the_residual_starts_where_a_fit_ends_at_the_resonance(hertz: float) -> None:
    given, base = problem(hertz, "load")
    tried = candidates(base.mount, given.prepared, base.residual, np.ones_like(base.residual), ("compliance",))
    columns = [column[:, 0] for column in columns_of(base.mount, tried, given.prepared, base.values)]
    own = [column - base.slopes @ np.linalg.lstsq(base.slopes, column, rcond=None)[0] for column in columns]
    sizes = np.array([one @ base.residual / (one @ one) for one in own])
    gains = [size * one @ base.residual for size, one in zip(sizes, own, strict=True)]
    best = int(np.argmax(gains))
    start = tried[best].start(sizes[[best]])
    assert isinstance(start, LoadSideCompliance)
    assert energy(given, base, start)[1].resonance_hz == pytest.approx(hertz, rel=0.05)


def test_a_spring_that_only_the_reversals_of_friction_show_is_none() -> None:
    """A slow motion to and fro asks nothing of a spring but to be wound up by friction, again and again."""
    t = np.arange(20_000) / 1000
    q, v = 0.2 * np.sin(2.0 * t), 0.4 * np.cos(2.0 * t)
    torque = -30.0 * 0.8 * np.sin(2.0 * t) + 2.5 * np.sign(v) + 30.0 * v
    prepared = prepare([Recording("slow", {"t": t, "tau": torque, "q": q})], CUTOFF)
    slow = Problem(BELIEVED, prepared, np.ones(len(prepared.recording_of)), 1e-3)
    spring = LoadSideCompliance(resonance_hz=90.0, encoder_share=0.5)
    assert is_degenerate(slow, spring)
    assert not is_degenerate(problem(90.0, "load")[0], spring)
