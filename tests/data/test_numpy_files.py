"""Files of NumPy: arrays by name, tables, structured arrays, and what is refused."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.support.errors import RecordingError

T = np.arange(500) * 2e-3
Q = np.sin(3 * T)
TAU = np.cos(5 * T)


def test_vectors_of_an_archive_are_columns(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", t=T, q=Q, tau=TAU, gain=np.array(3.0))
    seen = Recording.read(tmp_path / "run.npz")
    np.testing.assert_array_equal(seen["q"], Q)
    np.testing.assert_array_equal(seen["tau"], TAU)
    assert not seen.notes


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


def test_arrays_of_another_length_are_left_out_with_a_note(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", t=T, q=Q, tau=TAU, temperatures=np.arange(7.0))
    assert preview(tmp_path / "run.npz").recording.notes == (
        "run: arrays of other lengths were left out: temperatures (7).",
    )


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
