"""Files of NumPy: arrays by name, tables, structured arrays, and what is refused."""

import io
import subprocess
import sys
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pytest
import scipy.io
from pyarrow import parquet

from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.data.text.table import as_array
from cosim.support.errors import RecordingError

T = np.arange(500) * 2e-3
Q = np.sin(3 * T)
TAU = np.cos(5 * T)


@pytest.mark.parametrize("by_columns", [False, True])
def test_a_table_of_joints_is_asked_for_the_joint(tmp_path: Path, by_columns: bool) -> None:
    q = np.stack([Q, 2 * Q, 3 * Q], axis=1)
    stored = np.asfortranarray(q) if by_columns else q
    np.savez_compressed(tmp_path / "arm.npz", time=T, q=stored, tau_measured=TAU)
    with pytest.raises(RecordingError, match=r"q may be any of q_1, q_2, q_3.*--columns q=q_1"):
        Recording.read(tmp_path / "arm.npz")
    np.testing.assert_array_equal(Recording.read(tmp_path / "arm.npz", {"q": "q_2"})["q"], 2 * Q)


def test_a_text_vector_names_the_columns_of_a_table(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", data=np.stack([T, Q, TAU]), columns=np.array(["t", "q", "tau"]))
    np.testing.assert_array_equal(Recording.read(tmp_path / "run.npz")["q"], Q)


def test_fields_of_a_structured_array_are_columns(tmp_path: Path) -> None:
    table = np.empty(len(T), dtype=[("t", "f8"), ("q", "f4"), ("tau", "f8")])
    table["t"], table["q"], table["tau"] = T, Q, TAU
    np.save(tmp_path / "run.npy", table)
    np.testing.assert_allclose(Recording.read(tmp_path / "run.npy")["q"], Q, atol=1e-7)


def test_a_matrix_without_names_is_asked_for_them(tmp_path: Path) -> None:
    np.save(tmp_path / "run.npy", np.stack([T, TAU, Q], axis=1))
    with pytest.raises(RecordingError, match=r"does not name its 3 columns; .*--columns t=#1 tau=#2 q=#3"):
        Recording.read(tmp_path / "run.npy")
    seen = Recording.read(tmp_path / "run.npy", {"t": "#1", "tau": "#2", "q": "#3"})
    np.testing.assert_array_equal(seen["q"], Q)


def test_a_note_on_arrays_does_not_forbid_a_period(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", q=Q, tau=TAU, edges=np.arange(7.0))
    seen = Recording.read(tmp_path / "run.npz", layout={"period": "2ms"})
    np.testing.assert_allclose(seen.t, T)


def test_pickled_objects_are_never_loaded(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", t=T, q=Q, tau=TAU, settings=np.array([{"a": 1}], dtype=object))
    assert (
        "pickled objects were left out, as they are programs: settings" in Recording.read(tmp_path / "run.npz").notes[0]
    )
    np.save(tmp_path / "run.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(RecordingError, match="holds pickled objects, which are programs"):
        Recording.read(tmp_path / "run.npy")


def test_a_header_that_claims_more_than_the_file_holds_is_refused(tmp_path: Path) -> None:
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
    (tmp_path / "huge.npy").write_bytes(file.getvalue() + bytes(80))
    with pytest.raises(RecordingError, match=r"huge.npy unpacks to 8 TB or more|huge.npy unpacks to 8,000 GB or more"):
        Recording.read(tmp_path / "huge.npy")
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": (1000,)})
    (tmp_path / "cut.npy").write_bytes(file.getvalue() + bytes(80))
    with pytest.raises(RecordingError, match=r"cut.npy ends after 80 of 8,000 bytes of an array of shape \(1000,\)"):
        Recording.read(tmp_path / "cut.npy")


def test_an_archive_that_unpacks_to_far_more_than_its_size_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        file = io.BytesIO()
        np.save(file, np.zeros(4_000_000))
        for number in range(8):
            archive.writestr(f"x{number}.npy", file.getvalue())
    with pytest.raises(RecordingError, match="unpacks to 256 MB or more"):
        Recording.read(tmp_path / "bomb.npz")


def test_an_archive_without_arrays_of_numbers_says_what_it_holds(tmp_path: Path) -> None:
    np.savez(tmp_path / "texts.npz", names=np.array(["a", "b"]))
    with pytest.raises(RecordingError, match=r"texts.npz holds no arrays of numbers; it holds: names\."):
        Recording.read(tmp_path / "texts.npz")


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
def test_doubles_are_the_same_in_one_chunk_and_in_several(column: pa.Array) -> None:
    expected = VALUES if len(column) == len(VALUES) else VALUES[3:8]
    assert np.array_equal(as_array(column), expected)
    chunked = pa.chunked_array([column, column.slice(0, 0), column.slice(1)])
    assert np.array_equal(as_array(chunked), np.concatenate([expected, expected[1:]]))


def test_what_is_missing_is_no_number_and_no_rows_are_none() -> None:
    assert np.isnan(as_array(pa.chunked_array([pa.array([1.0, None])]))).tolist() == [False, True]
    assert as_array(pa.chunked_array([], pa.float64())).shape == (0,)


def test_a_table_of_numbers_is_read_without_pandas(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    parquet.write_table(pa.table({"t": VALUES, "q": VALUES**2}), path)
    done = subprocess.run([sys.executable, "-c", READ], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


# Columns inside columns: lists and structs of Parquet, structs of MAT files, and objects that only MATLAB can open.

JOINTS = np.stack([Q, 2 * Q, 3 * Q], axis=1)


@pytest.mark.parametrize("kind", [pa.list_(pa.float32(), 3), pa.list_(pa.float64()), pa.large_list(pa.float64())])
def test_lists_of_one_length_are_columns(tmp_path: Path, kind: pa.DataType) -> None:
    table = pa.table({"timestamp": T, "observation.state": pa.array(JOINTS.tolist(), kind), "tau": TAU})
    parquet.write_table(table, tmp_path / "episode.parquet")
    seen = Recording.read(tmp_path / "episode.parquet", {"q": "observation.state.2"})
    np.testing.assert_allclose(seen["q"], 2 * Q, atol=1e-6)


def test_fields_of_structs_and_lists_in_lists_are_columns(tmp_path: Path) -> None:
    nested = pa.array([[[q, 0.0]] for q in Q], pa.list_(pa.list_(pa.float64(), 2), 1))
    joint = pa.array([{"position": q, "name": "az"} for q in Q])
    parquet.write_table(pa.table({"t": T, "tau": TAU, "action": nested, "joint": joint}), tmp_path / "run.parquet")
    columns = {"q": "joint.position", "other": "action.1.1"}
    seen = Recording.read(tmp_path / "run.parquet", columns)
    np.testing.assert_array_equal(seen["q"], Q)
    np.testing.assert_array_equal(seen["other"], Q)


def test_lists_of_several_lengths_are_left_out_with_a_note(tmp_path: Path) -> None:
    ragged = pa.array([[1.0] * (1 + k % 2) for k in range(len(T))])
    parquet.write_table(pa.table({"t": T, "q": Q, "tau": TAU, "x": ragged}), tmp_path / "run.parquet")
    assert 'column "x" was left out' in Recording.read(tmp_path / "run.parquet").notes[0]


def test_lists_that_would_be_too_many_columns_are_refused(tmp_path: Path) -> None:
    wide = pa.array([np.zeros(20_000).tolist()] * 3, pa.list_(pa.float64(), 20_000))
    parquet.write_table(pa.table({"t": T[:3], "x": wide}), tmp_path / "run.parquet")
    with pytest.raises(RecordingError, match="has 20,000 columns; a recording has at most 10,000"):
        Recording.read(tmp_path / "run.parquet")


def test_a_structure_with_time_of_simulink_is_its_signals(tmp_path: Path) -> None:
    signals = np.array([(Q[:, None], "q"), (TAU[:, None], "tau")], dtype=[("values", "O"), ("label", "O")])
    scipy.io.savemat(tmp_path / "out.mat", {"ScopeData": {"time": T, "signals": signals, "blockName": "m/Scope"}})
    seen = Recording.read(tmp_path / "out.mat", {"t": "time"})
    np.testing.assert_array_equal(seen["q"], Q)
    np.testing.assert_array_equal(seen["tau"], TAU)


@pytest.mark.parametrize(
    ("label", "column"), [("", "x_2"), (np.array(["one", "two", "three"], object), "two"), ("all", "all_2")]
)
def test_a_signal_of_several_values_is_several_columns(tmp_path: Path, label: object, column: str) -> None:
    """Named by as many labels as there are values; by one label, or the structure, and a number else."""
    scipy.io.savemat(
        tmp_path / "out.mat", {"x": {"time": T, "signals": {"values": JOINTS, "label": label}}, "tau": TAU}
    )
    np.testing.assert_array_equal(Recording.read(tmp_path / "out.mat", {"t": "time", "q": column})["q"], 2 * Q)


def test_a_recording_of_controldesk_has_the_names_and_units_of_its_signals(tmp_path: Path) -> None:
    fields = [("Name", "O"), ("Data", "O"), ("Unit", "O")]
    signals = np.array([("'Model Root/Plant/angle'", Q, "deg"), ("'Model Root/tau'", TAU, "N.m")], dtype=fields)
    scipy.io.savemat(tmp_path / "rec.mat", {"rec": {"X": {"Name": "", "Data": T}, "Y": signals, "Description": "d"}})
    seen = Recording.read(tmp_path / "rec.mat")
    np.testing.assert_allclose(seen["q"], np.deg2rad(Q))
    np.testing.assert_array_equal(seen["tau"], TAU)


def test_fields_of_one_name_in_two_structs_keep_both(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "run.mat", {"t": T, "tau": TAU, "az": {"q": Q}, "alt": {"q": 2 * Q}})
    np.testing.assert_array_equal(Recording.read(tmp_path / "run.mat", {"q": "az.q"})["q"], Q)
    np.testing.assert_array_equal(Recording.read(tmp_path / "run.mat", {"q": "alt.q"})["q"], 2 * Q)


def test_arrays_of_another_length_are_noted(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "run.mat", {"t": T, "q": Q, "tau": TAU, "slow": np.arange(9.0)})
    assert preview(tmp_path / "run.mat").recording.notes == ("run: arrays of other lengths were left out: slow (9).",)


def test_objects_of_matlab_are_refused_with_the_way_out(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "objects.mat", "w", userblock_size=512) as file:
        handle = file.create_dataset("data", data=np.array([[3707764736, 2, 1, 1, 1, 1]], dtype=np.uint32))
        handle.attrs["MATLAB_object_decode"] = np.int32(3)
        file.create_group("#refs#").create_dataset("a", data=np.arange(500.0))
        file.create_group("#subsystem#")
    raw = (tmp_path / "objects.mat").read_bytes()
    (tmp_path / "objects.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(128) + raw[128:])
    with pytest.raises(RecordingError, match=r"holds MATLAB objects .*, which only MATLAB can open\. There, save"):
        Recording.read(tmp_path / "objects.mat")


def test_numbers_beside_an_object_of_matlab_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scipy.io.savemat(tmp_path / "run.mat", {"t": T, "q": Q, "tau": TAU})

    def fails(path: object) -> None:
        raise TypeError("'NoneType' object is not iterable")

    monkeypatch.setattr(scipy.io, "whosmat", fails)
    np.testing.assert_array_equal(Recording.read(tmp_path / "run.mat")["q"], Q)
