"""What a calibration or a check wrote is shown again; pages and pictures are in the FMU's own units."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from experiment_archives import bundle, with_files
from motor_fmu import motor, recorded

import cosim
from cosim.cli import main
from cosim.support.errors import InputError

TRUTH = {"J": 0.013, "d": 0.08, "Fc": 0.16}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("again")


@pytest.fixture(scope="module")
def run(folder) -> Path:
    path = folder / "run.csv"
    pd.DataFrame(recorded(motor(folder, 3), TRUTH)).to_csv(path, index=False)
    return path


@pytest.fixture(scope="module")
def numbers(folder, run) -> Path:
    out = folder / "numbers"
    cosim.identify(run, fmu=folder / "motor3.fmu", free=[*TRUTH, "idle"], starts=1, workers=1, out=out)
    return out


def test_the_folder_of_a_calibration_is_shown(numbers):
    shown = cosim.show(numbers)
    told = json.loads((numbers / "identified.json").read_text())
    first, *_, idle = shown.tables["numbers"]
    assert float(first["value"]) == pytest.approx(told["numbers"]["J"]["value"], rel=1e-5)
    assert idle["standard error"] == "not determined"
    assert shown.tables["not determined"] == [{"sentence": "idle changes nothing that was recorded."}]
    assert [row["output"] for row in shown.tables["RMS error of each output"]] == ["w", "phi"]
    assert shown.facts["report"] == str(numbers / "report.html")


def test_the_report_says_which_numbers_hang_together_and_keeps_the_units_of_the_fmu(numbers):
    page = (numbers / "report.html").read_text()
    told = json.loads((numbers / "identified.json").read_text())
    assert abs(told["correlations"]["d"]["Fc"]) > 0.5
    assert f'<td>d</td><td>Fc</td><td class="n">{told["correlations"]["d"]["Fc"]:.3f}'.replace("-", "−") in page
    assert "<td>idle</td><td>idle</td>" not in page
    data = json.loads(re.search(r'id="recordings">(.*?)</script>', page)[1])
    assert data["recordings"][0]["titles"] == ["w [rad/s]", "difference from measured [rad/s]"]


def test_the_folder_of_a_check_is_shown_and_its_picture_has_units(folder, capsys):
    t = 0.01 * np.arange(50)
    made = bundle({"time": t, "i": 0 * t}, {"time": t, "w": 0 * t + 0.5})
    fmu = with_files(motor(folder, 2), folder / "off.fmu", made)
    done = cosim.check(fmu, folder / "checked")
    (row,) = cosim.show(folder / "checked").tables["variables"]
    assert not done.passed
    assert (row["variable"], row[""], row["largest difference"]) == ("w", "FAIL", "0.5")
    with pytest.raises(SystemExit):
        main(["show", str(folder / "checked")])
    assert "at [s]" in capsys.readouterr().out, "what stands in brackets is no markup"
    svg = (folder / "checked" / "experiment_1.svg").read_text()
    assert "w [rad/s]" in svg
    assert "difference from reference [rad/s]" in svg


@pytest.mark.parametrize("option", [{"picture": "x.svg"}, {"units": {"w": "rpm"}}, {"columns": {"w": "a"}}])
def test_options_of_recordings_are_refused_where_they_would_do_nothing(numbers, option):
    for what in (numbers, "sidereal", numbers / "motor3_identified.fmu"):
        with pytest.raises(InputError, match="is for recordings alone"):
            cosim.show(what, **option)


def test_another_value_of_an_input_that_a_column_feeds_is_refused(folder, run):
    with pytest.raises(InputError, match='--set i: the column "i" of run feeds it'):
        cosim.identify(run, fmu=folder / "motor3.fmu", free=["J"], set={"i": 3.0}, workers=1)


def test_a_folder_is_no_fmu(folder):
    with pytest.raises(cosim.CosimError, match="is no FMU: it is a folder"):
        cosim.check(folder)


def test_a_calibration_without_a_model_says_which_options_there_are(run, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["identify", "--free", "J", str(run)])
    assert ended.value.code == 2
    assert "One of --card, --fmu and --system" in capsys.readouterr().err


def test_names_of_a_schedule_are_not_broken_on_a_terminal_of_80_columns(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit):
        main(["show", "sidereal", "--schedule"])
    lines = capsys.readouterr().out.splitlines()
    assert any(line.split()[:2] == ["controller.a_d", "reference.acceleration"] for line in lines)
