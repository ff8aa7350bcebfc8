"""What was decided is decided again from the scores of a diagnosis that was written."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cosim.diagnosis.answer.scores import EffectScores, LearnedScores, ResidualScores, Scores, TermScores
from cosim.diagnosis.decide.decision import decide
from cosim.diagnosis.decide.policy import POLICY
from cosim.support.errors import InputError

EFFECT = EffectScores("cogging", 80.0, {"position_friction": 2.0, "gravity_unbalance": 41.5}, {
    "cogging": 0.7, "position_friction": 0.6, "gravity_unbalance": 0.1,
}, 12.0, 0.55)  # fmt: skip
REST = ResidualScores(0.01, 0.02, [TermScores("position", 9.25, 0.2)], "time", 0.01, (), 0.03)
LEARNED = LearnedScores(("temperature",), 400.0, 0.8, True, False)
CASES = [
    Scores([], ResidualScores(0.0, 0.0)),
    Scores([EFFECT], REST),
    Scores([EFFECT], REST, LEARNED),
    Scores([EFFECT], replace(REST, in_place=("load",), in_bursts=0.9), replace(LEARNED, is_of_law=True)),
]


@pytest.mark.parametrize("scores", CASES)
def test_stored_scores_are_decided_as_they_were(scores: Scores) -> None:
    stored = json.loads(json.dumps(scores.as_json()))
    assert decide(Scores.of_json(stored), POLICY) == decide(scores, POLICY)


def test_scores_of_an_earlier_policy_are_decided_too() -> None:
    """Up to policy 6 terms had three scores more, and nothing said whether the model improves."""
    stored = json.loads(json.dumps(CASES[2].as_json()))
    del stored["improves"]
    stored["rest"]["terms"][0] |= {"away": 0.9, "plain": 0.4, "predicted": 12.0}
    stored["learned"] |= {"away": 0.9}
    assert decide(Scores.of_json(stored), POLICY) == decide(CASES[2], POLICY)


@pytest.mark.parametrize(
    "stored", [None, [], {}, {"effects": [], "rest": {}}, {"effects": [1], "rest": {}, "learned": 0}]
)
def test_what_is_no_score_is_said_in_one_sentence(stored: Any) -> None:
    with pytest.raises(InputError, match='take what stands under "scores"'):
        Scores.of_json(stored)


def test_another_policy_may_decide_otherwise() -> None:
    stored = Scores.of_json(json.loads(json.dumps(CASES[1].as_json())))
    assert decide(stored, POLICY).sets == {"cogging": ("position_friction",)}
    assert decide(stored, replace(POLICY, fair=1.0)).sets == {"cogging": ()}


def test_the_decision_imports_no_arrays() -> None:
    text = Path(decide.__code__.co_filename).read_text("utf-8")
    assert "numpy" not in text
    assert "estimation" not in text
