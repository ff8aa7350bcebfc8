"""JSON, NumPy, Parquet and MAT: each shape in which arrays and records are stored, and times of their own, are read."""

import gzip
import io
import json
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pytest
import scipy.io
from pyarrow import parquet

from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.data.text.table import as_array
from cosim.support.errors import ManyRecordingsError, RecordingError, UndecidedError

T = np.round(np.arange(500) * 2e-3, 6)
Q, TAU = np.sin(3 * T), np.cos(5 * T)
JOINTS = np.stack([Q, 2 * Q, 3 * Q], axis=1)
ARRAYS: dict[str, Any] = {"t": T, "q": Q, "tau": TAU}
COLUMNS = {name: column.tolist() for name, column in ARRAYS.items()}
RECORDS = [dict(zip(COLUMNS, row, strict=True)) for row in zip(*COLUMNS.values(), strict=True)]
LINES = "".join(json.dumps(one) + "\n" for one in RECORDS)
ROWS = np.stack([T, TAU, Q], axis=1)
NAMED = {"columns": ["t", "tau", "q"], "data": ROWS.tolist()}
OBJECT = np.array([{"a": 1}], dtype=object)


def as_json(path: Path, value: Any) -> None:
    text = value if isinstance(value, str) else json.dumps(value)
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())


WRITERS: dict[str, Callable[[Path, Any], object]] = {
    ".npz": lambda path, arrays: np.savez_compressed(path, **arrays),
    ".npy": lambda path, array: np.save(path, array) if isinstance(array, np.ndarray) else path.write_bytes(array),
    ".parquet": lambda path, columns: parquet.write_table(pa.table(columns), path),
    ".mat": scipy.io.savemat,
}


def stored(folder: Path, name: str, value: Any) -> Path:
    path = folder / name
    WRITERS.get(path.suffix, as_json)(path, value)
    return path


SIGNALS = np.array([(Q[:, None], "q"), (TAU[:, None], "tau")], dtype=[("values", "O"), ("label", "O")])
FIELDS = [("Name", "O"), ("Data", "O"), ("Unit", "O")]
CONTROLDESK = np.array([("'Model Root/Plant/angle'", Q, "deg"), ("'Model Root/tau'", TAU, "N.m")], dtype=FIELDS)
LABELS = np.array(["one", "two", "three"], object)
SHAPES: dict[str, tuple[str, Any, dict[str, str], np.ndarray]] = {
    # JSON
    "records": ("run.json", RECORDS, {}, Q),
    "records in a member": ("run.json", {"machine": "axis", "samples": RECORDS}, {}, Q),
    "records, one a line": ("run.jsonl", LINES, {}, Q),
    "records, one a line, called JSON": ("run.json", LINES, {}, Q),
    "records of Windows": ("run.ndjson", LINES.replace("\n", "\r\n"), {}, Q),
    "records in a text": ("run.txt", LINES, {}, Q),
    "records in a log": ("run.log", LINES, {}, Q),
    "packed records": ("run.jsonl.gz", LINES, {}, Q),
    "columns": ("run.json", COLUMNS, {}, Q),
    "columns in a member": ("run.json", {"meta": {"rate": 500, "gains": [1, 2, 3]}, "log": COLUMNS}, {}, Q),
    "names and rows": ("run.json", NAMED, {}, Q),
    "names, an index and rows": ("run.json", NAMED | {"index": list(range(500))}, {}, Q),
    "members and lists within each other are named by their path": (
        "run.json",
        [{"t": one["t"], "joint": {"position": [one["q"], 0.0]}, "effort": one["tau"]} for one in RECORDS],
        {"q": "joint.position.1"},
        Q,
    ),
    "a serial number beyond 64 bits": ("run.json", COLUMNS | {"serial": [2**70] * 500}, {}, Q),
    "stated units": ("run.json", COLUMNS | {"units": {"q": "deg", "tau": "N.m"}}, {}, np.deg2rad(Q)),
    "what a record lacks is no value": (
        "run.json",
        [one | ({"temperature": 20.0} if k % 2 else {}) for k, one in enumerate(RECORDS)],
        {},
        Q,
    ),
    "stamps of 19 digits keep every digit": (
        "run.json",
        [one | {"t": 1_700_000_000_000_000_001 + 2_000_000 * k} for k, one in enumerate(RECORDS)],
        {},
        Q,
    ),
    # NumPy
    "a table of joints": ("run.npz", {"time": T, "q": JOINTS, "tau": TAU}, {"q": "q_2"}, 2 * Q),
    "a table by columns": ("run.npz", {"time": T, "q": np.asfortranarray(JOINTS), "tau": TAU}, {"q": "q_2"}, 2 * Q),
    "a text vector that names the columns": (
        "run.npz",
        {"data": ROWS.T, "columns": np.array(["t", "tau", "q"])},
        {},
        Q,
    ),
    "fields of a structured array": (
        "run.npy",
        np.array([*zip(T, Q, TAU, strict=True)], dtype=[("t", "f8"), ("q", "f8"), ("tau", "f4")]),
        {},
        Q,
    ),
    "a matrix without names": ("run.npy", ROWS, {"t": "#1", "tau": "#2", "q": "#3"}, Q),
    # Parquet
    **{
        f"lists of one length, {kind}": (
            "run.parquet",
            {"timestamp": T, "observation.state": pa.array(JOINTS.tolist(), kind), "tau": TAU},
            {"q": "observation.state.2"},
            2 * Q,
        )
        for kind in (pa.list_(pa.float32(), 3), pa.list_(pa.float64()), pa.large_list(pa.float64()))
    },
    "fields of structs": (
        "run.parquet",
        {"t": T, "tau": TAU, "joint": pa.array([{"position": q, "name": "az"} for q in Q])},
        {"q": "joint.position"},
        Q,
    ),
    "lists in lists": (
        "run.parquet",
        {"t": T, "tau": TAU, "action": pa.array([[[q, 0.0]] for q in Q], pa.list_(pa.list_(pa.float64(), 2), 1))},
        {"q": "action.1.1"},
        Q,
    ),
    # MAT
    "a structure with time of Simulink": (
        "run.mat",
        {"ScopeData": {"time": T, "signals": SIGNALS, "blockName": "m/Scope"}},
        {"t": "time"},
        Q,
    ),
    **{
        f"a signal of several values, called {column}": (
            "run.mat",
            {"x": {"time": T, "signals": {"values": JOINTS, "label": label}}, "tau": TAU},
            {"t": "time", "q": column},
            2 * Q,
        )
        for label, column in (("", "x_2"), (LABELS, "two"), ("all", "all_2"))
    },
    "a recording of ControlDesk has the names and units of its signals": (
        "run.mat",
        {"rec": {"X": {"Name": "", "Data": T}, "Y": CONTROLDESK, "Description": "d"}},
        {},
        np.deg2rad(Q),
    ),
    **{
        f"fields of one name in two structs, {name}": (
            "run.mat",
            {"t": T, "tau": TAU, "az": {"q": Q}, "alt": {"q": 2 * Q}},
            {"q": f"{name}.q"},
            factor * Q,
        )
        for name, factor in (("az", 1), ("alt", 2))
    },
}
"""Name and content of a file, the columns that have to be said, and the position that is meant."""


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_gives_the_same_recording(tmp_path: Path, shape: str) -> None:
    name, value, columns, q = SHAPES[shape]
    seen = Recording.read(stored(tmp_path, name, value), columns)
    np.testing.assert_allclose(seen.t, T, atol=1e-12)
    np.testing.assert_allclose(seen["q"], q, rtol=1e-6 if "float>" in shape else 1e-14)
    np.testing.assert_allclose(seen["tau"], TAU, atol=0 if "structured" not in shape else 1e-7)
    assert "temperature" not in seen


NOTED: dict[str, tuple[str, Any]] = {
    "of its tables motor was read; left out: weather.": (
        "run.json",
        {"motor": COLUMNS, "weather": {"t": [0, 1], "temperature": [20, 21]}},
    ),
    "its last line was left out, as it is torn": ("run.jsonl", LINES + '{"t": 1.0, "q'),
    "pickled objects were left out, as they are programs: settings": ("run.npz", ARRAYS | {"settings": OBJECT}),
    'column "x" was left out': ("run.parquet", ARRAYS | {"x": pa.array([[1.0] * (1 + k % 2) for k in range(500)])}),
    "arrays of other lengths were left out: slow (9).": ("run.mat", ARRAYS | {"slow": np.arange(9.0)}),
}


@pytest.mark.parametrize("note", NOTED)
def test_what_is_left_out_is_noted(tmp_path: Path, note: str) -> None:
    seen = preview(stored(tmp_path, *NOTED[note])).recording
    assert note in seen.notes[0]
    np.testing.assert_array_equal(seen["q"], Q)


def claiming(numbers: int) -> bytes:
    """A header of NumPy that claims so many, above ten."""
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": (numbers,)})
    return file.getvalue() + bytes(80)


NO_NAMES = r"does not name its 3 columns; .*--columns t=#1 tau=#2 q=#3"
WIDE = pa.array([np.zeros(20_000).tolist()] * 3, pa.list_(pa.float64(), 20_000))


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("run.json", '{"a": "no numbers"}', "holds no table: neither records"),
        ("run.json", "[1, 2", "it is no JSON: "),
        ("run.json", LINES.replace('"q"', "q", 1), "it is no JSON"),
        ("run.json", LINES[:2000].rpartition("\n")[0] + "\nnot this\n" + LINES, "is no JSON: 'not this'"),
        ("run.json", "[" * 100_000 + "]" * 100_000, "lists in lists, too deep"),
        ("run.json", "[" + "[]," * 2_500_000 + "[]]", "unpacks to"),
        ("run.json", ROWS.tolist(), NO_NAMES),
        ("run.npy", ROWS, NO_NAMES),
        ("run.npy", claiming(10**12), "run.npy unpacks to 8(,000 G| T)B or more"),
        ("run.npy", claiming(1000), r"ends after 80 of 8,000 bytes of an array of shape \(1000,\)"),
        ("run.npy", OBJECT, "holds pickled objects, which are programs"),
        ("run.npz", {"time": T, "q": JOINTS, "tau": TAU}, r"q may be any of q_1, q_2, q_3.*--columns q=q_1"),
        ("texts.npz", {"names": np.array(["a", "b"])}, r"texts.npz holds no arrays of numbers; it holds: names\."),
        ("run.parquet", {"t": T[:3], "x": WIDE}, "has 20,000 columns; a recording has at most 10,000"),
        ("run.wpilog", "x", "export it as CSV with AdvantageScope"),
        ("run.tdms", "x", "a TDMS file of LabVIEW; write it as CSV"),
        ("run.ulg", "x", "ulog2csv"),
        ("run.xlsx", "x", "a spreadsheet; save its table as CSV"),
        ("run.pkl", "x", "a program and is never loaded"),
        ("run.xyz", "x", r"of no known kind, \.xyz; known are: \.csv"),
    ],
    ids=lambda one: one if isinstance(one, str) and len(one) < 99 else "",
)
def test_what_is_no_table_is_refused_in_a_sentence(tmp_path: Path, name: str, value: Any, sentence: str) -> None:
    with pytest.raises(RecordingError, match=sentence):
        Recording.read(stored(tmp_path, name, value))


def test_tests_of_sysid_are_recordings_with_names_and_units_and_a_note_forbids_no_period(tmp_path: Path) -> None:
    rows = np.stack([T, TAU, Q, Q], axis=1).tolist()
    later = [[50 + t, *rest] for t, *rest in rows]
    path = stored(tmp_path, "s.json", {"sysid": True, "test": "Simple", "units": "Degrees", "a": later, "b": rows})
    with pytest.raises(ManyRecordingsError, match="part=a"):
        Recording.read(path, {"tau": "voltage"}, {"tau": "0.1 N.m"})
    seen = Recording.read(Path(f"{path}:part=b"), {"tau": "voltage"}, {"tau": "0.1 N.m"})
    np.testing.assert_allclose([seen.t, seen["q"]], [T, np.deg2rad(Q)])
    assert seen.units["velocity"] == "rad/s"
    path = stored(tmp_path, "run.npz", {"q": Q, "tau": TAU, "edges": np.arange(7.0)})
    np.testing.assert_allclose(Recording.read(path, layout={"period": "2ms"}).t, T)


def test_objects_of_matlab_are_refused_with_the_way_out_and_numbers_beside_one_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with h5py.File(tmp_path / "objects.mat", "w", userblock_size=512) as file:
        handle = file.create_dataset("data", data=np.array([[3707764736, 2, 1, 1, 1, 1]], dtype=np.uint32))
        handle.attrs["MATLAB_object_decode"] = np.int32(3)
        file.create_group("#refs#").create_dataset("a", data=np.arange(500.0))
        file.create_group("#subsystem#")
    raw = (tmp_path / "objects.mat").read_bytes()
    (tmp_path / "objects.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(128) + raw[128:])
    with pytest.raises(RecordingError, match=r"holds MATLAB objects .*, which only MATLAB can open\. There, save"):
        Recording.read(tmp_path / "objects.mat")
    monkeypatch.setattr(scipy.io, "whosmat", lambda path: len(None))  # TypeError, as for an object
    np.testing.assert_array_equal(Recording.read(stored(tmp_path, "run.mat", ARRAYS))["q"], Q)


# Columns of doubles come from Arrow as they are, and without pandas.

VALUES = np.linspace(-1.0, 1.0, 11)
READ = """
import sys
from pathlib import Path
from cosim.data.binary.parquet import read
read(Path("run.parquet"))
print("pandas" in sys.modules)
"""


@pytest.mark.parametrize("column", [pa.array(VALUES), pa.array(VALUES).slice(3, 5)], ids=["whole", "slice"])
def test_doubles_are_the_same_in_one_chunk_and_in_several_and_what_is_missing_is_no_number(column: pa.Array) -> None:
    expected = VALUES if len(column) == len(VALUES) else VALUES[3:8]
    assert np.array_equal(as_array(column), expected)
    chunked = pa.chunked_array([column, column.slice(0, 0), column.slice(1)])
    assert np.array_equal(as_array(chunked), np.concatenate([expected, expected[1:]]))
    assert np.isnan(as_array(pa.chunked_array([pa.array([1.0, None])]))).tolist() == [False, True]
    assert as_array(pa.chunked_array([], pa.float64())).shape == (0,)


def test_a_table_of_numbers_is_read_without_pandas(tmp_path: Path) -> None:
    stored(tmp_path, "run.parquet", {"t": VALUES, "q": VALUES**2})
    done = subprocess.run([sys.executable, "-c", READ], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


# Vectors of time of their own lengths: each channel is read at its own times, whatever the format.

TA, TQ = np.arange(2000) / 1000, 3e-4 + np.arange(1000) / 500
TAUA, QQ = np.cos(9 * TA), 0.1 * np.sin(9 * TQ)
Arrays = Mapping[str, np.ndarray]


def as_hdf5(path: Path, arrays: Arrays) -> None:
    names = ("drive/timestamp", "drive/torque", "encoder/timestamp", "encoder/angle")
    with h5py.File(path, "w") as file:
        for name, column in zip(names, arrays.values(), strict=True):
            file[name] = column
            file[name].attrs["unit"] = "s" if name.endswith("timestamp") else "1"


def structs(arrays: Arrays) -> dict[str, Any]:
    ta, tau, tq, q = arrays.values()
    return {"torque": {"time": ta, "data": tau}, "angle": {"time": tq, "data": q}}


def simulink(arrays: Arrays) -> dict[str, Any]:
    ta, tau, tq, q = arrays.values()
    pairs = {"tau": (ta, tau), "q": (tq, q)}
    return {name: {"time": t, "signals": {"values": x, "label": ""}} for name, (t, x) in pairs.items()}


def columns(arrays: Arrays) -> dict[str, np.ndarray]:
    rows = max(map(len, arrays.values()))
    padded = {name: np.append(one, np.full(rows - len(one), np.nan)) for name, one in arrays.items()}
    return {name: padded[name] for name in sorted(padded, key=lambda name: name.startswith("t_"))}


WRITERS[".h5"] = as_hdf5
WAYS: dict[str, tuple[str, Callable[[Arrays], Any]]] = {
    "NumPy": ("run.npz", dict),
    "MAT": ("run.mat", dict),
    "structs of MAT": ("run.mat", structs),
    "Simulink": ("run.mat", simulink),
    "HDF5": ("run.h5", dict),
    "lists of Parquet": ("run.parquet", lambda arrays: {name: [one.tolist()] for name, one in arrays.items()}),
    "columns of Parquet that end early": ("run.parquet", columns),
}


@pytest.mark.parametrize("way", WAYS)
def test_a_time_for_each_channel_is_read_whatever_the_format(tmp_path: Path, way: str) -> None:
    name, made = WAYS[way]
    seen = Recording.read(stored(tmp_path, name, made({"t_tau": TA, "tau": TAUA, "t_q": TQ, "q": QQ})))
    assert {*seen.columns} == {"t", "tau", "q"}
    np.testing.assert_allclose([seen.t, seen["q"]], [TQ, QQ], atol=1e-12)
    np.testing.assert_allclose(seen["tau"], np.cos(9 * TQ), atol=2e-5)
    assert "by its mean over each row's interval" in " ".join(seen.notes)
    if made not in (structs, simulink) and name != "run.h5":  # times of one length belong to what they are named after
        late = TA + 3e-4
        arrays = {"t_tau": TA, "tau": TAUA, "t_q": late, "q": 0.1 * np.sin(9 * late)}
        seen = Recording.read(stored(tmp_path, name, made(arrays)))
        np.testing.assert_allclose(seen["q"], 0.1 * np.sin(9 * seen.t), atol=1e-9)
        np.testing.assert_allclose(seen["tau"], np.cos(9 * seen.t), atol=2e-5)


def test_a_device_has_one_time_for_its_channels_or_the_owner_says_which_is_meant(tmp_path: Path) -> None:
    arrays = {"t_drive_ms": 1e3 * TA, "drive_torque": TAUA, "drive_load": TAUA**2, "t_encoder": TQ, "encoder_angle": QQ}
    seen = Recording.read(stored(tmp_path, "run.npz", arrays | {"gains": np.arange(7.0)}))
    assert {*seen.columns} == {"t", "tau", "q", "drive_load"}
    np.testing.assert_allclose(seen["tau"], np.cos(9 * seen.t), atol=2e-5)
    assert "run: arrays without a time of their length were left out: gains." in seen.notes
    path = stored(
        tmp_path, "run.npz", {"t_tau": TA, "tau": TAUA, "q_raw": 0.1 * np.sin(9 * TA), "t_2": TQ, "noise": QQ}
    )
    seen = Recording.read(path, {"t": "t_tau", "q": "q_raw"})
    np.testing.assert_array_equal(seen["tau"], TAUA)


def test_samples_of_one_time_that_differ_are_asked_for_in_a_channel_too(tmp_path: Path) -> None:
    stands = TA.copy()
    stands[700] = stands[699]
    path = stored(tmp_path, "run.npz", {"t_tau": stands, "tau": TAUA, "t_q": TQ, "q": QQ})
    with pytest.raises(UndecidedError, match=r"values differ at its sample 701 .* --layout repeated=first"):
        Recording.read(path)
    assert len(Recording.read(path, layout={"repeated": "last"})) == len(TQ) - 1  # its interval is half empty
