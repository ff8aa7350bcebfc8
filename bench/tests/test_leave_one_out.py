"""What the diagnosis cannot name is unknown: an effect found by its name, and the same without that name."""

import leave_one_out
import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.effects.candidates import Candidate
from cosim.diagnosis.evidence.comparison import Screened
from cosim.diagnosis.search import stages as search
from cosim.diagnosis.terms.dictionary import dictionary
from cosim.estimation.prepare import prepare
from cosim_studies.proof.generator import make_case, to_toml
from cosim_studies.proof.outside import SHAPED
from pyfmi_models.card import parse_card
from pyfmi_models.effects import ActuatorLag


def recorded(effect: str, seed: int) -> list[Recording]:
    made = make_case(seed, [effect], duration=12.0, rate_hz=500)
    frames = [*made.train, made.heldout]
    return [Recording(f"run_{k}", {n: f[n].to_numpy(float) for n in f.columns}) for k, f in enumerate(frames)]


def test_a_cogging_that_has_no_name_is_unknown() -> None:
    """With its name it is named: test_ledger.py."""
    card = parse_card(to_toml(make_case(3, ["cogging"], duration=12.0, rate_hz=500).card), "card.toml")
    *train, held = recorded("cogging", 3)
    with leave_one_out.left_out("cogging"):
        verdict = diagnose(train, [held], card).diagnosis.verdict
    assert leave_one_out.kind(" + ".join(verdict)) == "unknown"
    assert "cogging" not in verdict


def test_what_is_left_out_does_not_come_back_as_a_twin() -> None:
    lag = ActuatorLag(time_constant_ms=2.0)
    screened = [Screened(Candidate("actuator_lag", (lag,), (), lambda _: lag), 10.0, 0.5, np.ones(1))]
    assert {effect.id for effect, _ in search.starts(screened, POLICY)} == {"actuator_lag", "delay"}
    with leave_one_out.left_out("delay"):
        assert {effect.id for effect, _ in search.starts(screened, POLICY)} == {"actuator_lag"}


def test_the_shapes_that_are_left_out_are_in_the_dictionary() -> None:
    assert set(leave_one_out.SHAPES) == set(SHAPED)
    prepared = prepare(recorded("thermal_tilt", 3)[:2], 10.0)
    assert {name for terms in leave_one_out.SHAPES.values() for name in terms} <= set(dictionary(prepared))
    for effect, terms in leave_one_out.SHAPES.items():
        with leave_one_out.left_out(effect):
            left = set(leave_one_out.scores.dictionary(prepared))
        assert left == set(dictionary(prepared)) - set(terms)


@pytest.mark.parametrize(
    ("answer", "amounts_to"),
    [
        ("unknown", "unknown"),
        ("unknown + delay", "unknown"),
        ("delay + unknown", "name and unknown"),
        ("delay + backlash", "name"),
        ("none", "none"),
    ],
)
def test_answers_are_counted_by_what_they_amount_to(answer: str, amounts_to: str) -> None:
    assert leave_one_out.kind(answer) == amounts_to
