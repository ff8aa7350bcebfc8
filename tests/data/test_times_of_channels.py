"""Vectors of time of their own lengths in MAT, HDF5, NumPy and Parquet files: each channel is read at its own times."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from scipy.io import savemat

from cosim.data.recording import Recording
from cosim.support.errors import UndecidedError

TA, TQ = np.arange(2000) / 1000, 3e-4 + np.arange(1000) / 500
TAU, Q = np.cos(9 * TA), 0.1 * np.sin(9 * TQ)
Arrays = Mapping[str, np.ndarray]


def npz(path: Path, arrays: Arrays) -> Path:
    np.savez(path.with_suffix(".npz"), **arrays)
    return path.with_suffix(".npz")


def mat(path: Path, arrays: Arrays) -> Path:
    savemat(path.with_suffix(".mat"), dict(arrays))
    return path.with_suffix(".mat")


def structs(path: Path, arrays: Arrays) -> Path:
    first, second = ([*arrays.values()][start : start + 2] for start in (0, 2))
    whole = {"torque": {"time": first[0], "data": first[1]}, "angle": {"time": second[0], "data": second[1]}}
    savemat(path.with_suffix(".mat"), whole)
    return path.with_suffix(".mat")


def simulink(path: Path, arrays: Arrays) -> Path:
    first, second = ([*arrays.values()][start : start + 2] for start in (0, 2))
    whole = {"tau": first, "q": second}
    logs = {name: {"time": t, "signals": {"values": x, "label": "", "dimensions": 1}} for name, (t, x) in whole.items()}
    savemat(path.with_suffix(".mat"), logs)
    return path.with_suffix(".mat")


def hdf5(path: Path, arrays: Arrays) -> Path:
    h5py = pytest.importorskip("h5py")
    names = ("drive/timestamp", "drive/torque", "encoder/timestamp", "encoder/angle")
    with h5py.File(path.with_suffix(".h5"), "w") as file:
        for name, (own, column) in zip(names, arrays.items(), strict=True):
            file[name] = column
            file[name].attrs["unit"] = "ms" if own.endswith("ms") else "s" if "t_" in own else "1"
    return path.with_suffix(".h5")


def lists(path: Path, arrays: Arrays) -> Path:
    parquet.write_table(pa.table({name: [one.tolist()] for name, one in arrays.items()}), path.with_suffix(".parquet"))
    return path.with_suffix(".parquet")


def columns(path: Path, arrays: Arrays) -> Path:
    rows = max(map(len, arrays.values()))
    padded = {name: np.append(one, np.full(rows - len(one), np.nan)) for name, one in arrays.items()}
    ordered = {name: padded[name] for name in sorted(padded, key=lambda name: name.startswith("t_"))}
    parquet.write_table(pa.table(ordered), path.with_suffix(".parquet"))
    return path.with_suffix(".parquet")


WRITERS = (npz, mat, structs, simulink, hdf5, lists, columns)


@pytest.mark.parametrize("write", WRITERS)
def test_a_time_for_each_channel_is_read_whatever_the_format(tmp_path: Path, write: Callable[..., Path]) -> None:
    path = write(tmp_path / "run", {"t_tau": TA, "tau": TAU, "t_q": TQ, "q": Q})
    seen = Recording.read(path)
    assert {*seen.columns} == {"t", "tau", "q"}
    np.testing.assert_allclose(seen.t, TQ, atol=1e-12)
    np.testing.assert_allclose(seen["q"], Q, atol=1e-12)
    np.testing.assert_allclose(seen["tau"], np.cos(9 * TQ), atol=2e-5)
    assert "by its mean over each row's interval" in " ".join(seen.notes)


@pytest.mark.parametrize("write", [npz, mat, lists, columns])
def test_times_of_one_length_belong_to_the_channels_that_they_are_named_after(
    tmp_path: Path, write: Callable[..., Path]
) -> None:
    late = TA + 3e-4
    seen = Recording.read(write(tmp_path / "run", {"t_tau": TA, "tau": TAU, "t_q": late, "q": 0.1 * np.sin(9 * late)}))
    np.testing.assert_allclose(seen["q"], 0.1 * np.sin(9 * seen.t), atol=1e-9)
    np.testing.assert_allclose(seen["tau"], np.cos(9 * seen.t), atol=2e-5)


def test_a_device_has_one_time_for_its_channels_and_a_unit_of_its_own(tmp_path: Path) -> None:
    arrays = {"t_drive_ms": 1e3 * TA, "drive_torque": TAU, "drive_load": TAU**2, "t_encoder": TQ, "encoder_angle": Q}
    seen = Recording.read(npz(tmp_path / "run", arrays))
    assert {*seen.columns} == {"t", "tau", "q", "drive_load"}
    np.testing.assert_allclose(seen["tau"], np.cos(9 * seen.t), atol=2e-5)


def test_arrays_without_a_time_of_their_length_are_named(tmp_path: Path) -> None:
    arrays = {"t_tau": TA, "tau": TAU, "t_q": TQ, "q": Q, "gains": np.arange(7.0)}
    assert (
        "run: arrays without a time of their length were left out: gains."
        in Recording.read(npz(tmp_path / "run", arrays)).notes
    )


def test_the_owner_may_say_which_time_is_meant(tmp_path: Path) -> None:
    path = npz(tmp_path / "run", {"t_tau": TA, "tau": TAU, "q_raw": 0.1 * np.sin(9 * TA), "t_2": TQ, "noise": Q})
    seen = Recording.read(path, {"t": "t_tau", "q": "q_raw"})
    np.testing.assert_array_equal(seen["tau"], TAU)


def test_samples_of_one_time_that_differ_are_asked_for_in_a_channel_too(tmp_path: Path) -> None:
    stands = TA.copy()
    stands[700] = stands[699]
    path = npz(tmp_path / "run", {"t_tau": stands, "tau": TAU, "t_q": TQ, "q": Q})
    with pytest.raises(UndecidedError, match=r"values differ at its sample 701 .* --layout repeated=first"):
        Recording.read(path)
    assert len(Recording.read(path, layout={"repeated": "last"})) == len(TQ) - 1  # its interval is half empty
