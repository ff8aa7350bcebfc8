"""What a bound says of itself: for which members of its kind it holds, and where the band ends its knowledge."""

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.effects import candidates, hypothesis_of
from cosim.diagnosis.effects.base import Seen
from cosim.diagnosis.effects.candidates import span_of
from cosim.diagnosis.measure.bounds import SeenFrom, _absent
from cosim.estimation.prepare import Prepared, prepare
from pyfmi_models.effects import Cogging, Effect, PeriodicFriction
from pyfmi_models.effects.compliance import Compliance, LoadSideCompliance
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

ROTARY = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=1.0))
LINEAR = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=1.0), motion="linear")
WAVES = (
    Cogging(cycles_per_rev=9.0, amplitude=0.1),
    PeriodicFriction(cycles_per_rev=9.0, relative_amplitude=0.1),
    EncoderEccentricity(cycles_per_rev=1.0, amplitude_rad=1e-4),
)
SPRINGS = (
    Compliance(antiresonance_hz=9.0, resonance_hz=11.0),
    LoadSideCompliance(resonance_hz=11.0, encoder_share=0.5),
)
TONE = PeriodicDisturbance(frequency_hz=9.0, amplitude=0.1)
CUTOFF, SPEED = 20.0, 2.0


def told(effect: Effect, low: float, high: float, mount: Mount = ROTARY) -> str:
    return hypothesis_of(effect).looked(Seen(0.1, low, high, CUTOFF), mount)


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    """An axis that goes to and fro at one speed, 10 rad each way."""
    t = np.arange(4000) / 200
    q = 10 - np.abs(SPEED * t % 20 - 10)
    return prepare([Recording("run", {"t": t, "tau": np.sign(np.gradient(q)), "q": q})], CUTOFF)


@pytest.mark.parametrize("effect", WAVES, ids=lambda one: one.id)
def test_waves_over_position_are_told_between_two_cycles_and_are_not_testable_above(effect: Effect) -> None:
    assert told(effect, 1.5, 53.333) == "at 1.5 to 53.3 cycles a turn; not testable above"
    assert told(effect, 8.0, 8.0) == "at 8 cycles a turn; not testable above"
    assert told(effect, 31.4159, 2412.7, LINEAR) == "at 31.4 to 2413 cycles a metre; not testable above"


@pytest.mark.parametrize("effect", SPRINGS, ids=lambda one: type(one).__name__)
def test_a_spring_is_told_below_a_resonance_and_is_not_testable_above(effect: Effect) -> None:
    assert told(effect, 6.0, 17.284) == "with a resonance below 17.3 Hz; not testable above"


def test_a_tone_is_told_between_two_frequencies_and_is_not_testable_above_the_band() -> None:
    assert told(TONE, 0.613, 15.96) == "between 0.61 and 16 Hz; not testable above 20 Hz"


@pytest.mark.parametrize(
    ("effect", "places", "words"),
    [
        (WAVES[0], (1.5, 48.0), "at 1.5 to 48 cycles a turn; not testable above"),
        (SPRINGS[0], (6.0, 17.0), "with a resonance below 17 Hz; not testable above"),
        (TONE, (0.6, 16.0), "between 0.6 and 16 Hz; not testable above 20 Hz"),
    ],
)
def test_an_answer_not_seen_says_its_band_where_its_words_stand(
    effect: Effect, places: tuple[float, float], words: str, prepared: Prepared
) -> None:
    finding = _absent(effect.id, SeenFrom(0.1, places, 0.95, effect), ROTARY, prepared, "")
    assert finding.bound is not None
    assert (finding.answer, finding.evidence, finding.bound.reason) == ("not_seen", words, words)
    assert finding.bound.band_hz == (0.0, CUTOFF)
    member = hypothesis_of(effect).member
    assert finding.bound.range.get(member, places) == places


def test_without_a_bound_the_reason_stands_in_place_of_the_band(prepared: Prepared) -> None:
    finding = _absent("cogging", None, ROTARY, prepared, "")
    assert finding.bound is not None
    assert (finding.answer, finding.bound.value) == ("not_testable", None)
    assert finding.evidence == finding.bound.reason == "these recordings do not excite it"


def concealed(effect: Effect, prepared: Prepared, mount: Mount = ROTARY) -> list[float]:
    """Where members of a kind are concealed."""
    own, rest = hypothesis_of(effect), np.random.default_rng(1).standard_normal(len(prepared.recording_of))
    tried = [one for one in candidates(mount, prepared, rest, np.ones_like(rest)) if one.effect == effect.id]
    span = span_of(mount, prepared, rest, np.ones_like(rest))
    return [float(getattr(one.instances[0], own.member)) for one in own.concealed(mount, span, tried)]


def test_what_is_said_to_be_testable_ends_where_the_band_does(prepared: Prepared) -> None:
    """At 2 rad/s eight tenths of 20 Hz are 50.3 cycles a turn, or 8 a radian; a tone ends at 16 Hz."""
    assert max(concealed(WAVES[0], prepared)) == pytest.approx(0.8 * CUTOFF * 2 * np.pi / SPEED, rel=0.01)
    assert max(concealed(WAVES[1], prepared)) == pytest.approx(0.8 * CUTOFF * 2 * np.pi / SPEED, rel=0.01)
    assert max(concealed(TONE, prepared)) == pytest.approx(0.8 * CUTOFF)
