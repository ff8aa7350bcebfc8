"""Bounds of what was not seen: what is concealed at the bound is found, what is far below it is not."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bounds import Stand, case, drawn

from cosim.diagnosis.effects import candidates
from cosim.diagnosis.effects.candidates import columns_of
from cosim.diagnosis.measure.bounds import SeenFrom
from cosim.diagnosis.measure.bounds import tested as seen_from
from cosim.diagnosis.measure.concealment import Concealment, Hidden
from cosim.estimation.inverse import Inverse, stacked

CONCEALED = ("torque_offset", "cogging", "delay", "friction_asymmetry", "periodic_disturbance")


@cache
def stand() -> Stand:
    return Stand(*case(951, 20.0))


@pytest.mark.parametrize("effect", CONCEALED)
def test_what_is_concealed_at_the_bound_is_found_by_the_search(effect: str) -> None:
    assert found_at(effect, 1.0)


@pytest.mark.parametrize("effect", CONCEALED)
def test_a_tenth_of_the_bound_is_not_found(effect: str) -> None:
    assert not found_at(effect, 0.1)


def found_at(effect: str, times: float) -> bool:
    here = stand()
    bound = here.bounds[effect]
    member = next(one for one in here.members() if one.effect == effect and one.place >= bound.places[0])
    smaller = replace(bound, size=times * bound.size)
    return here.is_found(effect, drawn(member, smaller, np.random.default_rng(1), len(here.runs)))


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


def test_a_louder_rest_raises_the_bound() -> None:
    """The bound is one of this recording: with three times the rest, an offset must be larger to be seen."""
    here = stand()
    (columns,) = (one.columns for one in here.members() if one.effect == "torque_offset")
    hidden = Hidden("torque_offset", np.array([0]), np.array([1.0]), 0.0)
    size = np.array([here.bounds["torque_offset"].size])
    noise = np.random.default_rng(2).standard_normal(len(here.base.residual))
    louder = replace(here.base, residual=here.base.residual + 10 * here.base.rms * noise)
    assert Concealment(here.comparison, here.base, [columns]).is_found(hidden, size)
    assert not Concealment(here.comparison, louder, [columns]).is_found(hidden, size)


class Deaf:
    """A stand-in that finds each member from a size of its own on: the number of its only column."""

    def energy(self, hidden: Hidden, weights: np.ndarray) -> float:
        return 0.02

    def is_found(self, hidden: Hidden, weights: np.ndarray) -> bool:
        return bool(np.abs(weights).max() >= hidden.columns[0])


@pytest.mark.parametrize(("harder", "most"), [(2.0, 10.0), (20.0, 60.0)])
def test_forms_that_no_number_of_a_bound_tells_apart_share_the_hardest_ones(harder: float, most: float) -> None:
    """An even cable and one that hardens: where the one is seen twenty times later, the bound is its own."""
    cable = next(one for one in stand().members() if one.effect == "cable_wrap")
    one = replace(cable, directions=(np.ones(1), -np.ones(1)), least=0.0, most=1e9)
    pairs = [(one, Hidden("cable_wrap", np.array([found]), np.ones(1), 0.0)) for found in (1.0, harder)]
    (bound,) = seen_from(Deaf(), {"cable_wrap": pairs}).values()  # type: ignore[arg-type]
    assert harder <= bound.size < most
    assert bound.power == 1.0


@pytest.mark.parametrize(("nameless", "last"), [(9.0, 30.0), (40.0, 20.0), (30.0, 10.0)])
def test_the_bound_of_a_resonance_ends_before_what_would_not_be_called_a_spring(nameless: float, last: float) -> None:
    spring = next(one for one in stand().members() if one.effect == "compliance")
    places = (10.0, 20.0, 30.0, 40.0)
    members = [replace(spring, place=place, directions=(np.ones(1),), has_name=place != nameless) for place in places]
    hidden = Hidden("compliance", np.array([0.0]), np.ones(1), 0.0)
    (bound,) = seen_from(Deaf(), {"compliance": [(one, hidden) for one in members]}).values()  # type: ignore[arg-type]
    assert (bound.size, bound.places) == (last, (10.0, last))


def test_of_a_knee_all_that_it_takes_is_concealed() -> None:
    here = stand()
    knee = next(one for one in here.members() if one.effect == "torque_saturation")
    assert knee.instance.slope == 0.5  # type: ignore[attr-defined]
    grown = replace(here.base.mount, effects=(*here.base.mount.effects, knee.instance))
    pieces = here.problem.prepared.pieces
    needed = [stacked(Inverse(one, ()), pieces, np.zeros(0))[0] for one in (grown, here.base.mount)]
    np.testing.assert_allclose(knee.columns[:, 0], needed[0] - needed[1], atol=1e-9)
    assert np.abs(knee.columns).max() > 0.01 * np.abs(needed[1]).max()
