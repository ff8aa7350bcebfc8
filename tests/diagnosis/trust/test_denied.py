"""A lag between the clocks that the model with its effects denies is not said, and withholds no name."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.answer.doubt_entry import Sanity
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.trust.doubts import beyond_denial, without_denied
from pyfmi_models.card import parse_card
from pyfmi_models.effects import Delay, Effect, TorqueOffset
from pyfmi_models.effects.clock_skew import ClockSkew
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

AXIS = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=1.0))
CLOCKS = Sanity(finding="clocks", statement="late", blocks_naming=True)
SIGN = Sanity(finding="torque_sign", statement="turned", blocks_naming=True)


@dataclass
class Fitted:
    mount: Mount


@dataclass
class Tried:
    effect: Effect
    fit: Fitted
    evidence: float


@dataclass
class Beside:
    tried: tuple[Tried, ...]


def held(*effects: Effect) -> Fitted:
    return Fitted(replace(AXIS, effects=effects))


def left(chosen: Fitted, *beside: tuple[Effect, float]) -> tuple[Sanity, ...]:
    tried = tuple(Tried(effect, held(effect), worth) for effect, worth in beside)
    return without_denied((CLOCKS, SIGN), chosen, Beside(tried))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("chosen", "beside", "stays"),
    [
        (held(), (), False),
        (held(TorqueOffset(torque=1.0)), (), False),
        (held(Delay(delay_ms=20.0)), (), True),
        (held(Delay(delay_ms=2.0)), (), False),
        (held(ClockSkew(offset_ms=-20.0, drift_ppm=0.0)), (), True),
        (held(), ((Delay(delay_ms=20.0), 3.0),), True),
        (held(), ((Delay(delay_ms=20.0), -1.0),), False),
        (held(), ((TorqueOffset(torque=20.0), 50.0),), False),
    ],
)
def test_a_lag_stays_where_the_model_wants_one(
    chosen: Fitted, beside: tuple[tuple[Effect, float], ...], stays: bool
) -> None:
    assert left(chosen, *beside) == ((CLOCKS, SIGN) if stays else (SIGN,))


def test_what_no_model_settles_is_never_left_out() -> None:
    assert beyond_denial((SIGN, CLOCKS, SIGN)) == (SIGN, SIGN)


CARD = parse_card(
    '[mount]\nname = "axis"\ninertia = 0.66\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 0.25\n', "a"
)


def shaken(seed: int, late: float, shake: float) -> Recording:
    """An axis on a ground that shakes at 7.3 Hz, where its loop no longer holds it; the position `late` [s]."""
    t = np.arange(3_000) / 250
    w = 2 * np.pi * 7.3
    tones = [(0.5, 0.7 + 0.1 * seed, 0.0), (0.2, 1.9, seed), (0.08, 5.3, 2 * seed), (0.006 * shake, w, 0.9)]
    moves = [[size * o**k * np.sin(o * t + p + k * np.pi / 2) for size, o, p in tones] for k in range(3)]
    q, v, a = (np.sum(one, axis=0) for one in moves)
    ground = 0.25 * shake * np.sin(w * t + 1.4)
    noise = 0.03 * np.random.default_rng(seed).standard_normal(len(t))
    tau = 0.6 * a + 1.1 * np.tanh(v / 2e-4) + 0.3 * v + ground + noise
    rows = round(250 * late)
    read = np.concatenate([np.repeat(q[:1], rows), q[: len(q) - rows]])
    return Recording(f"run{seed}", {"t": t, "tau": tau, "q": read, "q_d": np.sum(moves[0][:3], axis=0)})


@pytest.mark.parametrize(("late", "shake"), [(0.0, 1.0), (0.028, 0.0)])
def test_a_ground_that_shakes_is_no_clock_and_two_clocks_stay_two(late: float, shake: float) -> None:
    found = diagnose([shaken(1, late, shake), shaken(2, late, shake)], [shaken(3, late, shake)], CARD).diagnosis
    assert ("clocks" in [one.finding for one in found.sanity]) is (late > 0)
    assert ("unknown" in found.verdict) is (late > 0)
