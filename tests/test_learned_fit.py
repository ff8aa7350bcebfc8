"""What has no name is learned, and delivered where it helps a recording that nothing saw."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from test_unknown import FC, Array, Extra, iron, kick, night

from cosim.data.recording import Recording
from cosim.diagnosis.comparison import Comparison
from cosim.diagnosis.deliver import as_json, deliver_quickly
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.learned.candidate_terms import candidate_terms, resolved
from cosim.diagnosis.learned.grams import columns_of, with_terms
from cosim.diagnosis.learned.learn import SURE, Learned, _judged, learn
from cosim.diagnosis.learned.select import LEAST_EVIDENCE, begun, paths
from cosim.diagnosis.policy import POLICY
from cosim.diagnosis.predictive import Predictive
from cosim.diagnosis.protocol import CUTOFF
from cosim.estimation.fit import Fit
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from pyfmi_models.card import parse_card, read_card
from pyfmi_models.effects.learned import LearnedFriction, LearnedViscous
from pyfmi_models.effects.learned_drive import LearnedDrive, LearnedGain
from pyfmi_models.effects.learned_memory import LearnedHysteresis
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

NOISE = 0.05
MOUNT = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=FC, sigma2=1.0), effects=())


def warm_place(now: dict[str, Array]) -> Array:
    """Friction that rises at one place with the temperature: a product, none of the catalogue."""
    bump = np.exp(-((now["q"] / 0.15) ** 2))
    return 0.15 * (now["temperature"] - 20) * bump * np.sign(now["v"])


def droop(now: dict[str, Array]) -> Array:
    """A drive whose torque falls behind its command, the more the more it is asked for."""
    needed = 5.0 * now["a"] + FC * np.sign(now["v"]) + now["v"]
    return 0.05 * needed * np.abs(needed)


def teeth(now: dict[str, Array]) -> Array:
    """A torque constant that waves with position."""
    needed = 5.0 * now["a"] + FC * np.sign(now["v"]) + now["v"]
    return 0.15 * needed * np.sin(25 * now["q"])


def tight(now: dict[str, Array]) -> Array:
    """Oil that is sluggish at one side."""
    return 2.0 * now["v"] * (1 + np.sin(4 * now["q"]))


def swerve(now: dict[str, Array]) -> Array:
    """Drag by speed and acceleration at once."""
    return 6.0 * np.abs(now["a"]) * now["v"]


def polish(now: dict[str, Array]) -> Array:
    """Friction that falls with the way travelled."""
    way = np.cumsum(np.abs(np.diff(now["q"], prepend=now["q"][0])))
    return FC * np.exp(-way / (0.15 * way[-1])) * np.sign(now["v"])


def nothing(now: dict[str, Array]) -> Array:
    return 0 * now["t"]


def gives(now: dict[str, Array]) -> Array:
    """A loop the wrong way round, as of a delay that feeds energy in."""
    return -0.3 * iron(now)


def wanders(now: dict[str, Array]) -> Array:
    """Large, and of another sign in each night: what was learned from two helps no third."""
    return (-1.0 if now["run"][0] == 3 else 1.0) * np.cos(20 * now["q"])


def recording(extra: Extra, seed: int) -> Recording:
    now, rng = night(seed), np.random.default_rng(100 + seed)
    tau = 5.0 * now["a"] + FC * np.sign(now["v"]) + now["v"] + extra(now) + NOISE * rng.standard_normal(6000)
    return Recording(f"night_{seed}", {n: now[n] for n in ("t", "q", "temperature")} | {"tau": tau})


@cache
def parts(extra: Extra) -> tuple[Comparison, Fit, Predictive]:
    """The refitted base on two nights, and a third that proves."""
    train, there = [recording(extra, 1), recording(extra, 2)], [recording(extra, 3)]
    prepared = prepare(train, 10.0)
    v = np.abs(prepared.stacked("v"))
    problem = Problem(MOUNT, prepared, np.asarray(v > 0.02 * v.max(), float), 0.01)
    base = problem.fit(MOUNT, 25)
    comparison = Comparison.of(problem, base, POLICY)
    return (
        comparison,
        base,
        Predictive.of(comparison, prepare(there, 10.0), base, prepare(there, CUTOFF)).as_delivered(),
    )


@cache
def tried(extra: Extra) -> Learned | None:
    return learn(*parts(extra))


def learned(extra: Extra) -> Learned | None:
    """What is delivered."""
    found = tried(extra)
    return found if found and found.helps else None


@pytest.mark.parametrize(
    ("extra", "quantity", "least"),
    [
        (warm_place, "position and temperature", 0.6),
        (droop, "torque", 0.3),
        (iron, "hysteresis over a long stroke", 0.6),
        (teeth, "torque and position", 0.5),
        (tight, "speed and position", 0.5),
        (swerve, "speed and acceleration", 0.5),
    ],
)
def test_what_has_no_name_is_modelled_and_the_held_out_error_falls(extra: Extra, quantity: str, least: float) -> None:
    found = learned(extra)
    assert found is not None
    assert found.quantities[0] == quantity
    assert 1 - found.after / found.before > least
    low, high = found.interval
    assert 0 < low < found.before - found.after < high
    assert found.sentence().startswith(f"Something that depends on {quantity}")


def test_what_fades_with_the_way_is_found_beside_the_temperature_that_rises_with_it() -> None:
    found = learned(polish)
    assert found is not None
    assert "way travelled" in found.quantities
    assert 1 - found.after / found.before > 0.5
    assert found.sentence().startswith(f"Something that depends on {', and on '.join(found.quantities)}")


def test_the_formula_of_what_was_missing_is_proposed_in_the_place_of_its_table() -> None:
    """0.15 (T - 20) exp(-(q / 0.15)^2) N m beside 2 N m of friction."""
    found = learned(warm_place)
    assert found is not None
    (said,) = found.as_json()["formula"]
    numbers = {name: one["value"] for name, one in said["parameters"].items()}
    assert said["over"] == ["position", "temperature"]
    assert "exp(−((q − centre)/width)²)" in said["equation"]
    assert numbers["width"] == pytest.approx(0.15, rel=0.1)
    assert -numbers["k1"] / numbers["k2"] == pytest.approx(20.0, abs=0.5)
    assert numbers["k2"] == pytest.approx(0.075, rel=0.15)


def test_what_a_drive_holds_back_is_told_over_the_command_that_the_model_needs() -> None:
    """Over the recorded command a line would say all: it holds what is left, and a line is a scale of the base."""
    found = learned(droop)
    assert found is not None
    assert all(one["equation"] != "not given = k1 u" for one in found.as_json()["formula"])


def test_sure_is_what_three_kinds_of_recordings_prove_each_for_itself() -> None:
    found = learned(warm_place)
    assert found is not None
    assert found.is_sure
    weak = SURE - 1
    for less in ({"evidence": (weak,)}, {"predicted": (weak,)}, {"gain": weak}, {"helps": False}):
        assert not replace(found, **less).is_sure


def test_what_is_sure_but_a_small_share_of_the_rest_or_of_a_name_does_not_say_unknown() -> None:
    found = learned(warm_place)
    assert found is not None
    assert found.says_unknown(POLICY, 0.0)
    assert not replace(found, after=0.95 * found.before).says_unknown(POLICY, 0.0)
    assert not found.says_unknown(POLICY, min(found.evidence) + 1)
    assert not replace(found, quantities=("speed",)).says_unknown(POLICY, 0.0)  # another friction law, no more


def test_the_size_of_a_term_is_that_of_what_was_missing() -> None:
    found = learned(iron)
    assert found is not None
    assert found.size == pytest.approx(1.0, rel=0.35)  # the base gives a part of its Coulomb level


@pytest.mark.parametrize("extra", [nothing, wanders])
def test_nothing_is_delivered_where_it_does_not_help(extra: Extra) -> None:
    assert learned(extra) is None


def test_no_recording_is_worse_off_than_before() -> None:
    """A night night that has less of it than the others vetoes what they propose."""
    comparison, base, _ = parts(iron)
    there = [recording(iron, 3), recording(nothing, 4)]
    held = Predictive.of(comparison, prepare(there, 10.0), base, prepare(there, CUTOFF)).as_delivered()
    found = learn(comparison, base, held)
    assert found is not None
    assert not found.helps
    assert "is not in the model" in found.sentence()


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


@pytest.mark.parametrize(("extra", "helps"), [(warm_place, True), (wanders, False)])
def test_what_removes_much_of_an_error_is_delivered_though_the_rest_is_no_likelier(
    extra: Extra, helps: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What nuisances could be is free in a likelihood, and error all the same in what is delivered."""
    comparison, base, held = parts(extra)
    terms = [
        one for one in candidate_terms(MOUNT, comparison.problem.prepared) if one.name == "position and temperature"
    ]
    monkeypatch.setattr(Predictive, "log_likelihood", lambda *_: 0.0)
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

    assert LEAST_EVIDENCE > 5
    assert paths(Scores(), range(4)) == []


def test_first_terms_that_gain_nearly_as_much_are_each_followed_and_held_out_recordings_judge() -> None:
    """The place and the temperature there go together in training: 0 and 1 gain alike, 2 a tenth."""

    class Scores:
        recordings = 2
        gains = (100.0, 90.0, 10.0)

        def marginal(self, chosen, which):
            return type("M", (), {"log_likelihood": max([0.0, *(self.gains[k] for k in chosen)])})

        def fitted(self, chosen, which):
            return chosen

        def predicted(self, chosen, beta, which):
            return self.marginal(chosen, which).log_likelihood / 2

    found = paths(Scores(), range(3))
    assert [one.order for one in begun(found)] == [(0,), (1,)]


def test_the_formula_of_a_drag_or_a_gain_is_told_in_its_own_words() -> None:
    for extra, text in ((swerve, "added drag = v f, f = k1 |a|"), (teeth, "command × (1 + f), f = k1 sin(2π(q")):
        found = learned(extra)
        assert found is not None
        (said,) = found.as_json()["formula"]
        assert said["equation"].startswith(text)
    assert learned(swerve).as_json()["formula"][0]["parameters"]["k1"]["value"] == pytest.approx(6.0, rel=0.05)


def test_a_diagnosis_says_unknown_delivers_the_term_and_its_card_holds_it(tmp_path: Path) -> None:
    text = '[mount]\nname = "axis"\ninertia = 5.0\n[friction]\nmodel = "coulomb"\nFc = 2.0\nsigma2 = 1.0\n'
    card = parse_card(text, "axis.toml")
    train, there = [recording(warm_place, 1), recording(warm_place, 2)], [recording(warm_place, 3)]
    outcome = diagnose(train, there, card)
    assert "unknown" in outcome.diagnosis.verdict
    said = as_json(outcome.diagnosis)["learned"]
    assert outcome.diagnosis.heldout.after_rms < outcome.diagnosis.heldout.before_rms
    assert said["after"] < 0.5 * said["before"]
    assert said["after"] == pytest.approx(outcome.diagnosis.heldout.after_rms, rel=1e-9)
    assert said["cutoff_hz"] == outcome.diagnosis.heldout.cutoff_hz
    assert len(said["table"]) == len(said["range"]) == len(said["quantities"])
    deliver_quickly(outcome, train, there, card, tmp_path, "cosim diagnose")
    back = read_card(tmp_path / "card.toml")
    assert back.effects == outcome.card.effects
    assert "something learned over position" in (tmp_path / "card.toml").read_text("utf-8")
    assert json.loads((tmp_path / "diagnosis.json").read_text("utf-8"))["improved"]["card"] == "card.toml"
    (proposal,) = outcome.proposals
    assert proposal.id == "proposed_friction_over_position_and_temperature"
    assert said["formula"][0]["equation"] in proposal.text()


def test_a_memory_of_reversals_is_learned_or_refused_but_never_worse() -> None:
    found = learned(kick)
    assert found is None or found.after < found.before
