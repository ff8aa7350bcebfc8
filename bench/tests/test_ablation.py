"""Stored scores are decided again with one number moved or one rule off."""

import ablation
import pytest

from cosim.diagnosis.answer.scores import EffectScores, ResidualScores, Scores, TermScores
from cosim.diagnosis.decide.policy import POLICY

TERM = TermScores("position", 40.0, 0.1)


def row(kind: str, effects: list[str], scores: Scores) -> ablation.Row:
    return {"world": "home", "number": 0, "kind": kind, "effects": effects, "scores": scores.as_json()}


def named(**margins: float) -> Scores:
    return Scores(
        [EffectScores("delay", 60.0, margins, dict.fromkeys(("delay", *margins), 0.95))], ResidualScores(0, 0)
    )


@pytest.mark.parametrize(
    ("kind", "effects", "scores", "expected"),
    [
        ("none", [], Scores([], ResidualScores(0, 0)), True),
        ("none", [], named(), False),
        ("outside", ["wind"], Scores([], ResidualScores(0, 0, (TERM,))), True),
        ("outside", ["wind"], named(), False),
        ("one", ["delay"], named(), True),
        ("one", ["cogging"], named(), False),
        ("one", ["clock_skew"], named(clock_skew=1.0), True),
        ("one", ["clock_skew"], named(clock_skew=4.0), False),
        ("several", ["delay", "cogging"], named(), True),
    ],
)
def test_what_counts_as_right(kind: str, effects: list[str], scores: Scores, expected: bool) -> None:
    assert ablation.is_right(row(kind, effects, scores), POLICY) is expected


def test_a_page_says_what_is_lost_without_a_rule() -> None:
    rows = [row("outside", ["wind"], Scores([], ResidualScores(0, 0, (TERM,)))), row("one", ["lag"], named(lag=1.0))]
    text = ablation.page(rows, "--home 1")
    assert "2 machines, home (2); 2 answers are right" in text
    for line in ("without: error follows a quantity | 1 | 0", "without: rivals | 1 | 0", "`strong` 30 → 45 | 1 | 0"):
        assert line in text
    assert "without: error in bursts | 0 | 0 | 1" in text
