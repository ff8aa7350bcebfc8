"""A library that crashes, hangs or takes too much memory on a file costs a sentence, and the next file is read."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from cosim.data import limits
from cosim.data.binary import apart
from cosim.data.recording import Recording
from cosim.support.cell import Cell
from cosim.support.errors import MissingPackageError, RecordingError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")
READERS = """
import os, sys, time

def crash(path):
    os.abort()

def spin(path):
    while True:
        pass

def sleep(path):
    time.sleep(1000)

def grow(path):
    return [bytearray(10**7) for _ in range(10**6)]

def fail(path):
    raise KeyError("block 7 of the file")

def speak(path):
    print("a library says something", file=sys.stderr)
    from cosim.data.columns import Columns
    import numpy as np
    return Columns({"t": np.arange(3.0)})
"""


@pytest.fixture
def readers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], apart.Reader]]:
    """Readers by name, of a module that the process of readers can import too."""
    (tmp_path / "odd_readers.py").write_text(READERS)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.syspath_prepend(str(tmp_path))
    cell = Cell()
    monkeypatch.setattr(apart, "_CELL", cell)
    import odd_readers

    yield lambda name: getattr(odd_readers, name)
    cell.close()
    del sys.modules["odd_readers"]


@pytest.fixture
def tight(monkeypatch: pytest.MonkeyPatch) -> None:
    """Limits that are soon passed; a process that starts beside busy ones has 9 s of the clock."""
    monkeypatch.setattr(limits, "SECONDS", 0.3)
    monkeypatch.setattr(limits, "UNPACKED", 30_000_000)
    monkeypatch.setattr(apart, "PATIENCE", 30.0)


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("crash", r"run\.h5 is damaged: the library that reads \.h5 files crashed on it \(exit code -6\)\."),
        ("spin", r"run\.h5 took more than 0\.3 s of a processor to read; .* --layout limit=3\."),
        ("sleep", r"run\.h5 took more than 0\.3 s of a processor to read; .* --layout limit=3\."),
        ("grow", r"run\.h5 takes more memory to read than what unpacks to 30 MB does; .* --layout limit=2\."),
        ("fail", r"run\.h5 cannot be read as \.h5: 'block 7 of the file'\."),
    ],
)
@pytest.mark.usefixtures("tight")
def test_a_reader_that_fails_costs_a_sentence_and_the_next_file_is_read(
    tmp_path: Path, readers: Callable[[str], apart.Reader], capfd: pytest.CaptureFixture[str], name: str, sentence: str
) -> None:
    path = tmp_path / "run.h5"
    path.write_bytes(b"x")
    with pytest.MonkeyPatch.context() as patch:
        if name == "sleep":  # it ends alike, however soon, and nothing is done meanwhile
            patch.setattr(apart, "PATIENCE", 3.0)
        with pytest.raises(RecordingError, match=sentence):
            apart.read_apart(path, ".h5", readers(name))
    assert list(apart.read_apart(path, ".h5", readers("speak")).values["t"]) == [0, 1, 2]
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("name", "package"), [("run.h5", "h5py"), ("run.mf4", "asammdf")])
@pytest.mark.usefixtures("readers")
def test_a_format_whose_package_is_missing_says_how_to_get_it(tmp_path: Path, name: str, package: str) -> None:
    # Where this package is installed beside the reader's, no other folder comes before them: the import is forbidden.
    (tmp_path / "sitecustomize.py").write_text(f"import sys\nsys.modules[{package!r}] = None\n")
    (tmp_path / name).write_text("x")
    with pytest.raises(MissingPackageError, match=rf'needs the package {package} to be read: pip install "{package}>='):
        Recording.read(tmp_path / name)


def test_what_a_reader_returns_arrives_whole(tmp_path: Path) -> None:
    t = np.arange(400) * 1e-2
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["t"], file["tau"], file["q"], file["gain"] = t, np.cos(t), np.sin(t), np.zeros(7)
        file["q"].attrs["unit"] = "deg"
    read = Recording.read(tmp_path / "run.h5")
    assert np.allclose(read.table["q"], np.radians(np.sin(t)))
    assert read.units["q"] == "rad"
    assert any("left out: gain (7)" in note for note in read.notes)
