"""Files of machines' own tools, made in their documented formats, are read; docs/reading.md shows how."""

import re
import shlex
import sqlite3
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import call

from bench import samples as made
from cosim.cli import repeated
from cosim.data.preview import Preview, preview
from cosim.data.recording import Recording
from cosim.reading import options_of, read_recordings
from cosim.support.errors import RecordingError

ROOT = Path(__file__).parents[2]
SAMPLES = ROOT / "tests" / "samples"
GUIDE = (ROOT / "docs" / "reading.md").read_text("utf-8")


ANSWERS = {
    "halsampler.txt": "--columns tau=#1 q=#2 --units q=deg --layout period=5ms",
    "halsampler_tagged.txt": '--columns t=#1 tau=#2 q=#3 --units "t=5 ms" q=deg',
    "halscope.log": "--units q=deg",
    "odrive_capture.txt": "--columns t=#1 q=#2 tau=#3 --units q=turn",
    "odrive.csv": '--columns tau=axis0.motor.foc.Iq_measured --units "tau=0.12 N.m"',
    "vesc_tool.csv": '--columns tau=current_motor --units "tau=0.12 N.m"',
    "sinamics_trace.csv": f'--units "q={360 / 2**20} deg"',
    "micro_controller.txt": '--units "q=0.0054931640625 deg"',
    "two_joints.csv": "--columns tau=az.effort q=az.position",
    "oscilloscope.csv": "--columns tau=CH1 q=CH2",
}
"""What the person who recorded a file knows and the file does not say; of all others nothing is asked."""
BY_WHOM = {
    "twincat_scope.csv": "TwinCAT Scope, one time for all",
    "twincat_scope_all_times.csv": "TwinCAT Scope, a time each, file times",
    "tia_trace.csv": "Siemens TIA Portal trace, UTF-16",
    "sinamics_trace.csv": "Siemens SINAMICS trace",
    "halscope.log": "LinuxCNC halscope",
    "halsampler.txt": "LinuxCNC halsampler",
    "halsampler_tagged.txt": "LinuxCNC halsampler -t",
    "odrive_capture.txt": "ODrive BulkCapture, numpy.savetxt",
    "odrive.csv": "ODrive, named columns",
    "moteus.csv": "moteus csv_output",
    "vesc_tool.csv": "VESC Tool",
    "plotjuggler.csv": "PlotJuggler, ROS 2 joint states",
    "PHD2_GuideLog.txt": "PHD2",
    "german_excel.csv": "German Excel, cp1252, row of units",
    "labview.lvm": "LabVIEW",
    "oscilloscope.csv": "an oscilloscope",
    "iso_logger.csv": "a logger with ISO time stamps",
    "micro_controller.txt": "a microcontroller",
    "pandas_index.csv": "pandas with its index",
    "two_joints.csv": "a robot of two joints, ns since 1970",
    "ros2.mcap": "ROS 2, MCAP",
    "ros2.db3": "ROS 2, SQLite bag",
    "run.mat": "MATLAB, v5",
    "run.h5": "HDF5",
    "run.mf4": "MDF4",
}


def binary(name: str, folder: Path) -> Path:
    path = folder / name
    BINARY[name](path)
    return path


def _joint_states() -> list[dict[str, Any]]:
    first = 1_709_331_184_000_000_000
    stamps = [first + 5_000_000 * row for row in range(made.ROWS)]
    return [
        {
            "header": {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": ""},
            "name": ["azimuth"],
            "position": [float(q)],
            "velocity": [],
            "effort": [float(tau)],
        }
        for stamp, q, tau in zip(stamps, made.Q, made.TAU, strict=True)
    ]


def mcap(path: Path) -> None:
    writer = pytest.importorskip("mcap_ros2.writer")
    from cosim_readers.rosbag import JOINT_STATE

    with path.open("wb") as file:
        out = writer.Writer(file)
        schema = out.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        note = out.register_msgdef("std_msgs/msg/Float64", "float64 data")
        for row, message in enumerate(_joint_states()):
            out.write_message("/joint_states", schema, message, log_time=row, publish_time=row, sequence=row)
            out.write_message("/load", note, {"data": 1.0}, log_time=row, publish_time=row, sequence=row)
        out.finish()


def bag(path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    mcap(path.with_suffix(".mcap"))
    with sqlite3.connect(path) as base, path.with_suffix(".mcap").open("rb") as file:
        base.execute("CREATE TABLE topics (id INTEGER, name TEXT, type TEXT, serialization_format TEXT)")
        base.execute("CREATE TABLE messages (id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB)")
        base.execute("INSERT INTO topics VALUES (1, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr')")
        messages = reader.make_reader(file).iter_messages(topics=["/joint_states"])
        base.executemany(
            "INSERT INTO messages VALUES (?, 1, ?, ?)",
            [(k, one.log_time, one.data) for k, (_, _, one) in enumerate(messages)],
        )
    base.close()


def mat(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"run": {"t": made.T, "tau": made.TAU, "q": made.Q}, "mass": 95.1})


def hdf5(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for name, column in {"t": made.T, "tau": made.TAU, "q": made.Q / made.DEG}.items():
            file[f"log/{name}"] = column.reshape(-1, 1)
        file["mass"] = 95.1
        file["log/q"].attrs["units"] = "deg"


def mdf(path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        columns = {"torque": (made.TAU, "Nm"), "position": (made.Q / made.DEG, "deg")}
        file.append([asammdf.Signal(x, made.T, name=name, unit=unit) for name, (x, unit) in columns.items()])
        file.save(path)


BINARY: dict[str, Callable[[Path], None]] = {
    "ros2.mcap": mcap,
    "ros2.db3": bag,
    "run.mat": mat,
    "run.h5": hdf5,
    "run.mf4": mdf,
}
READ = [name for name in BY_WHOM if name != "PHD2_GuideLog.txt"]
TOLERANCE = {
    "micro_controller.txt": 1e-3,
    "sinamics_trace.csv": 1e-5,
    "halsampler.txt": 1e-6,
    "halsampler_tagged.txt": 1e-6,
}
"""What rounding to counts and to printed digits costs, in N.m and rad; where nothing is said, 1e-7."""


def sample(name: str, folder: Path) -> Path:
    return binary(name, folder) if name in BINARY else SAMPLES / name


def options(typed: str) -> dict[str, list[str]]:
    """The lists that the command line makes of typed options."""
    pairs = list(pairwise(repeated(shlex.split(typed))))
    return {key: [after for word, after in pairs if word == f"--{key}"] for key in ("columns", "units", "layout")}


@pytest.mark.parametrize("name", made.TEXTS)
def test_a_sample_is_as_it_is_made(name: str) -> None:
    assert (SAMPLES / name).read_bytes() == made.encoded(name)
    assert (SAMPLES / name).stat().st_size < 40_000


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("name", READ)
def test_a_file_of_a_machine_gives_its_motion(tmp_path: Path, name: str) -> None:
    said = options(ANSWERS.get(name, ""))
    (recording,) = read_recordings(
        [sample(name, tmp_path)], {}, said["columns"], said["units"], "rotary", said["layout"]
    )
    tolerance = TOLERANCE.get(name, 1e-7)
    np.testing.assert_allclose(recording.t - recording.t[0], made.T, atol=1e-6)
    np.testing.assert_allclose(recording["tau"], made.TAU, atol=tolerance)
    np.testing.assert_allclose(recording["q"], made.Q, atol=tolerance)
    if "q_d" in recording:
        np.testing.assert_allclose(recording["q_d"], made.Q_D, atol=tolerance)


def test_a_guide_log_has_no_torque_and_says_what_it_can(capsys: pytest.CaptureFixture[str]) -> None:
    path = SAMPLES / "PHD2_GuideLog.txt"
    with pytest.raises(RecordingError, match=r"holds where a guide star was, and no torque: .* cosim show"):
        Recording.read(path)
    assert call("show", path) == 0
    told = capsys.readouterr().out
    drift, period, amplitude = re.findall(r"RA without corrections: drift (\S+) .* period (\S+) s with \+-(\S+)", told)[
        0
    ]
    assert float(period) == pytest.approx(made.PERIOD, rel=0.02)
    assert float(amplitude) == pytest.approx(made.TRAIN, rel=0.02)
    assert float(drift) == pytest.approx(1.2, rel=0.02)
    assert "4 frames in which the star was lost were left out" in told


def test_channels_of_another_sample_time_are_joined_by_time_and_said_so() -> None:
    recording = Recording.read(SAMPLES / "twincat_scope_all_times.csv")
    assert '"MotorTemp" (20 Hz, 0 s to 0.75 s) between samples' in " ".join(recording.notes)
    assert recording.origin["start"].startswith("2024-03-01T22:13:04")


NO_TIMES = {
    "ticks beyond any year": ("twincat_scope.csv", r"(Starttime of export\t)\d+", "9" * 25),
    "ticks of 6000 digits": ("twincat_scope.csv", r"(Starttime of export\t)\d+", "9" * 6000),
    "a digit that is none": ("twincat_scope.csv", r"(Starttime of export\t)\d+", "²"),
    "a day that is none": ("PHD2_GuideLog.txt", r"(Guiding Begins at )\d{4}-\d\d-\d\d", "2024-99-99"),
    "a pixel scale of 0": ("PHD2_GuideLog.txt", r"(Pixel scale = )[\d.]+", "0.0"),
    "a period of 0": ("halscope.log", r"(Sampling period is )\d+", "0"),
    "a period of 6000 digits": ("halscope.log", r"(Sampling period is )\d+", "9" * 6000),
}
"""What a damaged head of a file says of times and scales."""


@pytest.mark.parametrize("what", NO_TIMES)
def test_a_head_that_says_no_time_costs_the_time_alone(tmp_path: Path, what: str) -> None:
    name, before, after = NO_TIMES[what]
    text = re.sub(before, rf"\g<1>{after}", (SAMPLES / name).read_text("utf-8"))
    (tmp_path / name).write_text(text, "utf-8")
    whole, damaged = preview(SAMPLES / name), preview(tmp_path / name)
    assert len(damaged.recording) == len(whole.recording)
    assert after not in damaged.recording.origin.get("start", "")
    said = " ".join((*damaged.recording.notes, *map(str, damaged.undecided)))
    assert ("period" in what) == ("--layout period=" in said)
    assert ("scale" in what) == ("the log states no pixel scale" in said)


def test_other_topics_of_a_bag_are_named(tmp_path: Path) -> None:
    recording = Recording.read(sample("ros2.mcap", tmp_path))
    assert "of its topics /joint_states was read; left out: /load." in " ".join(recording.notes)
    with pytest.raises(RecordingError, match=r"is not a file but the folder of a bag; give .*ros2.mcap"):
        Recording.read(tmp_path)


def _row(name: str, shown: Preview | None) -> str:
    if shown is None:
        return f"| `{name}` | {BY_WHOM[name]} | position only: no torque | |"
    said = ANSWERS.get(name, "")
    became = "read" if not (shown.undecided or shown.refused) else "asks"
    return f"| `{name}` | {BY_WHOM[name]} | {became} | {f'`{said}` ' if said else ''}|"


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Preview]:
    """What is seen of each file before anything is answered."""
    folder = tmp_path_factory.mktemp("samples")
    return {name: preview(sample(name, folder)) for name in READ}


@pytest.mark.filterwarnings("default")
def test_the_table_of_the_guide_is_what_happens_and_nothing_else_is_asked(shown: dict[str, Preview]) -> None:
    for package in ("mcap_ros2", "h5py", "asammdf"):
        pytest.importorskip(package)
    table = "\n".join(_row(name, shown.get(name)) for name in BY_WHOM)
    assert table in GUIDE, f"docs/reading.md should hold:\n{table}"
    for name, one in shown.items():
        asked = [*one.undecided, *[one.refused] * bool(one.refused)]
        assert bool(asked) == (name in ANSWERS)
        assert all("--" in sentence for sentence in asked)


@pytest.mark.parametrize("line", re.findall(r"^cosim show samples/.*$", GUIDE, re.MULTILINE))
def test_a_recipe_of_the_guide_runs(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = shlex.split(re.split(r"\s+#\s", line)[0])[1:]
    assert call(words[0], SAMPLES / Path(words[1]).name, *words[2:]) == 0, capsys.readouterr().err
    out = capsys.readouterr().out
    assert "options: " in out or "as an axis: " in out


@pytest.mark.filterwarnings("default")
def test_the_options_that_are_shown_can_be_typed(shown: dict[str, Preview]) -> None:
    for name, one in shown.items():
        if name in BINARY or one.refused:
            continue
        said = options(one.said)
        parsed = options_of(SAMPLES / name, said["columns"], said["units"], said["layout"])
        assert preview(SAMPLES / name, parsed).undecided == ()


# A table of several signals in one array is its columns, and many gains are no recording.


@pytest.mark.parametrize("kind", ["mat", "h5"])
@pytest.mark.parametrize("turned", [False, True])
def test_a_table_of_several_signals_is_its_columns(tmp_path: Path, kind: str, turned: bool) -> None:
    """Simulink logs to arrays of (samples, signals); MATLAB 7.3 writes them the other way round."""
    table = np.column_stack([made.T, made.TAU, made.Q])
    table = table.T if turned else table
    if kind == "mat":
        from scipy.io import savemat

        savemat(tmp_path / "run.mat", {"data": table, "gains": np.eye(3)})
    else:
        with pytest.importorskip("h5py").File(tmp_path / "run.h5", "w") as file:
            file["data"], file["gains"] = table, np.eye(3)
    run = Recording.read(tmp_path / f"run.{kind}", {"t": "data_1", "tau": "data_2", "q": "data_3"})
    np.testing.assert_allclose(run["tau"], made.TAU)
    np.testing.assert_allclose(run["q"], made.Q)
    assert set(run.columns) == {"t", "tau", "q"}


def test_many_columns_of_gains_do_not_outnumber_the_vectors_of_a_recording(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "run.mat", {"t": made.T, "tau": made.TAU, "q": made.Q, "gains": np.ones((4, 100))})
    assert set(Recording.read(tmp_path / "run.mat").columns) == {"t", "tau", "q"}
