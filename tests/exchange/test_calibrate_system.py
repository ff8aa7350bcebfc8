"""Numbers of a whole scenario from recordings: components, signals and wires by their addresses."""

import json

import numpy as np
import pandas as pd
import pytest
from commands import call
from motor_fmu import motor

import cosim

SCENARIO = """
name = "two motors"
step = 0.01
stop = 3.0
[components.first]
fmu = "motor3.fmu"
parameters = {{ J = {J} }}
[components.second]
fmu = "motor3.fmu"
parameters = {{ Fc = {Fc} }}
[signals.current]
kind = "sine"
amplitude = 3.0
frequency = {frequency}
[[connections]]
from = "current.position"
to = "first.i"
unit = "A"
[[connections]]
from = "first.w"
to = "second.i"
unit = "A"
gain = {gain}
[record]
signals = {{ w = "second.w", phi = "first.phi" }}
"""
TRUTH = {"J": 0.03, "Fc": 0.2, "frequency": 0.7, "gain": 1.4}
START = {"J": 0.02, "Fc": 0.1, "frequency": 0.7, "gain": 1.0}
FREE = ["first.J", "second.Fc", "second.i.gain"]


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    folder = tmp_path_factory.mktemp("system")
    motor(folder, 3)
    (folder / "start.toml").write_text(SCENARIO.format(**START))
    (folder / "truth.toml").write_text(SCENARIO.format(**TRUTH))
    table = cosim.run(folder / "truth.toml").recording.table
    random = np.random.default_rng(5)
    noisy = {name: table[name] + 0.02 * random.standard_normal(len(table["t"])) for name in ("w", "phi")}
    pd.DataFrame({"t": table["t"], **noisy}).to_csv(folder / "run.csv", index=False)
    return folder / "start.toml"


def test_numbers_of_components_and_wires_of_a_scenario_are_found(scenario, capsys):
    run, out = scenario.parent / "run.csv", scenario.parent / "out"
    arguments = ["identify", "--system", scenario, "--free", *FREE, run, "--out", out, "--workers", 1, "--starts", 1]
    assert call(*arguments) == 0, capsys.readouterr().err
    found = json.loads((out / "identified.json").read_text())["numbers"]
    for name, value in zip(FREE, (0.03, 0.2, 1.4), strict=True):
        assert abs(found[name]["value"] - value) < 3 * found[name]["standard_error"]
    assert not list(out.glob("*.fmu"))


def test_a_signal_can_be_given_by_a_column_and_its_numbers_can_be_found(scenario):
    done = cosim.identify(
        scenario.parent / "run.csv",
        system=scenario,
        free=["current.amplitude"],
        starts=1,
        workers=1,
        set={"first.J": 0.03, "second.Fc": 0.2, "second.i.gain": 1.4},
    )
    assert abs(done.numbers["current.amplitude"] - 3) < 3 * done.standard_errors["current.amplitude"]


@pytest.mark.parametrize(
    ("free", "words"),
    [
        ("first.j", 'Did you mean "first.J"'),
        ("first.i", "is an input that is fed"),
        ("J", "has no such variable"),
    ],
)
def test_a_name_that_a_system_does_not_have_is_a_sentence(scenario, free, words):
    with pytest.raises(cosim.InputError, match=words):
        cosim.identify(scenario.parent / "run.csv", system=scenario, free=[free])
