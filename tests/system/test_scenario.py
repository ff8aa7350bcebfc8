"""A scenario file says everything about a run, and each mistake in it is one sentence; its schedule is told."""

import json
import pickle
import re
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import call
from small_loop import TEXT, text_of
from tiny_fmu import described, description

from cosim.api.show import show
from cosim.master.simulate import Options, run
from cosim.support.errors import InputError, RecordingError, ScenarioError, SignalError
from cosim.system.algorithm import Energy, Iterated
from cosim.system.diagram import draw
from cosim.system.ports import PortRef
from cosim.system.scenario import parse_scenario, read_scenario, shipped_scenarios
from cosim.system.wire import Record, Wire


def test_a_scenario_is_read_as_written(tmp_path: Path) -> None:
    (tmp_path / "loop.toml").write_text(TEXT)
    scenario = read_scenario(tmp_path / "loop.toml")
    assert (scenario.name, scenario.step, scenario.ticks, scenario.stop) == ("loop", 1e-3, 500, 0.5)
    assert scenario.decimation == 2
    assert scenario.components["plant"].fmu == tmp_path / "tiny3.fmu"
    assert scenario.wires[1] == Wire("plant.y", "controller.b", gain=2.0, quantum=1e-6, noise="n")
    assert scenario.records["tau"] == Record("plant.a", "mean")


def test_a_scenario_runs_and_its_text_is_in_the_recording(tiny: dict[int, Path], tmp_path: Path) -> None:
    scenario = parse_scenario(TEXT, "loop.toml", tiny[2].parent)
    first, second = (run(scenario, Options(tmp_path / f"{number}.parquet")) for number in (1, 2))
    assert first.recording.columns == ("t", "q", "tau", "q_d")
    assert len(first.recording) == 250
    assert first.recording.origin["scenario"] == TEXT
    for name in first.recording:
        np.testing.assert_array_equal(first.recording[name], second.recording[name])


def test_a_list_of_signals_names_its_own_columns_and_an_algorithm_may_be_a_word() -> None:
    text = re.sub(r"signals = \{ q.*", 'signals = ["plant.y", "r.velocity"]\nmode = "mean"', TEXT)
    found = parse_scenario(text.replace("step = 1e-3", 'step = 1e-3\nalgorithm = "iterated"', 1), "loop.toml", Path())
    assert found.algorithm.kind == "iterated"
    assert found.records == {"plant.y": Record("plant.y", "mean"), "r.velocity": Record("r.velocity", "mean")}


RATES = TEXT.replace("k = 5.0 }", "k = 5.0 }\nstep = 0.01").replace(
    "[components.plant]", '[algorithm]\nkind = "gauss-seidel"\norder = ["controller", "plant"]\n[components.plant]'
)


def test_algorithm_and_steps_are_read_and_kept_in_the_recording(tiny: dict[int, Path], tmp_path: Path) -> None:
    scenario = parse_scenario(RATES, "loop.toml", tiny[2].parent)
    assert (scenario.every, scenario.algorithm.kind) == ({"controller": 10}, "gauss-seidel")
    assert parse_scenario(RATES.replace("step = 0.01", "every = 10"), "loop.toml", Path()).every == {"controller": 10}
    done = run(scenario, Options(tmp_path / "run.parquet"))
    assert done.recording.origin["algorithm"] == {"kind": "gauss-seidel", "order": ["controller", "plant"]}
    assert done.recording.origin["every"] == {"controller": 10}
    assert len(set(done.recording["q"])) > 200  # the plant goes on between the commands


def test_the_wiring_is_drawn_with_its_delays() -> None:
    lines = draw(parse_scenario(RATES, "loop.toml", Path()))
    assert "└─ y ─────────▶ plant.a       9 to 18 ticks, 9 to 18 ms" in lines
    assert "└─ y ─────────▶ controller.b  1 tick, 1 ms; x 2; quantum 1e-06; + n" in lines
    assert lines[-1] == "round plant → controller → plant: 10 to 19 ticks, 10 to 19 ms"


def test_the_reference_of_the_paper_is_shipped() -> None:
    assert "sidereal" in shipped_scenarios()
    scenario = read_scenario("sidereal")
    velocity = scenario.signals["reference"].stream(scenario.step)(np.arange(scenario.ticks))[1]
    np.testing.assert_allclose(velocity[25_000:].max(), 5 * 7.268e-5, rtol=1e-6)
    assert (scenario.ticks, scenario.step) == (150_000, 1e-4)
    assert {one.part for one in scenario.components.values()} == {"plant", "controller"}


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("stop = 0.5", "stop = 0.5\nstp = 1", 'loop.toml: "stp" is no key of a scenario; keys there are: name'),
        ('fmu = "tiny3.fmu"', 'fmuu = "x"', '"components.plant.fmuu" is no key of a scenario; keys there are: fmu'),
        ("seed = 7", "seed = 7\nrate = 1", '"signals.n.noise.rate" is no key of a scenario; keys there are: unit'),
        ("gain = 2.0", "gian = 2.0", '"connections.1.gian" is no key of a scenario; keys there are: from, to, gain,'),
        ("decimation = 2", "decimate = 2", '"record.decimate" is no key of a scenario; keys there are: signals'),
        ("stop = 0.5\n", "", 'loop.toml: "stop" is missing.'),
        ("stop = 0.5", "stop = -0.5", "loop.toml: stop = -0.5 breaks a rule: input should be greater than 0."),
        ("stop = 0.5", "stop = 0.50005", "loop.toml: stop = 0.50005 is not a whole number of steps of 0.001 s."),
        ("decimation = 2", "decimation = 0", "record.decimation = 0 breaks a rule: input should be greater than or"),
        ('fmu = "tiny3.fmu"', 'card = "x"', 'components.plant breaks a rule: give fmu = "...", or card = "..." with'),
        ('kind = "noise"', 'kind = "nose"', "signals.n breaks a rule: 'kind' 'nose' is none of '"),
        ('kind = "noise"', "", "signals.n breaks a rule: it needs a 'kind'."),
        ('name = "loop"', "name = 7", "loop.toml: name = 7 breaks a rule: it must be text in quotes."),
        ("[components.plant]", "[components]\nhead = 7\n[components.plant]", "components.head = 7 breaks a rule: it"),
        ("amplitude = 0.1", "", "signals.r.sine breaks a rule: give either amplitude or max_velocity."),
        ("step = 1e-3", "step = ", "loop.toml is not valid TOML: "),
        # of an algorithm, or the step of a component
        ("step = 0.01", "step = 0.0105", "components.controller.step = 0.0105 is not a whole number of steps of 0.001"),
        ("step = 0.01", "step = 0.01\nevery = 10", "components.controller breaks a rule: give either every or step."),
        ("step = 0.01", "every = 0", "components.controller.every = 0 breaks a rule: input should be greater than or"),
        ('"gauss-seidel"', '"gauss"', "algorithm breaks a rule: 'kind' 'gauss' is none of 'jacobi', "),
        ("order =", "ordre =", '"algorithm.gauss-seidel.ordre" is no key of a scenario; keys there are: kind, order.'),
        ('["controller", "plant"]', '["plant"]', "loop.toml: The Gauss-Seidel order names plant; it must name each"),
    ],
)
def test_a_mistake_in_a_scenario_is_one_sentence(old: str, new: str, sentence: str) -> None:
    text = TEXT if old in TEXT else RATES
    assert old in text
    with pytest.raises(ScenarioError, match=re.escape(sentence)):
        parse_scenario(text.replace(old, new), "loop.toml", Path())


def test_a_scenario_that_is_not_there_is_met_with_those_that_are(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"none: no such scenario; a scenario is a \.toml or \.ssp .*sidereal"):
        read_scenario("none")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(ScenarioError, match=r"binary.toml is no scenario: it is not UTF-8 text."):
        read_scenario(tmp_path / "binary.toml")


def test_a_component_made_from_a_card_needs_its_fmu_first() -> None:
    with pytest.raises(ScenarioError, match='sidereal: the component "mount" has no FMU yet; `cosim run` builds it'):
        run(read_scenario("sidereal"))


def test_a_replayed_recording_is_found_beside_the_scenario(tiny: dict[int, Path], tmp_path: Path) -> None:
    noise, replay = 'kind = "noise"\nrms = 1e-3\nseed = 7', 'kind = "recorded"\nfile = "night.csv"\ncolumn = "load"'
    text = TEXT.replace(noise, replay).replace('"tiny', f'"{tiny[2].parent}/tiny')
    (tmp_path / "loop.toml").write_text(text)
    scenario = read_scenario(tmp_path / "loop.toml")
    with pytest.raises(RecordingError, match=re.escape(f"{tmp_path / 'night.csv'} does not exist.")):
        run(scenario)
    (tmp_path / "night.csv").write_text("t,q\n0,1\n1,2\n")
    with pytest.raises(SignalError, match=r'night.csv has no column "load" to replay; it has: t, q.'):
        run(scenario)


def test_what_a_scenario_does_not_say_of_its_algorithm_stays_as_it_is() -> None:
    """Runs in use must not change with the next version: an iteration to rounding, of second order; a step's energy."""
    iterated = Iterated(kind="iterated").model_dump()
    assert iterated == {"kind": "iterated", "components": (), "tolerance": 1e-9, "max_iterations": 50, "theta": 0.5}
    energy = Energy(kind="energy", bonds=(("a.torque", "b.speed"),)).model_dump()
    assert (energy["tolerance"], energy["max_pieces"]) == (1e-5, 64)


# A reference to a port is one type with one reader, from a scenario's text to the plan.


@pytest.mark.parametrize(
    ("text", "owner", "port"),
    [("plant.q", "plant", "q"), ("plant.bristle.z[1]", "plant", "bristle.z[1]"), ("n", "n", ""), ("a.", "a", "")],
)
def test_a_reference_is_its_text_and_its_two_parts(text: str, owner: str, port: str) -> None:
    found = PortRef(text)
    assert (found, found.owner, found.port, found.parts) == (text, owner, port, (owner, port))
    assert {found: 1}[text] == 1
    assert json.dumps([found]) == json.dumps([text])


def test_wires_and_records_take_texts_and_hold_references() -> None:
    wire = Wire("controller.tau", "plant.tau", gain=2.0)
    assert (wire.source.owner, wire.target.port) == ("controller", "tau")
    assert replace(wire, source="other.tau").source.owner == "other"
    assert asdict(wire)["target"] == "plant.tau"
    assert pickle.loads(pickle.dumps(wire)) == wire
    assert Record("plant.q").signal.parts == ("plant", "q")
    assert repr(Record("q")) == "Record(signal='q', mode='sample')"
    with pytest.raises(TypeError, match="target"):
        Wire("controller.tau")  # type: ignore[call-arg]


# `cosim show SCENARIO --schedule` tells the order in a step, how old inputs are, and what FMUs offer besides.


def scenario(folder: Path, fmu: Path, every: int = 1, **algorithm: Any) -> str:
    both = {"mass": {"fmu": fmu}, "spring": {"fmu": fmu, "every": every}}
    given = {"name": "loop", "step": 0.1, "stop": 2.0, "components": both, "record": {"signals": ["mass.y"]}}
    path = folder / "loop.toml"
    path.write_text(
        text_of({"mass.b": "spring.y", "spring.a": "mass.y"}, **given, algorithm={"kind": "jacobi"} | algorithm)
    )
    return str(path)


def test_jacobi_gathers_all_before_any_steps_and_values_are_a_step_old(tiny: dict[int, Path], tmp_path: Path) -> None:
    tables = show(scenario(tmp_path, tiny[3]), schedule=True).tables
    told = [(row["stage"], row["what"], row["component"]) for row in tables["order"]]
    assert (told[0], told[-1]) == ((1, "take their inputs", "mass"), (2, "step", "spring"))
    assert {row["age"] for row in tables["inputs"]} == {"1 tick, 100 ms"}
    assert {row["over the step"] for row in tables["inputs"]} == {"held"}


def test_gauss_seidel_hands_on_what_is_new(tiny: dict[int, Path], tmp_path: Path) -> None:
    file = scenario(tmp_path, tiny[3], kind="gauss-seidel", order=["spring", "mass"])
    tables = show(file, schedule=True).tables
    assert [row["component"] for row in tables["order"]] == ["spring", "spring", "mass", "mass"]
    ages = {row["input"]: row["age"] for row in tables["inputs"]}
    assert ages == {"mass.b": "at once", "spring.a": "1 tick, 100 ms"}


def test_a_slower_component_says_when_it_looks_and_when_it_shows(tiny: dict[int, Path], tmp_path: Path) -> None:
    tables = show(scenario(tmp_path, tiny[3], every=4), schedule=True).tables
    when = [row["when"] for row in tables["order"] if row["component"] == "spring"]
    assert when == ["in the first of 4 steps (0.4 s)", "in the last of 4 steps (0.4 s)"]


PIECES = "extrapolated to the middle of each of up to 64 pieces"


@pytest.mark.parametrize(
    ("algorithm", "told"),
    [
        ({"kind": "iterated"}, "held at 0.5 of its start + 0.5 of its end"),
        ({"kind": "energy", "bonds": [["mass.y", "spring.y"]]}, PIECES),
    ],
)
def test_coupled_inputs_say_what_they_are_over_the_step(
    algorithm: dict[str, Any], told: str, tiny: dict[int, Path], tmp_path: Path
) -> None:
    tables = show(scenario(tmp_path, tiny[3], **algorithm), schedule=True).tables
    assert {row["over the step"] for row in tables["inputs"]} == {told}


def test_what_an_fmu_offers_and_nobody_uses_is_told(tiny: dict[int, Path], tmp_path: Path) -> None:
    marks = 'hasEventMode="true" mightReturnEarlyFromDoStep="true" providesIntermediateUpdate="true" modelIdentifier'
    rich = described(tiny[3], tmp_path / "rich.fmu", description(3).replace("modelIdentifier", marks, 1))
    (first, _) = show(scenario(tmp_path, rich), schedule=True).tables["offered"]
    assert first["offered, not used"] == "event mode, early return by itself, intermediate update"
    (plain, _) = show(scenario(tmp_path, tiny[2]), schedule=True).tables["offered"]
    assert plain["offered, not used"] == "nothing"


def test_the_command_prints_tables_and_json(capsys: pytest.CaptureFixture[str]) -> None:
    for more in ([], ["--json"]):
        assert call("show", "sidereal", "--schedule", *more) == 0
    out = capsys.readouterr().out
    assert "take their inputs" in out
    assert json.loads(out[out.index("{") :])["order"][0]["component"] == "mount"


@pytest.mark.parametrize("other", ["paper_mount", "nothing.toml"])
def test_what_has_no_schedule_is_refused_in_a_sentence(other: str) -> None:
    with pytest.raises(InputError, match=other):
        show(other, schedule=True)
