"""What lies between the drive and the reading: delays, lags, clocks and springs.

Between a delay and a lag the part of the signals that follows the set point decides, whatever the noise does; between
a late torque and a late reading the reading's own lag behind the set point.
"""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from effect_examples import linear, mount
from problems import compared, likeliest, problem_of
from wandering import axis, swing
from wandering import recorded as read

from cosim.data.recording import Recording
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import _problem
from cosim.diagnosis.effects import candidates, hypothesis_of
from cosim.diagnosis.effects.clock_skew import Clocks
from cosim.diagnosis.effects.delay_and_lag import attributed, reading_lag
from cosim.diagnosis.search.admissibility import is_degenerate
from cosim.diagnosis.search.candidate_fit import margin
from cosim.diagnosis.search.instrumental_variable import DECISIVE, misfits_of
from cosim.diagnosis.search.stages import admission, refitted
from cosim.estimation.fit import Fit
from cosim.estimation.inverse import Inverse
from cosim.estimation.prepare import Prepared, prepare
from cosim.estimation.problem import Problem
from pyfmi_models.card import parse_card
from pyfmi_models.effects import ActuatorLag, Delay, Effect, FrictionAsymmetry, TorqueOffset
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.clock_skew import ClockSkew
from pyfmi_models.effects.compliance import Compliance, LoadSideCompliance
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.friction import Coulomb, Frictionless, LuGre
from pyfmi_models.mount import Axis, Mount

BASE = axis(Fc=0.5)
Drive = Delay | ActuatorLag


def answered(drive: Drive, noise: float, hertz: float = 12.0) -> Prepared:
    """A drive behind a controller that answers encoder noise: torque of the true motion, less some of the noise's."""
    rng, t = np.random.default_rng(3), np.arange(30_000) / 1000
    tones = [(0.3 / (2 * np.pi * f) ** 2, f, rng.uniform(0, 6)) for f in np.geomspace(0.5, hertz, 9)]
    q = 0.2 * np.sin(0.7 * t) + sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in tones)
    still = prepare([Recording("r", {"t": t, "tau": t, "q": q, "q_d": q})], 20.0)
    torque = Inverse(replace(BASE, effects=(drive,)), ()).torque(still.pieces[0], np.zeros(0))[0]
    seen = q + noise * rng.standard_normal(len(t))
    noisy = prepare([Recording("r", {"t": t, "tau": t, "q": seen, "q_d": q})], 20.0)
    piece = noisy.pieces[0]
    reply = -0.4 * BASE.axis.inertia * piece.lowpass(piece.a - still.pieces[0].a)
    return replace(noisy, pieces=(replace(piece, tau=torque + reply),))


@pytest.mark.parametrize("drive", [Delay(delay_ms=5.0), ActuatorLag(time_constant_ms=5.0)], ids=lambda one: one.id)
def test_the_right_one_of_delay_and_lag_is_told_in_noise_that_the_controller_answers(drive: Drive) -> None:
    prepared = answered(drive, 2e-6)
    for fitted in (Delay(delay_ms=6.0), ActuatorLag(time_constant_ms=6.0)):
        misfits = misfits_of(prepared, replace(BASE, effects=(fitted,)), fitted)
        other = next(name for name in misfits if name != drive.id)
        assert misfits[other] - misfits[drive.id] > DECISIVE


def blind(prepared: Prepared) -> Prepared:
    """The same without a set point."""
    return replace(prepared, pieces=tuple(replace(piece, extras={}) for piece in prepared.pieces))


def test_without_a_set_point_nothing_is_said() -> None:
    drive = Delay(delay_ms=5.0)
    assert misfits_of(blind(answered(drive, 0.0)), replace(BASE, effects=(drive,)), drive) == {}


def trailing(seconds: float, noise: float = 2e-6) -> Prepared:
    """A reading that is so much later than its set point, and a motion that turns now and then."""
    rng, t = np.random.default_rng(4), np.arange(40_000) / 1000
    q_d, q = (0.2 * np.sin(0.7 * late) + 0.01 * np.sin(9 * late) for late in (t, t - seconds))
    row = {"t": t, "tau": np.gradient(q, t), "q": q + noise * rng.standard_normal(len(t)), "q_d": q_d}
    return prepare([Recording("r", row)], 20.0)


def test_how_late_a_reading_is_behind_its_set_point_is_measured_within_its_error() -> None:
    late = reading_lag(trailing(5e-3))
    assert late is not None
    assert abs(late.seconds - 5e-3) < 3 * late.error + 2e-5
    assert late.error < 1e-4


def test_a_loop_that_trails_by_itself_leaves_it_open_as_does_a_set_point_that_was_not_recorded() -> None:
    prepared = trailing(12e-3)
    assert attributed(prepared, 5e-3, 1e-3) == "either"
    assert attributed(blind(prepared), 5e-3, 1e-3) == "either"
    assert attributed(blind(prepared), 0.5e-3, 1e-3) == "drive"


@pytest.mark.parametrize(
    ("effect", "seconds"),
    [
        (ClockSkew(offset_ms=-5.0, drift_ppm=0.0), 5e-3),
        (ClockSkew(offset_ms=5.0, drift_ppm=0.0), None),  # the reading is early
        (ClockSkew(offset_ms=-5.0, drift_ppm=-100.0), 7e-3),  # 4 ms in 40 s, 2 ms in their middle
    ],
)
def test_a_clock_that_is_late_says_by_how_many_seconds(effect: ClockSkew, seconds: float | None) -> None:
    problem: Any = SimpleNamespace(seconds=40.0, sample_time=1e-3)
    assert Clocks().late(problem, effect) == (None if seconds is None else pytest.approx(seconds))


@pytest.mark.parametrize(
    ("effect", "trails", "degenerate"),
    [
        (ClockSkew(offset_ms=-5.2, drift_ppm=0.0), 5e-3, False),  # the reading trails by it: two clocks
        (ClockSkew(offset_ms=-5.0, drift_ppm=0.0), 0.0, True),  # it does not: a drive
        (ClockSkew(offset_ms=-4.0, drift_ppm=-50.0), 5e-3, False),
        (ClockSkew(offset_ms=-4.0, drift_ppm=-50.0), 0.0, True),
        (ClockSkew(offset_ms=-0.5, drift_ppm=100.0), 0.0, False),  # no torque is late
        (ClockSkew(offset_ms=5.0, drift_ppm=0.0), 0.0, False),
        (Delay(delay_ms=5.2), 5e-3, True),
        (Delay(delay_ms=5.0), 0.0, False),
        (ActuatorLag(time_constant_ms=0.1), 0.0, True),  # less than time stamps can be trusted for
    ],
)
def test_a_lag_lies_in_the_drive_or_in_the_clocks(effect: Effect, trails: float, degenerate: bool) -> None:
    problem: Any = SimpleNamespace(seconds=40.0, sample_time=1e-3, prepared=trailing(trails))
    assert hypothesis_of(effect).is_degenerate(problem, effect) is degenerate


# A contact that bends, a delay and a play look alike about turns: which stays a rival, and which tells a size.

CARD = parse_card('[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 1.0\n', "card.toml")
STARTS = (Presliding(sigma0=100.0), Delay(delay_ms=3.0), Backlash(gap_rad=1e-3, load_share=0.3, load_friction=0.1))


def recorded(effect: Effect, noise: float, seed: int, ripple: float) -> Recording:
    """A machine with an effect, 0.3 rad to and fro, and a faster motion over it."""
    t, rng = np.arange(3000) / 200, np.random.default_rng(seed)
    q, _, _ = swing(t, [(0.3, 1.5, 1.5 * seed), (ripple, 5.0, 5.0 * seed)], per=1)
    (piece,) = prepare([read(t, t, q)], 90.0).pieces
    tau = Inverse(replace(CARD.plant(), effects=(effect,)), ()).torque(piece, np.zeros(0))[0]
    return read(tau + noise * rng.standard_normal(len(tau)), piece.t, piece.q, f"run_{seed}")


@pytest.mark.parametrize(
    ("effect", "noise", "ripple"),
    [(Presliding(sigma0=1000.0), 0.1, 0.0), (Delay(delay_ms=5.0), 0.02, 0.03)],
    ids=["a contact that bends", "a delay"],
)
def test_only_the_one_that_is_there_is_admissible_and_near(effect: Effect, noise: float, ripple: float) -> None:
    comparison, base = compared(_problem([recorded(effect, noise, seed, ripple) for seed in (1, 2)], CARD), 40)
    fits = {one.id: refitted(comparison, base, one, 1) for one in STARTS}
    own = fits[effect.id]
    assert own.evidence > POLICY.clear
    admitted = {name: one for name, one in fits.items() if all_pass(admission(comparison, one))}
    assert {name for name, one in admitted.items() if margin(comparison, own, one) < POLICY.fair} == {effect.id}


LUGRE = LuGre(sigma0=1e5, sigma1=300.0, sigma2=1.0, Fc=2.0, Fs=2.5, Vs=0.01)


def offered(prepared: Prepared, mount: Mount, *effects: Effect) -> set[str]:
    rows = np.ones(len(prepared.recording_of))
    return {one.effect for one in candidates(replace(mount, effects=effects), prepared, rows, rows)}


@pytest.mark.parametrize(("mount", "both"), [(axis(), False), (replace(axis(), friction=LUGRE), True)])
def test_an_offset_and_an_asymmetry_are_offered_together_where_rest_tells_them_apart(mount: Mount, both: bool) -> None:
    t = np.arange(4_000) / 200
    v = 0.2 * np.cos(0.9 * t)
    prepared = prepare([read(2 * np.sign(v) + v, t, np.cumsum(v) / 200)], 10.0)
    sides = FrictionAsymmetry(level_asymmetry=0.1, viscous_asymmetry=0.0)
    assert {"torque_offset", "friction_asymmetry"} <= offered(prepared, mount)
    assert ("friction_asymmetry" in offered(prepared, mount, TorqueOffset(torque=0.3))) is both
    assert ("torque_offset" in offered(prepared, mount, sides)) is both


# A spring between the drive and the encoder, or behind the encoder. Recordings are closed forms: at a steady advance
# with tones on it, s = 2 pi i f, with L the torque that the load needs,
#
#     load side:   motor = q + L / (k + d s),   tau = J_motor s^2 motor + L,   L = (J_load s^2 + sigma2 s) q
#     motor side:  tau = (J_motor s^2 + sigma2 s) q + J_load s^2 (k + d s) / (J_load s^2 + d s + k) q

BELIEVED = Mount(name="m", axis=Axis(inertia=27.0), friction=Coulomb(Fc=2.0, sigma2=40.0))
SHARE, DAMPING = 0.65, 0.03
"""Share of the inertia on the load, and d / k = 2 `DAMPING` / (2 pi fr)."""


SPRINGS = LoadSideCompliance(resonance_hz=25.0, encoder_share=0.6), Compliance(antiresonance_hz=50, resonance_hz=60)


@pytest.mark.parametrize("other", SPRINGS, ids=["behind the axis", "before it"])
@pytest.mark.parametrize("spring", SPRINGS, ids=["behind the axis", "before it"])
def test_a_mount_with_a_spring_is_asked_for_no_other(spring: Effect, other: Effect) -> None:
    assert hypothesis_of(other).may_come(mount())
    assert not hypothesis_of(other).may_come(mount(spring))


def test_springs_before_and_behind_the_axis_are_a_chain_in_whatever_order_they_are_written() -> None:
    first, second = (linear(mount(*some, friction=Frictionless()).model())[0] for some in (SPRINGS, SPRINGS[::-1]))
    np.testing.assert_allclose(*(np.sort_complex(np.linalg.eigvals(one)) for one in (first, second)), atol=1e-6)


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
    return read(torque + rng.normal(0, 0.02, len(t)), t, q + rng.normal(0, 1e-8, len(t)), f"{side} {seed}")


def problem(hertz: float, side: str) -> tuple[Problem, Fit]:
    """Two recordings of such a machine, and the fit of the rigid axis."""
    found = problem_of(BELIEVED, *(rung(hertz, side, seed) for seed in (1, 2)), cutoff=40.0, slow=0.0, sample=1e-3)
    return found, found.fit(BELIEVED, 25)


def energy(given: Problem, base: Fit, *effects: Effect) -> tuple[float, Effect]:
    """Share of the rigid axis' residual energy that the best of these starts leaves, and what it came to."""
    fits = [given.fit(replace(base.mount, effects=(one,)), 40) for one in effects]
    best = min(fits, key=given.error)
    return (given.error(best) / given.error(base)) ** 2, best.mount.effects[0]


FORMS = {
    "load": [LoadSideCompliance(resonance_hz=hertz, encoder_share=0.5) for hertz in (35.0, 90.0)],
    "motor": [Compliance(antiresonance_hz=hertz, resonance_hz=1.2 * hertz) for hertz in (15.0, 30.0)],
}


@pytest.mark.parametrize(
    ("hertz", "side", "other"), [(32, "load", "motor"), (120, "load", "motor"), (40, "motor", "load")]
)
def test_a_fit_finds_the_resonance_of_the_right_form(hertz: float, side: str, other: str) -> None:
    given, base = problem(hertz, side)
    left, found = energy(given, base, *FORMS[side])
    numbers = {"resonance_hz": hertz, **({"antiresonance_hz": hertz * np.sqrt(1 - SHARE)} if side == "motor" else {})}
    assert {name: getattr(found, name) for name in numbers} == pytest.approx(numbers, rel=0.05)
    assert getattr(found, "encoder_share", 0.5) == 0.5, "left as it was"
    assert left < 0.05
    assert energy(given, base, *FORMS[other])[0] > 4 * left


@pytest.mark.parametrize("hertz", [32.0, 120.0])
def test_the_likeliest_spring_starts_where_a_fit_ends_at_the_resonance(hertz: float) -> None:
    given, base = problem(hertz, "load")
    start = likeliest(compared(given)[0], base, "compliance")
    assert isinstance(start, LoadSideCompliance)
    assert energy(given, base, start)[1].resonance_hz == pytest.approx(hertz, rel=0.05)


def test_a_spring_that_only_the_reversals_of_friction_show_is_none() -> None:
    """A slow motion to and fro asks nothing of a spring but to be wound up by friction, again and again."""
    t = np.arange(20_000) / 1000
    q, v = 0.2 * np.sin(2.0 * t), 0.4 * np.cos(2.0 * t)
    torque = -30.0 * 0.8 * np.sin(2.0 * t) + 2.5 * np.sign(v) + 30.0 * v
    slow = problem_of(BELIEVED, read(torque, t, q), cutoff=40.0, slow=0.0, sample=1e-3)
    spring = LoadSideCompliance(resonance_hz=90.0, encoder_share=0.5)
    assert is_degenerate(slow, spring)
    assert not is_degenerate(problem(90.0, "load")[0], spring)
