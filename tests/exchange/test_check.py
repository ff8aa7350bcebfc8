"""An FMU runs as its maker meant, or it is said by how much not; planted errors are found."""

import json
import re
import zipfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from commands import call as verb
from experiment_archives import bundle, experiments, manifest, with_files
from motor_fmu import driven, motor

import cosim
from cosim.experiments.series import Series, series_of
from cosim.fmi.component import Port
from cosim.support.errors import FmuError

T = 0.01 * np.arange(201)
CURRENT = 3 * np.sin(2 * np.pi * (0.5 + T) * T) * (T > 0.1)
CAUSES = {
    1: "the sign is the other one",
    2: "a gain of 1.05",
    3: "w is",
    4: "1 row (0.01 s) late",
    5: "an offset of 0.02",
    6: "w is",
    7: "w is",
    8: "phi is",
    9: "a gain of 57.3",
    10: "w is",
}
"""What is planted, see `motor_fmu`, and what is said of it."""
SET_OF = '<Parameters source="p.ssv"/>'
SET = '<ParameterSet xmlns="x"><Parameter name="{}"><Real value="{}"/></Parameter></ParameterSet>'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("check")


@pytest.fixture(scope="module")
def made(folder) -> dict[str, dict]:
    return {"stimulus": {"time": T, "i": CURRENT}, "reference": {"time": T, **driven(motor(folder, 3), CURRENT)}}


@pytest.fixture
def here(monkeypatch) -> None:
    """A cell that answers in this process: what an experiment says does not depend on where it runs."""
    cell = SimpleNamespace(call=lambda function, *arguments, timeout: function(*arguments), close=lambda: None)
    monkeypatch.setattr("cosim.experiments.check.Cell", lambda *_: cell)


HERE = pytest.mark.usefixtures("here")


@pytest.mark.parametrize("version", ["1.0.0-alpha.1", "1.0.0-beta.1"])
def test_an_fmu_that_runs_as_meant_passes(folder, made, version, capsys):
    fmu = with_files(motor(folder, 3), folder / f"good{version}.fmu", bundle(**made, version=version))
    assert verb("check", fmu, "--json", "--out", folder / version) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["passed"]
    assert told["standard"] == f"FMI-LS-REF {version}"
    assert {one["variable"] for one in told["experiments"][0]["variables"]} == {"w", "phi"}
    assert (folder / version / "experiment_1.svg").exists()
    assert verb("check", fmu, "--out", folder / version) == 2


@HERE
@pytest.mark.parametrize("planted", CAUSES)
def test_a_planted_error_is_found_and_said(folder, made, planted, capsys):
    fmu = with_files(motor(folder, 3, planted), folder / f"planted{planted}.fmu", bundle(**made))
    assert verb("check", fmu) == 1
    said = capsys.readouterr().out
    assert CAUSES[planted] in said
    assert "FAIL  chirp" in said


@HERE
def test_an_event_that_is_missed_is_said_with_its_time(folder, made):
    reference = dict(made["reference"])
    reference["w"] = np.where(T >= 1.2, -reference["w"], reference["w"])
    fmu = with_files(motor(folder, 3), folder / "event.fmu", bundle(made["stimulus"], reference))
    done = cosim.check(fmu)
    assert not done.passed
    assert "right up to 1.19 s and wrong from 1.2 s on" in str(done)


@HERE
def test_the_later_draft_with_its_kind_of_analysis_and_a_parameter_set_is_read(folder, made):
    inside = '<TransientSimulation startTime="0" stopTime="2" stepSize="0.01"/>'
    fmu = with_files(motor(folder, 3), folder / "later.fmu", bundle(**made, inside=inside, times=""))
    assert cosim.check(fmu).passed
    for value in (0.02, 0.05):
        files = bundle(**made, inside=SET_OF) | {"p.ssv": SET.format("J", value)}
        fmu = with_files(motor(folder, 3), folder / "set.fmu", files)
        assert cosim.check(fmu).passed == (value == 0.02)


OURS, OTHER, HDF = "application/x-ma-hs-experiments", "application/x-o", "application/x-hdf"
OF_HDF = experiments().replace("<References", f'<References type="{HDF}"')


def listing(kind: str, source: str, role: str = "experiment") -> dict[str, str]:
    return {"fmi-ls-manifest.xml": manifest((kind, source, role))}


@HERE
@pytest.mark.parametrize(
    ("options", "files", "passed", "words"),
    [
        ({"inside": "<SteadyState/>", "times": ""}, {}, True, "not run  chirp.*SteadyState"),
        ({}, listing(OTHER, "b.oth") | {"b.oth": "?"}, True, "not run  b.oth.*is of type application/x-o, and read"),
        ({"inside": SET_OF}, {"p.ssv": SET.format("jj", 0.02)}, False, 'sets "jj", which the FMU does not have'),
        ({"times": 'startTime="0" stopTime="1" stepSize="0.01"'}, {}, False, "from 0 to 2 s, and the .* from 0 to 1 s"),
        ({}, listing(OURS, "b.exp"), True, r'names "b.exp" \(experiment\), which is not in the archive'),
        ({}, {"a.exp": experiments().replace("test-ref", "nothing")}, False, "nothing.csv"),
        ({}, {"test-in.csv": "time,i\n0,nan\n2,1\n"}, False, "The stimulus has no number for i at 0 s"),
        ({}, {"test-in.csv": "time,i\n5,0\n6,1\n"}, False, "The stimulus is from 5 to 6 s, and .* from 0 to 2 s"),
        ({}, {"test-ref.csv": "time,w,w\n0,0,1\n2,1,3\n"}, False, 'has two columns "w"'),
        ({}, {"a.exp": OF_HDF}, True, "its References are of type application/x-hdf, and only text/csv is read here"),
        ({}, {"test-ref.csv": "\x89HDF\0\0"}, False, "test-ref.csv is no CSV but binary"),
        ({}, listing(HDF, "r.h5", "result") | {"r.h5": "x"}, True, "r.h5 is of type application/x-hdf, and only text"),
    ],
)
def test_what_cannot_be_meant_or_is_not_run_here_is_a_sentence(folder, made, options, files, passed, words):
    fmu = with_files(motor(folder, 3), folder / "meant.fmu", bundle(**made, **options) | files)
    done = cosim.check(fmu)
    assert re.search(words, str(done), re.DOTALL)
    assert done.passed == passed, "what is not run here fails nothing"


def test_an_fmu_without_experiments_runs_its_default_experiment(folder, capsys):
    assert verb("check", motor(folder, 2)) == 0
    said = capsys.readouterr().out
    assert "a second run after a reset gives the same bits" in said
    assert "0 to 2 s in 200 steps" in said


def test_an_fmu_that_crashes_fails_its_check(folder, made):
    files = bundle(**made, inside=SET_OF) | {"p.ssv": SET.format("crash_above", 0.001)}
    done = cosim.check(with_files(motor(folder, 3), folder / "crash.fmu", files))
    assert not done.passed
    assert "The FMU crashed" in str(done)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["nowhere.fmu"], "does not exist"),
        ([__file__], "it is not a zip archive"),
        (["."], "is no FMU: it is a folder"),
        (["motor3.fmu", "--rtol", "-1"], "--rtol"),
        (["motor3.fmu", "--interface", "both"], "--interface"),
        (["broken.fmu"], "manifest"),
        (["future.fmu"], 'FMI-LS-REF "2.0.0"; known here are: 1.0.0-alpha.1, 1.0.0-beta.1'),
    ],
)
def test_nonsense_is_a_sentence(folder, made, given, words, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    with_files(motor(folder, 3), folder / "broken.fmu", {"fmi-ls-manifest.xml": "<fmiReferences"})
    with_files(motor(folder, 3), folder / "future.fmu", bundle(**made, version="2.0.0"))
    assert verb("check", *given) == 2
    assert words in capsys.readouterr().err


# Time series in CSV as FMI's tools write them: a cell goes to its variable, and a wrong one is told with its place.

PORTS = {
    "x": Port("x", 0, "input"),
    "on": Port("on", 1, "input", type="Boolean"),
    "word": Port("word", 2, "input", type="String"),
    "a": Port("a", 3, "input", shape=(2,)),
}


def read(folder: Path, text: str) -> Series:
    with zipfile.ZipFile(folder / "a.fmu", "w") as archive:
        archive.writestr("in.csv", text)
    return series_of(folder / "a.fmu", "in.csv", PORTS)


def test_each_cell_goes_to_its_variable(tmp_path: Path) -> None:
    found = read(tmp_path, "Time,x,on,word,a,other\n0, 1.5,true,hi,1 2,9\n\n0.5,-2,false,,3 4,9\n0.5,3,1,x y,5 6,9\n")
    assert found.times.tolist() == [0.0, 0.5, 0.5]
    assert {name: values.tolist() for name, values in found.numbers.items()} == {
        "x": [1.5, -2.0, 3.0],
        "on": [1.0, 0.0, 1.0],
        "a[1]": [1.0, 3.0, 5.0],
        "a[2]": [2.0, 4.0, 6.0],
    }
    assert found.texts == {"word": ("hi", "", "x y")}
    assert found.strange == ("other",)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,x\n0,1\n", 'its first column must be "time"'),
        ("time,x\n", "is no time series"),
        ("time,x\n0,1\n2,1,3\n", "line 3 has 3 cells, and there are 2 columns"),
        ("time,x\n0,1\n1,2\n0.9,3\n", "the time must not go back"),
        ("time,x\n0,1\nlate,2\n", 'time in line 3 is "late"; it must be a number'),
        ("time,x\n0,much\n", 'x in line 2 is "much"; it must be a number'),
        ("time,a\n0,1 2\n1,1 2 3\n", "a has 2 elements, and line 3 has 3"),
        ("time,x,x\n0,1,1\n", 'two columns "x"'),
    ],
)
def test_what_is_no_series_is_refused_with_its_place(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(FmuError, match=said):
        read(tmp_path, text)
