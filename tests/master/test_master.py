"""The master steps FMUs together: counted time, stated delays, the same bits in C and Python, step by step too."""

import ctypes
import tempfile
import zipfile
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulating import alone, simulate
from tiny_fmu import description

import cosim
import cosim.master.execution
import cosim.master.loop
from cosim.data.recording import Recording
from cosim.fmi.fmu import FmuComponent
from cosim.master.result import RunResult
from cosim.support.errors import FmuError, OutputError, StepError, WiringError
from cosim.system.wire import Record, Wire

VERSIONS = pytest.mark.parametrize("version", [2, 3])
CONTROL = {"controller": {"mode": 1.0, "k": 5.0}}
Tiny = dict[int, Path]


def control_loop(fmu: Path, ticks: int = 500, **changes: Any) -> RunResult:
    """An integrator under proportional control, with a quantised noisy sensor."""
    wires = [
        ("controller.y", "plant.a"),
        Wire("plant.y", "controller.b", quantum=1e-3, noise="n"),
        ("r", "controller.a"),
    ]
    noise = 1e-4 * np.random.default_rng(1).standard_normal(ticks)
    settings: dict[str, Any] = {
        "record": {"q": "plant.y", "tau": Record("plant.a", "mean"), "r": "r", "sensor": "controller.b"},
        "step": 1e-3,
        "signals": {"r": 1.0, "n": noise},
        "parameters": CONTROL,
    }
    return simulate({"plant": fmu, "controller": fmu}, wires, ticks=ticks, **(settings | changes))


@pytest.mark.parametrize("decimation", [1, 2, 3, 10])
def test_fmi_2_and_3_and_the_loops_in_c_and_python_give_the_same_bits(tiny: Tiny, decimation: int) -> None:
    assert cosim.master.loop.library() is not None, "run `python cosim/master/loop/build_hook.py` first"
    cases = [(version, compiled) for version in (2, 3) for compiled in (True, False)]
    runs = [control_loop(tiny[version], compiled=compiled, decimation=decimation) for version, compiled in cases]
    assert [run.statistics["loop"] for run in runs] == ["compiled", "interpreted"] * 2
    for run in runs[1:]:
        for name in run.recording:
            np.testing.assert_array_equal(run.recording[name], runs[0].recording[name])


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("decimation", [1, 2, 3, 4, 7])
def test_a_mean_is_over_the_sample_interval_centred_at_the_row(tiny: Tiny, decimation: int, compiled: bool) -> None:
    values = np.random.default_rng(2).standard_normal(100)
    record = {"mean": Record("r", "mean"), "sample": Record("r")}
    settings: dict[str, Any] = {"decimation": decimation, "signals": {"r": values}, "compiled": compiled}
    run = alone(tiny[2], [("r", "one.a")], record, step=0.5, ticks=100, **settings)
    halves, centres = np.repeat(values, 2), 2 * decimation * np.arange(len(run.recording))
    windows = [halves[max(centre - decimation, 0) : centre + decimation] for centre in centres]
    np.testing.assert_allclose(run.recording["mean"], [window.mean() for window in windows], rtol=1e-12, atol=1e-15)
    np.testing.assert_array_equal(run.recording["sample"], values[::decimation])


def test_time_is_counted_not_summed_and_chunks_do_not_matter(tiny: Tiny, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = control_loop(tiny[3], ticks=3000)
    monkeypatch.setattr(cosim.master.execution, "CHUNK", 16)
    pieces = control_loop(tiny[3], ticks=3000)
    np.testing.assert_array_equal(whole.recording.t, np.arange(3000) * 1e-3)
    for name in whole.recording:
        np.testing.assert_array_equal(whole.recording[name], pieces.recording[name])


def test_progress_is_told_to_the_end_and_inputs_that_nothing_feeds_after_it(tiny: Tiny) -> None:
    seen: list[tuple[int, int]] = []
    told = control_loop(tiny[3], ticks=3000, on_progress=lambda done, of: seen.append((done, of))).statistics
    assert seen[-1] == (3000, 3000)
    assert len(seen) > 1
    assert told["unconnected"] == ["plant.b"]
    assert (told["steps"], told["rows"], told["notes"]) == (3000, 3000, [])


def test_a_streamed_recording_equals_the_one_in_memory_and_tells_its_origin(tiny: Tiny, tmp_path: Path) -> None:
    memory, path = control_loop(tiny[2]).recording, tmp_path / "run.parquet"
    file = control_loop(tiny[2], path=path).recording
    assert file.units == memory.units == {"t": "s", "q": "rad", "tau": "rad", "sensor": "rad"}
    assert file.origin["complete"] is True
    assert len(file.origin["components"]["plant"]["sha256"]) == 64
    assert file.origin["components"]["controller"]["parameters"] == CONTROL["controller"]
    for name in memory:
        np.testing.assert_array_equal(file[name], memory[name])
    assert [one.name for one in tmp_path.iterdir()] == ["run.parquet"]


@VERSIONS
def test_a_component_can_be_used_again_and_starts_all_over(tiny: Tiny, version: int) -> None:
    with FmuComponent(tiny[version], "plant") as plant:
        first, second = (alone(plant, [("r", "one.a")], {"y": "one.y"}, signals={"r": 1.0}) for _ in range(2))
    np.testing.assert_array_equal(first.recording["y"], second.recording["y"])


def test_without_the_compiled_loop_it_runs_in_python_and_says_so(tiny: Tiny, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cosim.master.loop, "library", lambda: None)
    statistics = control_loop(tiny[3], ticks=50).statistics
    assert statistics["loop"] == "interpreted"
    assert statistics["notes"] == [
        "The compiled loop is missing here (reinstall the package to build it): the loop ran in Python."
    ]


def test_a_loop_that_cannot_be_loaded_counts_as_missing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / f"_loop{cosim.master.loop.SUFFIX}").write_text("no library")
    monkeypatch.setattr(cosim.master.loop, "__file__", str(tmp_path / "__init__.py"))
    assert cosim.master.loop.library.__wrapped__() is None


@VERSIONS
@pytest.mark.parametrize("compiled", [True, False])
def test_a_failure_names_component_tick_time_message_and_inputs(
    tiny: Tiny, tmp_path: Path, version: int, compiled: bool
) -> None:
    parameters = CONTROL | {"plant": {"fail_at": 0.2}}
    sentence = r'plant returned an error at tick 200 \(0.2 s\); it said "the shaft broke"; its last inputs: a = '
    path = tmp_path / "run.parquet"
    with pytest.raises(StepError, match=sentence) as caught:
        control_loop(tiny[version], parameters=parameters, compiled=compiled, path=path)
    assert (caught.value.component, caught.value.tick, list(caught.value.inputs)) == ("plant", 200, ["a"])
    recording = Recording.read(path)
    assert len(recording) == 201
    assert recording.origin["complete"] is False
    with pytest.raises(StepError, match="plant gave an output that is not a finite number at tick 200"):
        control_loop(tiny[version], parameters=CONTROL | {"plant": {"nan_at": 0.2}}, compiled=compiled)


@VERSIONS
@pytest.mark.parametrize(("status", "allowed"), [(0, "TF"), (3, "F"), (4, "")])
def test_after_an_error_only_freeing_and_after_a_fatal_one_nothing_is_called(
    tiny: Tiny, version: int, status: int, allowed: str
) -> None:
    sentence = r"plant \(.*\) failed for good and cannot start again; open it anew."
    with FmuComponent(tiny[version], "plant") as plant, FmuComponent(tiny[version], "other") as other:
        both = [ctypes.CDLL(one._fmu.dll._name) for one in (plant, other)]  # kept loaded, to look into afterwards
        parameters = {"plant": {"status": float(status), "fail_at": 0.01}}
        settings: dict[str, Any] = {"record": {"y": "plant.y"}, "step": 0.01, "ticks": 5, "parameters": parameters}
        with nullcontext() if status == 0 else pytest.raises(StepError):
            simulate({"plant": plant, "other": other}, [], **settings)
        if status == 4:
            with pytest.raises(FmuError, match=sentence):
                plant.start({})
    plant_calls, other_calls = (ctypes.c_char.in_dll(one, "calls") for one in both)
    assert ctypes.string_at(ctypes.addressof(plant_calls)).decode() == allowed
    assert ctypes.string_at(ctypes.addressof(other_calls)).decode() == ("" if status == 4 else "TF")


def test_a_recording_for_which_there_is_no_room_is_refused(tiny: Tiny, tmp_path: Path) -> None:
    system, endless = (tiny[3], [], {"y": "one.y"}), {"step": 1e-4, "ticks": 10**15}
    sentence = r"16 PB are needed and /.* has .*B: the recording has 1,000,000,000,000,000 rows; record fewer signals"
    with pytest.raises(OutputError, match=sentence):
        alone(*system, **endless, path=tmp_path / "run.parquet")
    with pytest.raises(OutputError, match="16 PB are needed and memory has"):
        alone(*system, **endless)
    with pytest.raises(OutputError, match=r"2\.29 PB are needed .* the recording has 142,857,142,857,143 rows;"):
        alone(*system, **endless, decimation=7)
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_printed_and_nothing_is_left_behind(
    tiny: Tiny, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    control_loop(tiny[2], ticks=100)
    with pytest.raises(StepError):
        control_loop(tiny[3], parameters={"plant": {"fail_at": 0.0}})
    with pytest.raises(FmuError):
        FmuComponent(packed(tmp_path / "broken.fmu", tiny, library=b"no library"))
    (tmp_path / "broken.fmu").unlink()
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def packed(path: Path, tiny: Tiny, *, xml: str = "", library: bytes | None = None, platform: str = "") -> Path:
    """Pack an FMU that is wrong in one way."""
    with zipfile.ZipFile(tiny[2]) as good, zipfile.ZipFile(path, "w") as archive:
        binary = next(name for name in good.namelist() if name.startswith("binaries/"))
        folder = platform or binary.split("/")[1]
        archive.writestr("modelDescription.xml", xml or description(2))
        archive.writestr(f"binaries/{folder}/{Path(binary).name}", good.read(binary) if library is None else library)
    return path


# A scenario in hand: the same bits as a run, values read and set between steps, one sentence for what cannot be.


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("pieces", [[500], [1] * 500, [100, 1, 3, 396]])
def test_steps_of_any_length_give_the_bits_of_a_run(scenario: Path, pieces: list[int], compiled: bool) -> None:
    run = cosim.run(scenario).recording
    with cosim.open(scenario, compiled=compiled) as session:
        for ticks in pieces:
            session.step(ticks)
        assert session.tick == 500
        assert session.t == pytest.approx(0.5)
        mine = session.recording
    assert mine.columns == run.columns
    for name in run.columns:
        assert np.array_equal(mine[name], run[name][: len(mine)]), name
    assert len(mine) >= len(run) - 1


def test_a_controller_in_python_acts_in_the_next_step(scenario: Path) -> None:
    """One that computes what the component does gives the same bits."""
    with cosim.open(scenario) as given, cosim.open(scenario) as mine:
        for _ in range(50):
            given.step()
            mine.step()
            mine["controller.y"] = given["controller.y"]
            assert mine["plant.y"] == given["plant.y"]
        mine["controller.y"] = given["controller.y"] + 1.0
        for session in (given, mine):
            session.step(2)
        assert mine["plant.y"] != given["plant.y"]


def test_an_input_without_a_wire_keeps_what_it_is_given(scenario: Path) -> None:
    with cosim.open(scenario) as session:
        session["plant.b"] = 0.25
        assert session["plant.b"] == 0.25
        for _ in range(3):
            session.step(700)  # more than one block of signals
            assert session["plant.b"] == 0.25
        still = session["plant.y"]
        session["plant.b"] = 1e3
        session.step(5)
        assert session["plant.y"] < still


@pytest.mark.parametrize(
    ("name", "value", "error", "sentence"),
    [
        ("plant.x", 1.0, WiringError, r'There is no "plant\.x"; there are: .*plant\.y'),
        ("plant.a", 1.0, WiringError, r'"plant\.a" is fed by controller\.y: set that'),
        ("r.position", 1.0, WiringError, r'"r\.position" is a signal, which a scenario gives'),
        ("controller.y", float("nan"), StepError, r'"controller\.y" is set to nan; it must be a finite number'),
    ],
)
def test_what_cannot_be_set_is_one_sentence(
    scenario: Path, name: str, value: float, error: type[Exception], sentence: str
) -> None:
    with cosim.open(scenario) as session, pytest.raises(error, match=sentence):
        session[name] = value


def test_a_component_that_fails_or_asks_to_end_says_when_and_is_stepped_no_further(scenario: Path) -> None:
    with cosim.open(scenario, set={"plant.fail_at": 0.1, "plant.status": 3.0}) as session:
        with pytest.raises(StepError, match=r"plant returned an error at tick 100 \(0\.1 s\)"):
            session.step(500)
        assert len(session.recording) == 50
        with pytest.raises(StepError, match=r"The simulation failed: it cannot be stepped on\."):
            session.step()
    with cosim.open(scenario, set={"plant.fail_at": 0.1, "plant.status": 17.0}) as session:
        session.step(500)
        assert session.ended.startswith("plant asked to end the simulation at tick 10")
        with pytest.raises(StepError, match=r"asked to end the simulation .*: it cannot be stepped on"):
            session.step()
