"""JSON: records, one a line, columns, rows with and without names, several recordings, and what is refused."""

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.support.errors import ManyRecordingsError, RecordingError

T = np.round(np.arange(500) * 2e-3, 6)
Q = np.sin(3 * T)
TAU = np.cos(5 * T)
RECORDS = [{"t": t, "q": q, "tau": tau} for t, q, tau in zip(T.tolist(), Q.tolist(), TAU.tolist(), strict=True)]
LINES = "".join(json.dumps(one) + "\n" for one in RECORDS)
COLUMNS = {"t": T.tolist(), "q": Q.tolist(), "tau": TAU.tolist()}
ROWS = np.stack([T, TAU, Q], axis=1).tolist()


def written(folder: Path, name: str, value: Any) -> Path:
    path = folder / name
    text = value if isinstance(value, str) else json.dumps(value)
    path.write_bytes(gzip.compress(text.encode()) if name.endswith(".gz") else text.encode())
    return path


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("run.json", RECORDS),
        ("run.json", {"machine": "axis", "samples": RECORDS}),
        ("run.jsonl", LINES),
        ("run.json", LINES),
        ("run.ndjson", LINES.replace("\n", "\r\n")),
        ("run.txt", LINES),
        ("run.log", LINES),
        ("run.jsonl.gz", LINES),
        ("run.json", COLUMNS),
        ("run.json", {"meta": {"rate": 500, "gains": [1, 2, 3]}, "log": COLUMNS}),
        ("run.json", {"columns": ["t", "tau", "q"], "data": ROWS}),
        ("run.json", {"columns": ["t", "tau", "q"], "index": list(range(500)), "data": ROWS}),
    ],
)
def test_every_shape_of_json_gives_the_same_recording(tmp_path: Path, name: str, value: Any) -> None:
    seen = Recording.read(written(tmp_path, name, value))
    for column, true in {"t": T, "q": Q, "tau": TAU}.items():
        np.testing.assert_array_equal(seen[column], true)


def test_nested_members_and_lists_are_named_by_their_path(tmp_path: Path) -> None:
    records = [{"t": one["t"], "joint": {"position": [one["q"], 0.0]}, "effort": one["tau"]} for one in RECORDS]
    columns = {"q": "joint.position.1"}
    np.testing.assert_array_equal(Recording.read(written(tmp_path, "run.json", records), columns)["q"], Q)


def test_stated_units_are_used(tmp_path: Path) -> None:
    path = written(tmp_path, "run.json", COLUMNS | {"units": {"q": "deg", "tau": "mN.m"}})
    np.testing.assert_allclose(Recording.read(path)["q"], np.deg2rad(Q))


def test_rows_without_names_are_asked_for_them(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"does not name its 3 columns; .*--columns t=#1 tau=#2 q=#3"):
        Recording.read(written(tmp_path, "run.json", ROWS))


def test_what_a_record_lacks_is_no_value(tmp_path: Path) -> None:
    records = [one | ({"temperature": 20.0} if k % 2 else {}) for k, one in enumerate(RECORDS)]
    seen = Recording.read(written(tmp_path, "run.json", records))
    assert "temperature" not in seen
    np.testing.assert_array_equal(seen["q"], Q)


def test_stamps_of_19_digits_keep_every_digit(tmp_path: Path) -> None:
    records = [one | {"t": 1_700_000_000_000_000_001 + 2_000_000 * k} for k, one in enumerate(RECORDS)]
    np.testing.assert_allclose(Recording.read(written(tmp_path, "run.json", records)).t, T, atol=1e-12)


def test_tests_of_sysid_are_recordings_with_names_and_units(tmp_path: Path) -> None:
    rows = np.stack([T, TAU, Q, Q], axis=1).tolist()
    later = [[50 + t, *rest] for t, *rest in rows]
    path = written(tmp_path, "sysid.json", {"sysid": True, "test": "Simple", "units": "Degrees", "a": later, "b": rows})
    with pytest.raises(ManyRecordingsError, match="part=a"):
        Recording.read(path, {"tau": "voltage"}, {"tau": "0.1 N.m"})
    seen = Recording.read(Path(f"{path}:part=b"), {"tau": "voltage"}, {"tau": "0.1 N.m"})
    np.testing.assert_allclose(seen["q"], np.deg2rad(Q))
    assert seen.units["velocity"] == "rad/s"
    np.testing.assert_array_equal(seen.t, T)


def test_the_largest_of_several_tables_is_read_with_a_note(tmp_path: Path) -> None:
    path = written(tmp_path, "run.json", {"motor": COLUMNS, "weather": {"t": [0, 1], "temperature": [20, 21]}})
    assert preview(path).recording.notes[0] == "run: of its tables motor was read; left out: weather."


def test_a_torn_last_line_is_left_out_with_a_note(tmp_path: Path) -> None:
    seen = Recording.read(written(tmp_path, "run.jsonl", LINES + '{"t": 1.0, "q'))
    assert len(seen) == len(T)
    assert "its last line was left out, as it is torn" in seen.notes[0]


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ('{"a": "no numbers"}', "holds no table: neither records"),
        ("[1, 2", "it is no JSON: "),
        (LINES.replace('"q"', "q", 1), "it is no JSON"),
        (LINES[:2000].rpartition("\n")[0] + "\nnot this\n" + LINES, "is no JSON: 'not this'"),
        ("[" * 100_000 + "]" * 100_000, "lists in lists, too deep"),
    ],
)
def test_what_is_no_table_is_refused_in_a_sentence(tmp_path: Path, value: str, said: str) -> None:
    with pytest.raises(RecordingError, match=said):
        Recording.read(written(tmp_path, "run.json", value))


def test_a_text_that_would_fill_the_memory_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="unpacks to"):
        Recording.read(written(tmp_path, "run.json", "[" + "[]," * 2_500_000 + "[]]"))


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("run.wpilog", "export it as CSV with AdvantageScope"),
        ("run.tdms", "a TDMS file of LabVIEW; write it as CSV"),
        ("run.ulg", "ulog2csv"),
        ("run.xlsx", "a spreadsheet; save its table as CSV"),
        ("run.pkl", "a program and is never loaded"),
        ("run.xyz", r"of no known kind, \.xyz; known are: \.csv"),
    ],
)
def test_a_kind_that_is_not_read_says_how_it_becomes_one(tmp_path: Path, name: str, said: str) -> None:
    with pytest.raises(RecordingError, match=said):
        Recording.read(written(tmp_path, name, "x"))
