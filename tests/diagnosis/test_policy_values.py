"""Constants of the policy between what was measured on either side of them, in numbers that do not move with them.

What a limit does at its edges stands in test_decision_at_its_limits.py; here is where the limits themselves lie.
"""

import pytest

from cosim.diagnosis.answer.scores import ResidualScores, TermScores
from cosim.diagnosis.decide.decision import Gain, is_left, is_validated
from cosim.diagnosis.decide.policy import POLICY, Policy
from cosim.diagnosis.search.stages import least

BETWEEN = {
    "form_ways": (12, 60),  # 60 rough machines: true names are lost at 10, a false one alone at 80
    "form": (0.05, 0.2),  # machines repeat their laws to 5 to 20 %
    "moved_prior": (0.05, 0.3),  # friction repeats to 10 to 20 %; .3 gives the same verdicts
    "small_gain": (0.1, 0.2),
    "least_bent": (24, 48),  # nulls, true contacts
    "evidence_if_large": (5, 19),  # what removes a fifth in nulls: 5 at most, or 19 and predicts nothing
    "least_above_noise": (4.1, 6.8),  # false springs, true ones
    "least_away": (0.07, 0.093),  # friction at turns, true timing
    "keep_evidence": (5, 15),  # a further wave, a first effect
    "further_share": (0.37, 0.53),  # false ones beside true ones, true ones
    "large_gain": (0.15, 0.3),
    "supported": (0.03, 0.1),  # chance in nulls, the largest share of one
    "denied": (3, 7),  # where something is missing, nulls
    "least_away_unnamed": (0.32, 0.46),  # nulls, where something is missing
    "true_beside_unknown": (0.06, 0.27),  # 5 of 38
    "large_residual": (0.118, 0.15),  # the most that 96 nulls left
    "large_residual_there": (0.118, 0.4),
    "large_residual_beside": (0.032, 0.09),  # the most that 180 nulls left
    "large_in_bursts": (0.118, 0.209),  # 267 nulls of two generators, ten trembling floors
    "large_broadband": (0.0205, 0.0885),  # 60 nulls of three worlds, twelve trembling floors
    "sure_beside_unknown": (0.89, 0.95),  # false names, true ones on two generators and two machines
}


@pytest.mark.parametrize("name", BETWEEN)
def test_a_constant_lies_between_what_was_measured(name: str) -> None:
    low, high = BETWEEN[name]
    assert low < getattr(POLICY, name) < high


def unknown(evidence: float, share: float, predicted: float = 0.0) -> bool:
    return is_left([], ResidualScores(0.0, 0.0, (TermScores("position", evidence, predicted, share),)), POLICY)


@pytest.mark.parametrize(
    ("evidence", "share", "predicted", "expected"),
    [
        (30.0, 0.06, 5.0, True),
        (30.0, 0.04, 5.0, False),  # supported by too little
        (24.0, 0.06, 5.0, False),
        (11.0, 0.35, 9.0, True),  # it predicts a third of what is left
        (9.0, 0.35, 9.0, False),
        (45.0, 0.0, 0.0, True),
        (36.0, 0.0, 0.0, False),  # a level that wanders follows anything slow by chance
        (77.0, -0.7, -20.0, False),  # of seven nulls with 31 to 77 nats two added .7 and 10 to the residual
        (77.0, 0.0, -540.0, False),  # two others lost 7 and 8 times as much
        (120.0, -0.7, -20.0, True),
    ],
)
def test_what_nulls_and_machines_with_something_unnamed_showed(
    evidence: float, share: float, predicted: float, expected: bool
) -> None:
    assert unknown(evidence, share, predicted) is expected


@pytest.mark.parametrize(
    ("gain", "share", "expected"),
    [
        (Gain(10.5, 0.1, 0.1), 0.1, True),
        (Gain(9.5, 0.1, 0.1), 0.1, False),  # ten nats of proof
        (Gain(2.5, 0.6, 0.6), 0.1, True),  # or half of the error
        (Gain(2.5, 0.3, 0.3), 0.1, False),
        (Gain(0.4, 0.36, 0.52), 0.1, False),  # a true offset; a null of another generator has 1.1 nats and .33
        (Gain(-0.4, 0.36, 0.52), 0.1, False),
        (Gain(-103.0, 0.99, 0.99), 0.1, True),  # a true inertia over position
        (Gain(-70.0, 0.74, 0.74), 0.1, False),  # another one: the price of a rule less
        (Gain(-103.0, 0.6, 0.6), 0.1, False),
        (Gain(10.0, 0.1, -0.05), 0.1, False),  # one band is worse off
        (Gain(10.0, 0.1, -0.02), 0.1, True),
        (Gain(10.0, 0.1, 0.1), 0.015, False),  # of what the base leaves a fiftieth
        (Gain(35.0, 0.1, 0.1), 0.015, True),
    ],
)
def test_what_an_effect_must_show_held_out(gain: Gain, share: float, expected: bool) -> None:
    assert is_validated(gain, share, POLICY) is expected


def is_enough(evidence: float, gain: float, policy: Policy = POLICY) -> bool:
    """Whether the first effect has what it needs in training."""
    return evidence >= least(policy, 0.0, gain)


@pytest.mark.parametrize(
    ("evidence", "gain", "expected"),
    [
        (5.0, 0.3, False),  # the most that nulls have of what removes a fifth and more
        (10.0, 0.3, True),
        (10.0, 0.1, False),
        (12.0, 0.1, False),
        (18.0, 0.1, True),
    ],
)
def test_what_the_first_effect_must_show_in_training(evidence: float, gain: float, expected: bool) -> None:
    assert is_enough(evidence, gain) is expected


@pytest.mark.parametrize(
    ("nats", "removed", "is_true"), [(9.5, 0.41, True), (11.9, 0.98, True), (3.5, 0.28, True), (6.2, 0.01, False)]
)
def test_what_held_out_recordings_hardly_notice_must_be_seen_in_their_error(
    nats: float, removed: float, is_true: bool
) -> None:
    """Of 255 names of two generators; others that were false had 7.9 nats and .12, 4.9 and .14."""
    assert is_validated(Gain(nats, removed, removed), 0.3, POLICY) is is_true
    assert not is_validated(Gain(7.9, 0.258, 0.118), 0.757, POLICY)
    assert is_validated(Gain(12.5, 0.1, 0.1), 0.609, POLICY)
