"""The diagnosis names what is missing, says "none" when nothing is, and proves it on data it never saw."""

import hashlib
import json
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pyarrow.parquet as pq
import pytest
from commands import call
from fmpy import read_model_description
from measured_like import read
from wandering import axis, recorded, wander

from cosim.data.signals import Sine
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.measure.experiment import Experiment, Visited
from cosim.diagnosis.measure.protocol import Structures, judge, traces
from cosim.estimation.blocks import Blocks
from cosim.estimation.prepare import Band, prepare
from cosim.support.errors import InputError
from cosim.system.scenario import read_scenario
from cosim_studies.proof.demo import demo_case
from cosim_studies.proof.generator import write_case
from pyfmi_models.card import parse_card, read_card


def test_blocks_hold_every_kept_row_once_and_know_their_recording() -> None:
    t, q, _v, a = wander(60.0)
    prepared = prepare([recorded(a, t, q), recorded(a, t, q, "two")], 30.0)
    blocks = Blocks.of(prepared)
    rows = np.concatenate(blocks.rows)
    np.testing.assert_array_equal(np.sort(rows), np.arange(len(prepared.recording_of)))
    assert all(set(prepared.recording_of[r]) == {o} for r, o in zip(blocks.rows, blocks.recording, strict=True))


def test_several_recordings_may_be_held_out() -> None:
    t, q, v, a = wander()
    pair = [recorded(5 * a + 2 * np.sign(v) + off, t, q, name) for off, name in ((0.3, "one"), (-0.3, "two"))]
    models = Structures(axis(), axis(), axis())
    judged = judge(pair, models, Band(30.0))
    each = [judge([one], models, Band(30.0)).before_rms for one in pair]
    assert judged.name == "one, two"
    assert judged.before_rms == pytest.approx(np.sqrt(np.mean(np.square(each))), rel=1e-6)
    assert [trace.heldout for trace in traces(pair[:1], pair, models)] == [False, True, True]


def test_a_measured_axis_has_direction_dependent_friction_and_a_delay() -> None:
    """Nulls, and other effects alone: the stored answers, test_net.py."""
    card = read_card("emps")
    whole = (read("emps", n, card.columns) for n in ("estimation", "validation_pulses"))
    train, held = (replace(one, table={n: x[:12_480] for n, x in one.table.items()}) for one in whole)  # two laps
    found = diagnose([train], [held], card).diagnosis
    delay = next(finding for finding in found.findings if finding.effect == "delay")
    assert {"friction_asymmetry", "delay"} <= set(found.verdict)
    assert 0.4 <= delay.parameters["delay_ms"] <= 0.9
    assert found.heldout.sliding["after_rms"] < 2.0 < 4.2 < found.heldout.sliding["before_rms"]


Printed = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("night")
    write_case(demo_case(duration=30.0), folder)
    return folder


def asked(folder: Path, out: Path, *more: str, held: str = "heldout") -> int:
    """Diagnose what lies in a folder."""
    one, two, other = (folder / f"{name}.parquet" for name in ("train_1", "train_2", held))
    return call("diagnose", one, two, "--heldout", other, "--card", folder / "card.toml", "--out", out, *more)


def valid(told: Any) -> Any:
    """A diagnosis as it was written; the schema describes it."""
    schema = json.loads((files("cosim") / "delivery" / "schema.json").read_text())
    jsonschema.Draft202012Validator(schema).validate(told)
    assert sorted(told["verdict"]) == ["cogging", "friction_asymmetry"]
    return told


def test_a_diagnosis_writes_json_page_torques_an_improved_card_and_the_next_experiment(
    folder: Path, tmp_path: Path, capsys: Printed, monkeypatch: pytest.MonkeyPatch
) -> None:
    sine = Sine(kind="sine", frequency=0.1, amplitude=0.2)
    ordered = Experiment("a slow sine", sine, 0.3, ("cogging", "backlash"), Visited(0.4, 0.3, 0.2, 0.1, 5.0, 30.0))
    monkeypatch.setattr("cosim.diagnosis.diagnose._experiment", lambda _: ordered)
    out = tmp_path / "out"
    assert asked(folder, out, "--json") == 0
    printed = valid(json.loads(capsys.readouterr().out))
    assert printed == json.loads((out / "diagnosis.json").read_text())
    assert printed["heldout"]["after_rms"] < 0.15 * printed["heldout"]["before_rms"]
    (ripple,) = [one["parameters"] for one in printed["effects"] if one["effect"] == "cogging"]
    assert ripple["cycles_per_rev"] == 20, "a refit that ends before it has settled leaves 20.8, and .18 of the error"
    first = printed["effects"][0]
    assert first["answer"] == "found"
    assert first["standard_errors"]
    assert first["where"]["axis"]
    improved = read_card(out / "card.toml")
    assert {effect.id for effect in improved.effects} == {"cogging", "friction_asymmetry"}
    assert improved.origin["recordings"][0]["sha256"]
    rows = [pq.read_table(folder / f"{name}.parquet").num_rows for name in ("train_1", "train_2", "heldout")]
    assert pq.read_table(out / "missing_torque.parquet").num_rows == sum(rows)
    assert read_scenario(out / printed["next_experiment"]["scenario"]).signals["reference"] == sine
    page = (out / "report.html").read_text()
    assert "not passive" in printed["data_quality"][0]
    assert "Notes on the card, the recordings and the search" in page
    assert "it is not passive" in page
    versions = {path.stem[-5:] == "_fmi2": read_model_description(str(path)).fmiVersion for path in out.glob("*.fmu")}
    assert versions == {False: "3.0", True: "2.0"}
    assert asked(folder, out) == 2
    assert "exists already" in capsys.readouterr().err


def test_quick_gives_the_same_answer_and_the_card_alone(folder: Path, tmp_path: Path, capsys: Printed) -> None:
    """Where a whole diagnosis lay, whose files would tell of another answer; one beside them is the user's."""
    (out := tmp_path / "quick").mkdir()
    (out / "diagnosis.json").write_text(json.dumps({"improved": {"fmu": "axis_improved.fmu"}}))
    for name in ("report.html", "missing_torque.parquet", "axis_improved.fmu", "mine.txt"):
        (out / name).write_text("before")
    assert asked(folder, out, "--quick") == 2
    assert "exists already" in capsys.readouterr().err
    assert asked(folder, out, "--quick", "--propose", str(tmp_path / "proposed"), "--force") == 0
    printed, said = capsys.readouterr()
    assert "Nothing to propose: nothing is left outside the catalogue." in said
    assert not (tmp_path / "proposed").exists()
    assert {path.name for path in out.iterdir()} == {"diagnosis.json", "card.toml", "mine.txt"}
    assert "Wrote diagnosis.json card.toml" in printed
    assert "report.html" not in printed
    told = valid(json.loads((out / "diagnosis.json").read_text()))
    assert "--quick" in told["provenance"]["command"]
    assert told["provenance"]["card"]["sha256"] == hashlib.sha256((folder / "card.toml").read_bytes()).hexdigest()
    assert not {"fmu", "scenario"} & (set(told["improved"]) | set(told["next_experiment"]))
    assert {effect.id for effect in read_card(out / "card.toml").effects} == {"cogging", "friction_asymmetry"}


def test_the_held_out_recording_must_not_be_fitted(folder: Path, tmp_path: Path, capsys: Printed) -> None:
    assert asked(folder, tmp_path / "out", held="train_1") == 2
    assert "held out" in capsys.readouterr().err


def test_a_card_with_physics_that_the_inverse_model_lacks_is_refused() -> None:
    card = parse_card(
        '[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\n'
        '[[effects]]\neffect = "quadratic_drag"\ncoefficient = 1.0\n'
        '[[effects]]\neffect = "friction_wander"\nstd = 0.1\n',
        "card.toml",
    )
    t, q, _, a = wander()
    with pytest.raises(InputError) as caught:
        diagnose([recorded(2 * a, t, q)], [recorded(2 * a, t, q, "other")], card)
    assert "The card holds friction_wander, which a diagnosis cannot take into account yet" in str(caught.value)
