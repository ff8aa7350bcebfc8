"""The motor drives through a spring and the encoder is on the load: no antiresonance, and a fit that finds which form.

Recordings are closed forms: at a steady advance with tones on it, s = 2 pi i f, with L the torque that the load needs,

    load side:   motor = q + L / (k + d s),   tau = J_motor s^2 motor + L,   L = (J_load s^2 + sigma2 s) q
    motor side:  tau = (J_motor s^2 + sigma2 s) q + J_load s^2 (k + d s) / (J_load s^2 + d s + k) q
"""

from dataclasses import replace

import numpy as np
import pytest
from effect_examples import linear, mount
from problems import problem_of
from wandering import recorded

from cosim.data.recording import Recording
from cosim.diagnosis.effects import candidates
from cosim.diagnosis.effects.candidates import columns_of
from cosim.diagnosis.search.admissibility import is_degenerate
from cosim.estimation.fit import Fit
from cosim.estimation.problem import Problem
from pyfmi_models.card import parse_card
from pyfmi_models.card_writer import card_text
from pyfmi_models.effects import Effect
from pyfmi_models.effects.compliance import Compliance, LoadSideCompliance
from pyfmi_models.friction import Coulomb, Frictionless
from pyfmi_models.mount import Axis, Mount

CARD = '[mount]\ninertia = 2\n[friction]\nmodel = "none"\n[[effects]]\neffect = "compliance"\n'

BELIEVED = Mount(name="m", axis=Axis(inertia=27.0), friction=Coulomb(Fc=2.0, sigma2=40.0))
SHARE, DAMPING = 0.65, 0.03
"""Share of the inertia on the load, and d / k = 2 `DAMPING` / (2 pi fr)."""


def test_springs_before_and_behind_the_axis_are_a_chain_in_whatever_order_they_are_written() -> None:
    springs = LoadSideCompliance(resonance_hz=25.0, encoder_share=0.6), Compliance(antiresonance_hz=50, resonance_hz=60)
    first, second = (linear(mount(*some, friction=Frictionless()).model())[0] for some in (springs, springs[::-1]))
    np.testing.assert_allclose(*(np.sort_complex(np.linalg.eigvals(one)) for one in (first, second)), atol=1e-6)


def test_a_card_says_by_its_keys_where_the_encoder_is() -> None:
    load = parse_card(CARD + "resonance_hz = 60\nencoder_share = 0.4\n", "card")
    assert load.effects == (LoadSideCompliance(resonance_hz=60.0, encoder_share=0.4),)
    assert parse_card(card_text(load), "again").effects == load.effects
    motor = parse_card(CARD + "antiresonance_hz = 50\nresonance_hz = 60\n", "card")
    assert motor.effects == (Compliance(antiresonance_hz=50.0, resonance_hz=60.0),)


def needed(s: np.ndarray, hertz: float, side: str) -> np.ndarray:
    """Torque per position of two masses whose resonance this is, at complex frequencies."""
    total, oil = 30.0, 30.0
    load, motor = SHARE * total, (1 - SHARE) * total
    spring = load * motor / total * (2 * np.pi * hertz) ** 2 * (1 + 2 * DAMPING / (2 * np.pi * hertz) * s)
    if side == "motor":
        return motor * s**2 + oil * s + load * s**2 * spring / (load * s**2 + spring)
    on_load = load * s**2 + oil * s
    return motor * s**2 * (1 + on_load / spring) + on_load


def rung(hertz: float, side: str, seed: int) -> Recording:
    """A steady advance of 0.2 rad/s with tones up to 30 Hz, and the noise of a good encoder and a drive."""
    rng, t = np.random.default_rng(seed), np.arange(20_000) / 1000
    f = np.array([0.3, 0.7, 1.9, 4.1, 7.3, 11.0, 16.0, 21.0, 26.0, 30.0])
    size, phase, s = 0.3 / (2 * np.pi * np.maximum(f, 2.0)) ** 2, rng.uniform(0, 2 * np.pi, len(f)), 2j * np.pi * f
    waves = size * np.exp(s * t[:, None] + 1j * phase)
    torque = 2.5 + 30.0 * 0.2 + (waves * needed(s, hertz, side)).sum(axis=1).imag
    q = 0.2 * t + waves.sum(axis=1).imag
    return recorded(torque + rng.normal(0, 0.02, len(t)), t, q + rng.normal(0, 1e-8, len(t)), f"{side} {seed}")


def problem(hertz: float, side: str) -> tuple[Problem, Fit]:
    """Two recordings of such a machine, and the fit of the rigid axis."""
    found = problem_of(BELIEVED, *(rung(hertz, side, seed) for seed in (1, 2)), cutoff=40.0, slow=0.0, sample=1e-3)
    return found, found.fit(BELIEVED, 25)


def energy(given: Problem, base: Fit, *effects: Effect) -> tuple[float, Effect]:
    """Share of the rigid axis' residual energy that the best of these starts leaves, and what it came to."""
    fits = [given.fit(replace(base.mount, effects=(one,)), 40) for one in effects]
    best = min(fits, key=given.error)
    return (given.error(best) / given.error(base)) ** 2, best.mount.effects[0]


STARTS = {
    "load": [LoadSideCompliance(resonance_hz=hertz, encoder_share=0.5) for hertz in (35.0, 90.0)],
    "motor": [Compliance(antiresonance_hz=hertz, resonance_hz=1.2 * hertz) for hertz in (15.0, 30.0)],
}


@pytest.mark.parametrize(
    ("hertz", "side", "other"), [(32, "load", "motor"), (120, "load", "motor"), (40, "motor", "load")]
)
def test_a_fit_finds_the_resonance_of_the_right_form(hertz: float, side: str, other: str) -> None:
    given, base = problem(hertz, side)
    left, found = energy(given, base, *STARTS[side])
    numbers = {"resonance_hz": hertz, **({"antiresonance_hz": hertz * np.sqrt(1 - SHARE)} if side == "motor" else {})}
    assert {name: getattr(found, name) for name in numbers} == pytest.approx(numbers, rel=0.05)
    assert getattr(found, "encoder_share", 0.5) == 0.5, "left as it was"
    assert left < 0.05
    assert energy(given, base, *STARTS[other])[0] > 4 * left


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
    slow = problem_of(BELIEVED, recorded(torque, t, q), cutoff=40.0, slow=0.0, sample=1e-3)
    spring = LoadSideCompliance(resonance_hz=90.0, encoder_share=0.5)
    assert is_degenerate(slow, spring)
    assert not is_degenerate(problem(90.0, "load")[0], spring)
