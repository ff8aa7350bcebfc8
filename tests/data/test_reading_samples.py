"""Files of machines' own tools, made in their documented formats, are read; docs/reading.md shows how."""

import re
import shlex
import sqlite3
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest
from commands import call
from mcap.reader import make_reader
from mcap_ros2.writer import Writer
from scipy.io import savemat

from bench import samples as made
from cosim.cli import repeated
from cosim.data.preview import Preview, preview
from cosim.data.recording import Recording
from cosim.reading import options_of, read_recordings
from cosim.support.errors import RecordingError
from cosim_readers.rosbag import JOINT_STATE

ROOT = Path(__file__).parents[2]
SAMPLES = ROOT / "tests" / "samples"
GUIDE = (ROOT / "docs" / "reading.md").read_text("utf-8")
TABLE = {
    name: (became, said)
    for name, became, said in re.findall(r"^\| `(\S+)` \| [^|]+ \| (.*?) \| `?(.*?)`? ?\|$", GUIDE, re.M)
}
"""The table of the guide: a file, what becomes of it, and what the person who recorded it knows and it does not say."""


def mcap(path: Path) -> None:
    with path.open("wb") as file:
        out = Writer(file)
        schema = out.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        note = out.register_msgdef("std_msgs/msg/Float64", "float64 data")
        for row, (q, tau) in enumerate(zip(made.Q.tolist(), made.TAU.tolist(), strict=True)):
            stamp = {"sec": 1_709_331_184 + row // 200, "nanosec": 5_000_000 * (row % 200)}
            lists = {"name": ["azimuth"], "position": [q], "velocity": [], "effort": [tau]}
            state = {"header": {"stamp": stamp, "frame_id": ""}, **lists}
            out.write_message("/joint_states", schema, state, log_time=row, publish_time=row, sequence=row)
            out.write_message("/load", note, {"data": 1.0}, log_time=row, publish_time=row, sequence=row)
        out.finish()


def bag(path: Path) -> None:
    mcap(path.with_suffix(".mcap"))
    with sqlite3.connect(path) as base, path.with_suffix(".mcap").open("rb") as file:
        base.execute("CREATE TABLE topics (id INTEGER, name TEXT, type TEXT, serialization_format TEXT)")
        base.execute("CREATE TABLE messages (id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB)")
        base.execute("INSERT INTO topics VALUES (1, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr')")
        messages = make_reader(file).iter_messages(topics=["/joint_states"])
        base.executemany(
            "INSERT INTO messages VALUES (?, 1, ?, ?)",
            [(k, one.log_time, one.data) for k, (_, _, one) in enumerate(messages)],
        )
    base.close()


def mat(path: Path) -> None:
    savemat(path, {"run": {"t": made.T, "tau": made.TAU, "q": made.Q}, "mass": 95.1})


def hdf5(path: Path) -> None:
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
READ = [name for name in TABLE if name != "PHD2_GuideLog.txt"]
TOLERANCE = {
    "micro_controller.txt": 1e-3,
    "sinamics_trace.csv": 1e-5,
    "halsampler.txt": 1e-6,
    "halsampler_tagged.txt": 1e-6,
}
"""What rounding to counts and to printed digits costs, in N.m and rad; where nothing is said, 1e-7."""


def sample(name: str, folder: Path) -> Path:
    if name not in BINARY:
        return SAMPLES / name
    BINARY[name](folder / name)
    return folder / name


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
    said = options(TABLE[name][1])
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
    pattern = r"RA without corrections: drift (\S+) .* period (\S+) s with \+-(\S+)"
    (numbers,) = re.findall(pattern, told)
    np.testing.assert_allclose([float(one) for one in numbers], [1.2, made.PERIOD, made.TRAIN], rtol=0.02)
    assert "4 frames in which the star was lost were left out" in told


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


def test_other_channels_are_joined_and_other_topics_named(tmp_path: Path) -> None:
    recording = Recording.read(SAMPLES / "twincat_scope_all_times.csv")
    assert '"MotorTemp" (20 Hz, 0 s to 0.75 s) between samples' in " ".join(recording.notes)
    assert recording.origin["start"].startswith("2024-03-01T22:13:04")
    recording = Recording.read(sample("ros2.mcap", tmp_path))
    assert "of its topics /joint_states was read; left out: /load." in " ".join(recording.notes)
    with pytest.raises(RecordingError, match=r"is not a file but the folder of a bag; give .*ros2.mcap"):
        Recording.read(tmp_path)


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Preview]:
    """What is seen of each file before anything is answered."""
    folder = tmp_path_factory.mktemp("samples")
    return {name: preview(sample(name, folder)) for name in READ}


@pytest.mark.filterwarnings("default")
def test_the_table_of_the_guide_is_what_happens_and_nothing_else_is_asked(shown: dict[str, Preview]) -> None:
    assert {*TABLE} == {*made.TEXTS, *BINARY}
    assert TABLE["PHD2_GuideLog.txt"] == ("position only: no torque", "")
    for name, one in shown.items():
        asked = [*one.undecided, *[one.refused] * bool(one.refused)]
        assert TABLE[name][0] == ("asks" if asked else "read"), name
        assert bool(asked) == bool(TABLE[name][1])
        assert all("--" in sentence for sentence in asked)
        if name not in BINARY and not one.refused:  # the options that are shown can be typed
            said = options(one.said)
            parsed = options_of(SAMPLES / name, said["columns"], said["units"], said["layout"])
            assert preview(SAMPLES / name, parsed).undecided == ()


@pytest.mark.parametrize("line", re.findall(r"^cosim show samples/.*$", GUIDE, re.MULTILINE))
def test_a_recipe_of_the_guide_runs(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = shlex.split(re.split(r"\s+#\s", line)[0])[1:]
    assert call(words[0], SAMPLES / Path(words[1]).name, *words[2:]) == 0, capsys.readouterr().err
    out = capsys.readouterr().out
    assert "options: " in out or "as an axis: " in out


# A table of several signals in one array is its columns, and many gains are no recording.


@pytest.mark.parametrize("kind", ["mat", "h5"])
@pytest.mark.parametrize("turned", [False, True])
def test_a_table_of_several_signals_is_its_columns_beside_many_gains(tmp_path: Path, kind: str, turned: bool) -> None:
    """Simulink logs to arrays of (samples, signals); MATLAB 7.3 writes them the other way round."""
    table = np.column_stack([made.T, made.TAU, made.Q])
    arrays = {"data": table.T if turned else table, "gains": np.ones((4, 100))}
    if kind == "mat":
        savemat(tmp_path / "run.mat", arrays)
    else:
        with h5py.File(tmp_path / "run.h5", "w") as file:
            file.update(arrays)
    run = Recording.read(tmp_path / f"run.{kind}", {"t": "data_1", "tau": "data_2", "q": "data_3"})
    np.testing.assert_allclose([run["tau"], run["q"]], [made.TAU, made.Q])
    assert set(run.columns) == {"t", "tau", "q"}
