"""A calibration that was ended goes on where it was, one on a cluster gives the same bits, start values can be free."""

import json
import re
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from commands import call
from experiment_archives import bundle, with_files
from motor_fmu import TRUTH, motor

import cosim
from cosim.support.errors import InputError, OutputError, SweepError
from cosim_calibration.store import Store


@pytest.fixture(scope="session")
def found(found) -> Callable[..., cosim.CalibrateResult]:
    """As elsewhere, by two processes from two starts."""
    return partial(found, starts=2, workers=2)


@pytest.fixture(scope="module")
def whole(found, table, tmp_path_factory) -> bytes:
    """What an undisturbed calibration writes."""
    out = tmp_path_factory.mktemp("whole")
    found(table, out=out)
    assert not (out / "progress").exists()
    return (out / "identified.json").read_bytes()


@pytest.fixture
def ended(found, monkeypatch) -> Callable[..., None]:
    """A calibration that is ended once some simulations are kept."""
    put = Store.put

    def end(count: int, *given, **options) -> None:
        done = []

        def until(self, *arguments):
            put(self, *arguments)
            done.append(1)
            if len(done) == count:
                raise KeyboardInterrupt

        with monkeypatch.context() as patch:
            patch.setattr(Store, "put", until)
            with pytest.raises(KeyboardInterrupt):
                found(*given, **options)

    return end


def test_one_that_was_ended_twice_comes_to_the_same_bits(found, ended, table, whole, tmp_path):
    for count in (5, 30):
        ended(count, table, out=tmp_path)
        assert not (tmp_path / "identified.json").exists()
    lines = (tmp_path / "progress" / "runs.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "progress" / "runs.jsonl").write_bytes(b"".join(lines[:-1]) + lines[-1][:9])  # as a kill leaves it
    (tmp_path / "progress" / "points" / "000002.npz").write_bytes(b"PK nothing")
    said: list[str] = []
    found(table, out=tmp_path, on_progress=said.append)
    assert "34 simulations were done before" in said
    assert (tmp_path / "identified.json").read_bytes() == whole
    assert not (tmp_path / "progress").exists()


def test_what_was_begun_with_other_recordings_is_not_mixed(found, ended, table, whole, tmp_path):
    ended(3, {**table, "w": 2 * table["w"]}, out=tmp_path)
    with pytest.raises(OutputError, match="holds another calibration: its recordings changed since"):
        found(table, out=tmp_path)
    found(table, out=tmp_path, force=True)
    assert (tmp_path / "identified.json").read_bytes() == whole


def test_a_cluster_comes_to_the_same_bits_and_a_crash_there_costs_a_point(
    fmu, found, table, whole, tmp_path, monkeypatch
):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(tmp_path / "cache"))
    gone = tmp_path / "motor3.fmu"
    shutil.copy(fmu, gone)
    settings = {"n_workers": 1, "threads_per_worker": 2, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**settings) as cluster:
        where = {"cluster": cluster.scheduler_address}
        found(table, fmu=gone, out=tmp_path / "out", **where)
        crashing = found(table, fmu=gone, set={"crash_above": 0.05}, **where)
    assert (tmp_path / "out" / "identified.json").read_bytes() == whole
    assert any("SIGSEGV" in one for one in crashing.calibrated.lost)
    with pytest.raises(SweepError, match="is no address of a Dask scheduler"):
        found(table, fmu=gone, cluster="nowhere")


def test_free_start_values_take_the_noise_of_single_readings_out_of_the_numbers(found, table):
    off = {}
    for initial in ("recorded", "free"):
        done = found(table, window=1.0, initial=initial, starts=1)
        assert all(abs(done.numbers[name] / value - 1) < 0.2 for name, value in TRUTH.items())
        off[initial] = [(done.numbers[name] - value) / done.standard_errors[name] for name, value in TRUTH.items()]
    assert np.abs(off["free"]).max() < 2.5 < np.abs(off["recorded"]).max()
    told = done.as_json()
    assert set(told["numbers"]) == set(TRUTH)
    assert len(told["initial_values"]) == 2 * 4
    assert "w at the start of recording 1 from 1 s" in told["initial_values"]
    assert json.dumps(told)


def test_a_recording_that_does_not_begin_at_the_models_start_is_followed_from_a_free_one(found, table):
    done = found({name: values[100:] for name, values in table.items()}, initial="free", starts=1)
    assert all(abs(done.numbers[name] - value) < 3 * done.standard_errors[name] for name, value in TRUTH.items())
    trace = next(one for one in done.calibrated.traces if one.output == "w")
    assert trace.rms(trace.after) < 0.022
    long = {name: np.tile(one, 4) for name, one in table.items()} | {"t": 0.01 * np.arange(1600)}
    with pytest.raises(cosim.InputError, match="400 are the most: give longer windows"):
        found(long, window=0.05, initial="free")


# What a calibration or a check wrote is shown again; pages and pictures are in the FMU's own units.


@pytest.fixture(scope="module")
def numbers(found, table, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("again") / "numbers"
    found(table, free=[*TRUTH, "idle"], starts=1, out=out)
    return out


def test_the_folder_of_a_calibration_is_shown_and_has_a_report(numbers):
    shown = cosim.show(numbers)
    told = json.loads((numbers / "identified.json").read_text())
    first, *_, idle = shown.tables["numbers"]
    assert float(first["value"]) == pytest.approx(told["numbers"]["J"]["value"], rel=1e-5)
    assert idle["standard error"] == "not determined"
    assert shown.tables["not determined"] == [{"sentence": "idle changes nothing that was recorded."}]
    assert [row["output"] for row in shown.tables["RMS error of each output"]] == ["w", "phi"]
    assert shown.facts["report"] == str(numbers / "report.html")
    # The report says which numbers hang together, and keeps the units of the FMU.
    page = (numbers / "report.html").read_text()
    assert abs(told["correlations"]["d"]["Fc"]) > 0.5
    assert f'<td>d</td><td>Fc</td><td class="n">{told["correlations"]["d"]["Fc"]:.3f}'.replace("-", "−") in page
    assert "<td>idle</td><td>idle</td>" not in page
    data = json.loads(re.search(r'id="recordings">(.*?)</script>', page)[1])
    assert data["recordings"][0]["titles"] == ["w [rad/s]", "difference from measured [rad/s]"]


def test_the_folder_of_a_check_is_shown_and_its_picture_has_units(tmp_path, capsys):
    t = 0.01 * np.arange(50)
    made = bundle({"time": t, "i": 0 * t}, {"time": t, "w": 0 * t + 0.5})
    fmu = with_files(motor(tmp_path, 2), tmp_path / "off.fmu", made)
    done = cosim.check(fmu, tmp_path / "checked")
    (row,) = cosim.show(tmp_path / "checked").tables["variables"]
    assert not done.passed
    assert (row["variable"], row[""], row["largest difference"]) == ("w", "FAIL", "0.5")
    call("show", tmp_path / "checked")
    assert "at [s]" in capsys.readouterr().out, "what stands in brackets is no markup"
    svg = (tmp_path / "checked" / "experiment_1.svg").read_text()
    assert "w [rad/s]" in svg
    assert "difference from reference [rad/s]" in svg


@pytest.mark.parametrize("option", [{"picture": "x.svg"}, {"units": {"w": "rpm"}}, {"columns": {"w": "a"}}])
def test_options_of_recordings_are_refused_where_they_would_do_nothing(numbers, option):
    for what in (numbers, "sidereal", numbers / "motor3_identified.fmu"):
        with pytest.raises(InputError, match="is for recordings alone"):
            cosim.show(what, **option)


def test_a_calibration_without_a_model_says_which_options_there_are(capsys):
    assert call("identify", "--free", "J", "run.csv") == 2
    assert "One of --card, --fmu and --system" in capsys.readouterr().err


def test_names_of_a_schedule_are_not_broken_on_a_terminal_of_80_columns(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    call("show", "sidereal", "--schedule")
    lines = capsys.readouterr().out.splitlines()
    assert any(line.split()[:2] == ["controller.a_d", "reference.acceleration"] for line in lines)
