"""Any team's FMU takes a place in a scenario: its own names and units behind ours."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foreign_fmu import foreign
from small_loop import TEXT, text_of
from tiny_fmu import described, description

from cosim.fmi.description import describe
from cosim.fmi.variables import ports_of, variables_of
from cosim.master.simulate import run
from cosim.support.errors import FmuError, ScenarioError, WiringError
from cosim.system.scenario import parse_scenario

MAPPING = 'variables = { a = "Motor.torque", b = "Brake.torque", y = "Encoder.angle" }'


def scenario(plant: str, folder: Path, tiny: dict[int, Path]):
    """The loop of the scenario tests with another plant."""
    text = TEXT.replace('fmu = "tiny3.fmu"', plant).replace('"tiny2.fmu"', f'"{tiny[2]}"')
    return parse_scenario(text, "loop.toml", folder)


@pytest.mark.parametrize("version", [2, 3])
def test_a_foreign_plant_behind_our_names_gives_the_same_bits(
    version: int, tiny: dict[int, Path], tmp_path: Path
) -> None:
    foreign(tiny[version], tmp_path / "theirs.fmu")
    ours = run(scenario(f'fmu = "{tiny[version]}"\nparameters = {{ k = 2.0, b = 0.1 }}', tmp_path, tiny))
    plant = f'fmu = "theirs.fmu"\n{MAPPING}\nparameters = {{ "Gain[1]" = 2.0, b = 0.1 }}'
    theirs = run(scenario(plant, tmp_path, tiny))
    assert list(ours.recording) == list(theirs.recording)
    for name in ours.recording:
        np.testing.assert_array_equal(theirs.recording[name], ours.recording[name])
    assert theirs.statistics["loop"] == ours.statistics["loop"]
    assert theirs.recording.origin["components"]["plant"]["variables"]["y"] == "Encoder.angle"


def scale(mapping: str, folder: Path, tiny: dict[int, Path]) -> float:
    """By what an angle grows on its way through our names, before the loop has closed."""
    plants = (f'fmu = "theirs.fmu"\n{mapping}', f'fmu = "{tiny[2]}"')
    texts = [f"{plant}\nparameters = {{ mode = 1.0 }}" for plant in plants]
    theirs, ours = (run(replace(scenario(text, folder, tiny), ticks=20)).recording["q"] for text in texts)
    row = np.flatnonzero(ours)[0]
    return theirs[row] / ours[row]


@pytest.mark.parametrize(("unit", "factor"), [("", 1.0), ("rad", 1.0), ("deg", 180 / np.pi)])
def test_a_unit_that_the_model_does_not_state_is_given_with_the_name(
    tiny: dict[int, Path], tmp_path: Path, unit: str, factor: float
) -> None:
    foreign(tiny[2], tmp_path / "theirs.fmu", a="")
    mapping = MAPPING.replace('"Motor.torque"', f'{{ name = "Motor.torque", unit = "{unit}" }}')
    assert scale(mapping, tmp_path, tiny) == pytest.approx(factor, rel=1e-7)


def test_units_that_only_the_model_knows_are_read_from_its_definitions(tiny: dict[int, Path], tmp_path: Path) -> None:
    turns = '<Unit name="turns"><BaseUnit rad="1" factor="6.283185307179586"/></Unit><Unit name="u"/>'
    torque = '<Unit name="SI"><BaseUnit kg="1" m="2" s="-2"/></Unit>'
    ports = ports_of(describe(foreign(tiny[2], tmp_path / "theirs.fmu", turns + torque, a="turns", b="SI")))
    assert ports["Motor.torque"].unit == "6.283185307179586 rad"
    assert ports["Brake.torque"].unit == "kg.m2.s-2"
    assert scale(MAPPING, tmp_path, tiny) == pytest.approx(1 / (2 * np.pi), rel=1e-7)


def test_a_second_name_that_fmi_3_gives_a_variable_is_that_variable(tiny: dict[int, Path], tmp_path: Path) -> None:
    """Wired and recorded by its alias: the same bits as by its name."""
    alias = r'\1><Alias name="Encoder.angle" description="on the shaft"/></Float64>'
    path = described(tiny[3], tmp_path / "theirs.fmu", re.sub(r'(<Float64 name="y"[^>]*)/>', alias, description(3)))
    told = describe(path)
    ports, listed = ports_of(told), [one.name for one in variables_of(told)]
    assert replace(ports["Encoder.angle"], description="") == replace(ports["y"], name="Encoder.angle")
    assert listed.count("Encoder.angle") == listed.count("y") == 1, "some releases of FMPy list it twice"
    found = []
    for name in ("y", "Encoder.angle"):
        text = TEXT.replace("plant.y", f"plant.{name}").replace("tiny3.fmu", str(path))
        found.append(run(parse_scenario(text.replace("tiny2.fmu", str(tiny[2])), "loop.toml", tmp_path)).recording)
    assert list(found[0]) == list(found[1])
    for column in found[0]:
        np.testing.assert_array_equal(found[0][column], found[1][column])


WRONG = {
    'variables = { a = "Motor.torqe" }': '"plant.a" stands for "Motor.torqe", which does not exist; names like it are',
    'variables = { mode = "Motor.torque" }': '"plant.mode" stands for "Motor.torque", but there is a "mode" already;',
    'variables = { a = "Motor.torque", b = "Motor.torque" }': '"Motor.torque" of plant has two names in its variables',
    'variables = { a = { name = "Motor.torque", unit = "deg" } }': '"plant.a" is in rad, as its model says, and',
    'variables = { a = { name = "Motor.torque", unit = "dag" } }': '"plant.a": "dag" is no unit known here',
    'variables = { b = "Motor.torque" }': '"plant.a" cannot be fed: it does not exist; inputs of plant are: b, Brake',
}


@pytest.mark.parametrize("plant", WRONG)
def test_a_wrong_name_or_unit_is_one_sentence(plant: str, tiny: dict[int, Path], tmp_path: Path) -> None:
    foreign(tiny[2], tmp_path / "theirs.fmu")
    with pytest.raises(WiringError, match=WRONG[plant]) as raised:
        run(scenario(f'fmu = "theirs.fmu"\n{plant}', tmp_path, tiny))
    assert str(raised.value).count("\n") == 0


def test_a_mistake_in_the_mapping_names_key_and_choices(tiny: dict[int, Path], tmp_path: Path) -> None:
    said = r'"components.plant.variables.a.units" is no key of a scenario; keys there are: name, unit'
    with pytest.raises(ScenarioError, match=said):
        scenario('fmu = "x.fmu"\nvariables = { a = { name = "b", units = "deg" } }', tmp_path, tiny)
    foreign(tiny[2], tmp_path / "theirs.fmu")
    with pytest.raises(FmuError, match=r'"plant.kk" does not exist; what can be set: .*Gain\[1\]'):
        run(scenario(f'fmu = "theirs.fmu"\n{MAPPING}\nparameters = {{ kk = 1 }}', tmp_path, tiny))


def test_an_array_has_our_name_whole_and_by_element(mirror: dict[int, Path]) -> None:
    ours = {"force": "u", "reply": "y", "size": "n"}
    one = {"fmu": mirror[3], "variables": ours, "parameters": {"size": 2, "force": [3, 4]}}
    two = {"fmu": mirror[3], "variables": {"force": {"name": "u", "unit": "N"}}}
    signals = {"reply": "one.reply", "y": "two.y[1]"}
    given = {"step": 0.1, "stop": 0.4, "components": {"one": one, "two": two}, "record": {"signals": signals}}
    text = text_of({"two.force[1]": "one.reply[2]"}, **given)
    recording = run(parse_scenario(text, "x.toml", Path())).recording
    assert [recording[name][-1] for name in ("reply[1]", "reply[2]", "y")] == [3, 4, 4]
