"""Bounds of what was not seen: what is concealed at the bound is found, what is far below it is not."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bounds import Stand, case, drawn
from wandering import axis, recorded

from cosim.diagnosis.effects import candidates, hypothesis_of
from cosim.diagnosis.effects.candidates import columns_of, span_of
from cosim.diagnosis.measure.bounds import SeenFrom, _absent
from cosim.diagnosis.measure.bounds import tested as seen_from
from cosim.diagnosis.measure.concealment import Concealment, Hidden
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Prepared, prepare
from pyfmi_models.effects import Cogging, Effect, PeriodicFriction
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance

CONCEALED = ("torque_offset", "cogging", "delay", "friction_asymmetry", "periodic_disturbance")


@cache
def stand() -> Stand:
    return Stand(*case(951, 20.0))


@pytest.mark.parametrize("effect", CONCEALED)
def test_what_is_concealed_at_the_bound_is_found_by_the_search_and_a_tenth_of_it_is_not(effect: str) -> None:
    here = stand()
    bound = here.bounds[effect]
    member = next(one for one in here.members() if one.effect == effect and one.place >= bound.places[0])
    found = [
        here.is_found(effect, drawn(member, smaller, np.random.default_rng(1), len(here.runs)))
        for smaller in (bound, replace(bound, size=0.1 * bound.size))
    ]
    assert found == [True, False]


def test_bounds_are_shares_of_the_friction_and_hold_for_what_they_say() -> None:
    bounds = stand().bounds
    assert len(bounds) >= 15
    for name, bound in bounds.items():
        assert isinstance(bound, SeenFrom)
        assert bound.size > 0, name
        assert bound.power >= 0.9, name
        assert bound.places[0] <= bound.places[1], name


def test_what_is_found_of_a_concealed_effect_is_what_screening_the_altered_recording_finds() -> None:
    """Gram matrices say the same as altering the residual and scoring it by the search's own screen."""
    here = stand()
    comparison, base = here.comparison, here.base
    tried = candidates(base.mount, here.problem.prepared, base.residual, np.abs(comparison.nuisances.level))
    (one,) = (one for one in tried if one.effect == "torque_offset")
    (columns,) = columns_of(base.mount, [one], here.problem.prepared, base.values)
    size = 2 * here.bounds["torque_offset"].size
    prior = 0.5 * np.sqrt(np.mean(here.problem.prepared.stacked("tau") ** 2)) / np.sqrt(np.mean(columns**2, axis=0))
    hidden = Hidden("torque_offset", np.array([0]), prior, 0.0)
    worth = Concealment(comparison, base, [columns]).worth(hidden, np.array([size]))
    altered = replace(base, residual=base.residual + size * columns[:, 0])
    (screened,) = comparison.score(altered, [one], [columns])
    assert worth.evidence == pytest.approx(screened.evidence, rel=0.1)
    assert worth.plain == pytest.approx(screened.plain, rel=1e-6)


@pytest.mark.parametrize(("harder", "most"), [(2.0, 10.0), (20.0, 60.0)])
def test_forms_that_no_number_of_a_bound_tells_apart_share_the_hardest_ones(harder: float, most: float) -> None:
    """An even cable and one that hardens: where the one is seen twenty times later, the bound is its own."""
    cable = next(one for one in stand().members() if one.effect == "cable_wrap")
    one = replace(cable, directions=(np.ones(1), -np.ones(1)), least=0.0, most=1e9)
    pairs = [(one, Hidden("cable_wrap", np.array([found]), np.ones(1), 0.0)) for found in (1.0, harder)]
    deaf: Any = SimpleNamespace(energy=lambda *_: 0.02, is_found=lambda hid, size: np.abs(size).max() >= hid.columns[0])
    (bound,) = seen_from(deaf, {"cable_wrap": pairs}).values()
    assert harder <= bound.size < most
    assert bound.power == 1.0


def test_of_a_knee_all_that_it_takes_is_concealed() -> None:
    here = stand()
    knee = next(one for one in here.members() if one.effect == "torque_saturation")
    assert knee.instance.slope == 0.5  # type: ignore[attr-defined]
    grown = replace(here.base.mount, effects=(*here.base.mount.effects, knee.instance))
    pieces = here.problem.prepared.pieces
    needed = [stacked(Inverse(one, ()), pieces, np.zeros(0))[0] for one in (grown, here.base.mount)]
    np.testing.assert_allclose(knee.columns[:, 0], needed[0] - needed[1], atol=1e-9)
    assert np.abs(knee.columns).max() > 0.01 * np.abs(needed[1]).max()


# Where a number says where an effect sets in, the bound is the last member that is found before one that is not.


def bound(easiest: int, found: dict[float, bool], nameless: tuple[float, ...] = ()) -> Any:
    """The bound over members at places, of which some are found in both ways in which they can be concealed."""
    members = [
        (SimpleNamespace(easiest=easiest, place=at, has_name=at not in nameless, directions=(1, -1), instance=at), at)
        for at in found
    ]
    concealment: Any = SimpleNamespace(is_found=lambda at, way: found[at] or way < 0)
    return seen_from(concealment, {"kind": members}).get("kind")  # type: ignore[dict-item]


@pytest.mark.parametrize(("easiest", "last"), [(-1, 20.0), (1, 30.0)])
def test_members_that_are_easier_to_find_come_first_and_the_last_found_is_left_out(easiest: int, last: float) -> None:
    """A stiff spring shows at low frequencies, a play where it is wide; what is not found ends it."""
    places = [30.0, 10.0, 40.0, 20.0, 50.0]
    seen = bound(easiest, {at: at < 35 if easiest < 0 else at > 15 for at in places})
    assert seen.size == last
    assert seen.places == ((10.0, 20.0) if easiest < 0 else (30.0, 50.0))
    assert (seen.power, seen.instance) == (1.0, 10.0 if easiest < 0 else 50.0)


def test_one_that_is_found_alone_is_the_bound_and_none_has_none() -> None:
    assert bound(-1, {10.0: True, 20.0: False, 30.0: True}).size == 10.0
    assert bound(-1, {10.0: False, 20.0: True}) is None
    assert bound(1, {10.0: True, 20.0: True}, nameless=(20.0,)) is None, "it would not be given its name"


# What a bound says of itself: for which members of its kind it holds, and where the band ends its knowledge.

WAVES = (
    Cogging(cycles_per_rev=9.0, amplitude=0.1),
    PeriodicFriction(cycles_per_rev=9.0, relative_amplitude=0.1),
)
SPRING = Compliance(antiresonance_hz=9.0, resonance_hz=11.0)
TONE = PeriodicDisturbance(frequency_hz=9.0, amplitude=0.1)
CUTOFF, SPEED = 20.0, 2.0


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    """An axis that goes to and fro at one speed, 10 rad each way."""
    t = np.arange(4000) / 200
    q = 10 - np.abs(SPEED * t % 20 - 10)
    return prepare([recorded(np.sign(np.gradient(q)), t, q)], CUTOFF)


@pytest.mark.parametrize(
    ("effect", "places", "words"),
    [
        (WAVES[0], (1.5, 48.0), "at 1.5 to 48 cycles a turn; not testable above"),
        (SPRING, (6.0, 17.0), "with a resonance below 17 Hz; not testable above"),
        (TONE, (0.6, 16.0), "between 0.6 and 16 Hz; not testable above 20 Hz"),
    ],
)
def test_an_answer_not_seen_says_its_band_where_its_words_stand(
    effect: Effect, places: tuple[float, float], words: str, prepared: Prepared
) -> None:
    finding = _absent(effect.id, SeenFrom(0.1, places, 0.95, effect), axis(), prepared, "")
    assert finding.bound is not None
    assert (finding.answer, finding.evidence, finding.bound.reason) == ("not_seen", words, words)
    assert finding.bound.band_hz == (0.0, CUTOFF)
    member = hypothesis_of(effect).member
    assert finding.bound.range.get(member, places) == places


def test_without_a_bound_the_reason_stands_in_place_of_the_band(prepared: Prepared) -> None:
    finding = _absent("cogging", None, axis(), prepared, "")
    assert finding.bound is not None
    assert (finding.answer, finding.bound.value) == ("not_testable", None)
    assert finding.evidence == finding.bound.reason == "these recordings do not excite it"


@pytest.mark.parametrize(
    ("effect", "end"),
    [(WAVES[0], 0.8 * CUTOFF * 2 * np.pi / SPEED), (WAVES[1], 0.8 * CUTOFF * 2 * np.pi / SPEED), (TONE, 0.8 * CUTOFF)],
)
def test_what_is_said_to_be_testable_ends_where_the_band_does(effect: Effect, end: float, prepared: Prepared) -> None:
    """At 2 rad/s eight tenths of 20 Hz are 50.3 cycles a turn, or 8 a radian; a tone ends at 16 Hz."""
    own, rest = hypothesis_of(effect), np.random.default_rng(1).standard_normal(len(prepared.recording_of))
    level = np.ones_like(rest)
    tried = [one for one in candidates(axis(), prepared, rest, level) if one.effect == effect.id]
    members = own.concealed(axis(), span_of(axis(), prepared, rest, level), tried)
    assert max(float(getattr(one.instances[0], own.member)) for one in members) == pytest.approx(end, rel=0.01)
