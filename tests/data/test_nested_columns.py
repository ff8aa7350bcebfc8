"""Columns inside columns: lists and structs of Parquet, structs of MAT files, and objects that only MATLAB can open."""

from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pytest
import scipy.io
from pyarrow import parquet

from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.support.errors import RecordingError

T = np.arange(500) * 2e-3
Q = np.sin(3 * T)
TAU = np.cos(5 * T)
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


def test_a_signal_of_several_values_is_several_columns(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "out.mat", {"x": {"time": T, "signals": {"values": JOINTS, "label": ""}}, "tau": TAU})
    np.testing.assert_array_equal(Recording.read(tmp_path / "out.mat", {"t": "time", "q": "x_2"})["q"], 2 * Q)


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
