"""What a learned term may be: its columns, its signs, its waves, its energy, the evidence it needs."""

from dataclasses import replace

import numpy as np
import pytest
from learned_cases import MOUNT, Array, Extra, droop, learned, parts, wanders, warm_place
from test_unknown import iron

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects.candidates import Candidate
from cosim.diagnosis.evidence.comparison import Screened
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.terms.candidate_terms import candidate_terms, resolved
from cosim.diagnosis.terms.grams import columns_of, grams_of, with_terms
from cosim.diagnosis.terms.learn import _judged
from cosim.diagnosis.terms.select import paths
from cosim.estimation.inverse import Inverse, stacked
from cosim.support.statistics import rms
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.effects.learned import LearnedFriction, LearnedViscous
from pyfmi_models.effects.learned_drive import LearnedDrive, LearnedGain
from pyfmi_models.effects.learned_memory import LearnedHysteresis


def gives(now: dict[str, Array]) -> Array:
    """A loop the wrong way round, as of a delay that feeds energy in."""
    return -0.3 * iron(now)


def test_columns_of_a_term_are_what_its_coefficients_add() -> None:
    comparison, base, _ = parts(warm_place)
    prepared = comparison.problem.prepared
    for term in candidate_terms(base.mount, prepared):
        if term.name in ("torque", "position and temperature", "hysteresis over a long stroke"):
            columns, size = columns_of(base.mount, term, prepared), 1e-4
            values = [size if k == 2 else 0.0 for k in range(term.count)]
            torques = []
            for one in (term, term.with_coefficients(values)):
                mount, _ = with_terms(base.mount, [one])
                torques.append(stacked(Inverse(mount, ()), prepared.pieces, np.zeros(0))[0])
            np.testing.assert_allclose((torques[1] - torques[0]) / size, columns[:, 2], atol=2e-3)


def test_the_effect_of_a_card_is_the_term_that_was_fitted() -> None:
    comparison, base, _ = parts(warm_place)
    prepared = comparison.problem.prepared
    for term in candidate_terms(base.mount, prepared):
        fitted = term.with_coefficients([0.01 * (k + 1) for k in range(term.count)])
        there, _ = with_terms(base.mount, [fitted])
        here = replace(base.mount, effects=(fitted.learned(fitted.coefficients.tolist()),))
        torques = [stacked(Inverse(one, ()), prepared.pieces, np.zeros(0))[0] for one in (here, there)]
        np.testing.assert_allclose(torques[0], torques[1], atol=1e-9)


def test_friction_that_is_learned_never_drives_and_a_drive_gives_more_for_more() -> None:
    for extra in (warm_place, droop):
        found = learned(extra)
        assert found is not None
        for effect in found.effects:
            assert effect.broken_rule() == ""
            assert isinstance(effect, LearnedFriction | LearnedViscous | LearnedDrive | LearnedGain)


def test_a_hysteresis_that_would_give_energy_is_not_learned() -> None:
    found = learned(gives)
    for effect in found.effects if found else ():
        assert not isinstance(effect, LearnedHysteresis) or min(effect.torque) >= 0


def test_a_column_has_no_more_waves_than_its_values_tell() -> None:
    """Two nights at two temperatures tell no bend between them."""
    two = np.concatenate([np.linspace(10, 11, 50), np.linspace(20, 21, 50)])
    assert [resolved(4, values) for values in (two, np.linspace(0, 1, 100), np.array([0, 0.3, 0.6, 1.0]))] == [1, 4, 2]


def faint(now: dict[str, Array]) -> Array:
    """An eighth of the energy that is left: a percent of the error is enough, the evidence is not there."""
    return 0.12 * warm_place(now)


@pytest.mark.parametrize(("extra", "helps"), [(warm_place, True), (wanders, False), (faint, False)])
def test_what_removes_much_of_an_error_is_delivered_though_the_rest_is_no_likelier(
    extra: Extra, helps: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What nuisances could be is free in a likelihood, and error all the same in what is delivered."""
    comparison, base, held = parts(extra)
    terms = [
        one for one in candidate_terms(MOUNT, comparison.problem.prepared) if one.name == "position and temperature"
    ]
    monkeypatch.setattr(Predictive, "likelihood_of", lambda *_: 0.0)
    found = _judged(comparison, base, terms, held)
    assert found is not None
    assert found.gain == 0.0
    assert found.helps is helps


def test_terms_need_evidence_each() -> None:
    class Scores:
        recordings = 2

        def marginal(self, chosen, which):
            return type("M", (), {"log_likelihood": 5.0 * len(chosen)})

        def fitted(self, chosen, which):
            return np.zeros(0)

        def predicted(self, chosen, beta, which):
            return 100.0 * len(chosen)

    assert POLICY.clear > 5
    assert paths(Scores(), range(4)) == []


def test_a_coefficient_that_is_a_torque_is_as_large_as_the_friction_level_and_a_share_is_one() -> None:
    """What the search takes for size one: in the unit of the torque, or relative to the level that it changes."""
    comparison, base, _ = parts(warm_place)
    prepared = comparison.problem.prepared
    terms = list(candidate_terms(base.mount, prepared))[:12]
    grams = grams_of(comparison, base, [columns_of(base.mount, one, prepared) for one in terms], terms)
    level = rms(comparison.nuisances.level)
    assert {one.in_torque for one in terms} == {True, False}
    assert level > 1.5, "of 2 N m"
    place = 0
    for one in terms:
        sizes = one.prior[one.prior > 0] * (level if one.in_torque else 1.0)
        assert grams.unit[place : place + len(sizes)] == pytest.approx(sizes)
        place += len(sizes)
    assert place == len(grams.unit)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_candidate_that_can_only_add_is_none_where_it_would_take_away(sign: float) -> None:
    """What is left is the column itself, or that upside down, which a spring cannot be."""
    comparison, base, _ = parts(warm_place)
    column = sign * base.residual[:, None]

    def scored(positive: bool) -> Screened:
        spring = Compliance(antiresonance_hz=3.0, resonance_hz=4.0)
        return comparison.score(base, [Candidate("compliance", (spring,), (), lambda _: spring, positive)], [column])[0]

    free, spring = scored(False), scored(True)
    assert np.sign(free.coefficients[0]) == np.sign(spring.coefficients[0])
    assert free.evidence > 100
    assert (spring.evidence, spring.plain) == (
        (free.evidence, free.plain) if free.coefficients[0] > 0 else (-np.inf, 0)
    )
