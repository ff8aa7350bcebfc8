"""Command line and page know each kind of file that is read."""

from pathlib import Path

from cosim.data.formats import is_recording
from cosim.support.suffixes import RECORDINGS
from cosim_serve.pages import SUFFIXES


def test_what_is_offered_is_read_and_what_is_read_is_offered(tmp_path: Path) -> None:
    for suffix in (*RECORDINGS, ".toml", ".md"):
        path = tmp_path / f"run{suffix}"
        path.touch()
        assert is_recording(path) == (suffix in RECORDINGS), suffix
        assert suffix not in RECORDINGS or path.suffix in SUFFIXES.split(",")


def test_readers_know_no_other_kind(tmp_path: Path) -> None:
    from cosim.data.formats import _READERS

    assert set(_READERS) == set(RECORDINGS)
