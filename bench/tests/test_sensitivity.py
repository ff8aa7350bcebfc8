"""A replay of a case answers as a diagnosis does, and a constant that is changed changes it."""

from dataclasses import fields
from pathlib import Path

import pytest
import sensitivity

from cosim.diagnosis.decide.policy import POLICY, Policy
from cosim.diagnosis.diagnose import diagnose
from cosim_studies.proof.generator import make_case, write_given
from cosim_studies.proof.tool import given


def test_a_replay_is_a_diagnosis_by_another_policy(tmp_path: Path) -> None:
    write_given(make_case(3, ["cogging"], duration=12.0), tmp_path)
    card, train, held = given(str(tmp_path))
    replay = sensitivity.Replay(train, held, card)
    assert replay.answer(POLICY) == diagnose(train, [held], card).diagnosis.verdict == ("cogging",)
    made = len(replay.problem.made)
    assert replay.answer(POLICY) == ("cogging",)
    assert len(replay.problem.made) == made, "fits are made once"
    none = sensitivity.scaled("least_above_noise", 1e9)
    assert replay.answer(sensitivity.scaled("negligible", 100.0), "negligible") != ("cogging",)
    assert replay.answer(none, "least_above_noise") == ("cogging",), "a ripple need not stand out"
    assert replay.answer(sensitivity.scaled("coarsening", 1e-4), "coarsening") != ("cogging",)


def test_every_constant_is_scaled_and_whole_numbers_stay_whole() -> None:
    assert {*sensitivity.constants(), "version"} == {one.name for one in fields(Policy)}
    assert set(sensitivity.constants()) >= sensitivity.OF_EVIDENCE
    assert sensitivity.scaled("refitted", 0.5).refitted == 4
    assert sensitivity.scaled("bands_hz", 2.0).bands_hz == (4.0, 16.0, 64.0)
    assert sensitivity.scaled("strong", 0.5).strong == pytest.approx(15.0)


@pytest.mark.parametrize(
    ("concealed", "answer", "right"),
    [
        ("none", "none", True),
        ("none", "unknown", False),
        ("delay", "delay + unknown", True),
        ("delay", "unknown + delay", False),
        ("remanence", "unknown + delay", True),
        ("delay + cogging", "cogging + delay", True),
        ("delay + cogging", "cogging", False),
    ],
)
def test_answers_are_right_or_not(concealed: str, answer: str, right: bool) -> None:
    assert sensitivity.is_right({"concealed": concealed, "answer": answer}) is right
