"""What a file declares is judged before it is unpacked; a reader that fails on one costs a sentence, and no more."""

import gzip
import re
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import attack_files
import attack_files_bags
import attack_files_hdf5 as crafted
import h5py
import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from scipy.io import savemat

from cosim.data import limits
from cosim.data.binary import apart
from cosim.data.recording import Recording
from cosim.support.cell import Cell
from cosim.support.errors import MissingPackageError, RecordingError
from cosim_readers import hdf5, hdf5_chunks

T = np.arange(400) * 1e-2
AXIS = {"t": T, "tau": np.cos(T), "q": np.sin(T)}
COMPUTED = r"a table of it is computed \(a view, a function, a recursion\)"
LARGE = "unpacks to .* or more; a file of its size .* may unpack to 200 MB"
SAYS = {
    "bag: messages are a view without end": COMPUTED,
    "bag: topics are a view without end": COMPUTED,
    "bag: messages are a view of a table joined with itself four times": COMPUTED,
    "bag: the bytes of a message are computed: a hundred million zeros each": COMPUTED,
    "bag: nothing wrong": "",
    "mcap: one message of millions of zeros, packed": "has .*00,001 columns; a recording has at most 10,000",
    "mcap: messages that hold a text of a megabyte each, packed": "has 125,001 columns",
    "parquet: one list of fifty million numbers in a row": f"{LARGE}|^$",
    "parquet: cells of a megabyte of fixed length": LARGE,
    "bag: the bytes of a message are those of another column, doubled 24 times": COMPUTED,
    "mdf: an mdf whose group claims a million million records": f"{LARGE}|cannot be read",
}
"""Crafted files and what is said of each; empty where it is read."""


@pytest.mark.parametrize("name", SAYS)
def test_a_crafted_file_is_refused_for_what_it_declares(name: str, tmp_path: Path) -> None:
    path, said = attack_files.made(name, 5, tmp_path), ""
    try:
        Recording.read(path, columns={"q": "a.position", "tau": "a.effort"} if "nothing" in name else {})
    except RecordingError as error:
        said = str(error)
    assert bool(said) == bool(SAYS[name]) or SAYS[name].endswith("^$")
    assert re.search(SAYS[name], said), said


def test_packed_variables_and_texts_count_by_what_they_unpack_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cells = np.empty(50, dtype=object)
    cells[:] = [np.zeros(1000) for _ in cells]
    savemat(tmp_path / "run.mat", AXIS | {"c": cells}, do_compression=True)
    assert len(Recording.read(tmp_path / "run.mat")) == 400
    monkeypatch.setattr(limits, "UNPACKED", 300_000)
    with pytest.raises(RecordingError, match=r"unpacks to .* may unpack to 300 kB.*--layout limit=2"):
        Recording.read(tmp_path / "run.mat")
    monkeypatch.undo()
    path, text = tmp_path / "run.parquet", "x" * 400_000
    parquet.write_table(pa.table(AXIS | {"s": [text, None] * 200}), path)
    kept = Recording.read(path).others["s"]
    assert len({id(one) for one in kept}) == 2
    assert [len(one or "") for one in kept[:2]] == [400_000, 0]
    parquet.write_table(pa.table(AXIS | {"s": ["x" * 600_000] * 400}), path)
    with pytest.raises(RecordingError, match=rf"column s {LARGE}.*--layout limit=2"):
        Recording.read(path)


def test_a_topic_of_images_is_left_out_by_name_and_the_joints_are_read(tmp_path: Path) -> None:
    path = tmp_path / "run.db3"
    add = "INSERT INTO topics VALUES (2, '/camera', 'sensor_msgs/msg/JointState');"
    attack_files_bags.written(
        path, f"{add} INSERT INTO messages(topic_id, timestamp, data) VALUES (2, 5, zeroblob(90000));"
    )
    read = Recording.read(path, {"q": "a.position", "tau": "a.effort"})
    assert len(read) == 200
    assert "/camera" in " ".join(read.notes)


def test_lines_of_one_number_are_counted_before_they_become_objects(tmp_path: Path) -> None:
    """26 million lines in 52 kB of gzip: refused with hardly more in memory than the text."""
    path = tmp_path / "run.csv.gz"
    path.write_bytes(gzip.compress(b"0\n" * 26_000_000, 9))
    tracemalloc.start()
    try:
        with pytest.raises(RecordingError, match="26,000,000 numbers"):
            Recording.read(path)
        assert tracemalloc.get_traced_memory()[1] < 4 * 52e6
    finally:
        tracemalloc.stop()


# A recording in HDF5, which MAT 7.3 is, is read from its own file alone, and costs what it holds.

FOREIGN = [make for make in crafted.MAKERS if make.__name__.endswith("_elsewhere")]


def as_mat(path: Path) -> Path:
    """Put the head of a MAT 7.3 file in front of an HDF5 file."""
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    made = path.with_suffix(".mat")
    made.write_bytes(head.ljust(512, b"\x00") + path.read_bytes())
    return made


@pytest.mark.parametrize("suffix", [".h5", ".mat"])
@pytest.mark.parametrize("make", FOREIGN, ids=lambda make: make.__name__)
@pytest.mark.parametrize("seed", [1, 2])
def test_what_leads_to_another_file_is_refused(tmp_path: Path, make: crafted.Maker, suffix: str, seed: int) -> None:
    (tmp_path / "secret.bin").write_bytes(bytes(range(33, 126)) * 40)
    make(Random(seed), tmp_path / "run.h5")
    path = as_mat(tmp_path / "run.h5") if suffix == ".mat" else tmp_path / "run.h5"
    with pytest.raises(RecordingError, match=r"a recording is read from its own file alone\. Copy it into one"):
        Recording.read(path)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (crafted.large_chunk, r'a chunk of "q" unpacks to .* [MG]B or more'),
        (crafted.chunk_bomb, r'"q" has a chunk that unpacks to more than the 3,200 bytes of a chunk'),
        (crafted.chunk_bomb_lzf, r'"q" has a chunk that unpacks to more than the 3,200 bytes of a chunk'),
        (crafted.packed_twice, r'"q" is packed twice'),
        (crafted.virtual_of_itself, r'"q" is put together from other datasets'),
    ],
    ids=lambda one: getattr(one, "__name__", ""),
)
def test_what_costs_more_than_it_holds_is_refused(tmp_path: Path, make: crafted.Maker, sentence: str) -> None:
    make(Random(3), tmp_path / "run.h5")
    with pytest.raises(RecordingError, match=sentence):
        Recording.read(tmp_path / "run.h5")


def test_numbers_that_were_never_written_are_counted_and_links_and_odd_units_are_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        run = file.create_group("run")
        run.update(AXIS)
        file["latest"] = h5py.SoftLink("/run")
        run["above"] = file
    assert np.array_equal(Recording.read(path).table["q"], np.sin(T))
    crafted.large_attribute(Random(1), path)
    assert set(Recording.read(path).units) == {"t"}  # a unit that is no text states none
    with h5py.File(path, "w") as file:
        for name in AXIS:
            file.create_dataset(name, (80_000_000,), "f8", chunks=(1 << 20,), compression="gzip")
    with pytest.raises(RecordingError, match=r"holds 240,000,000 numbers; .* --layout limit=10\."):
        Recording.read(path)


OPTIONS = [
    {},
    {"compression": "gzip", "shuffle": True, "fletcher32": True},
    {"compression": "gzip", "fletcher32": True, "chunks": (100,)},
    {"compression": "lzf", "chunks": (100,)},
    {"scaleoffset": 6},
    {"chunks": (7,), "maxshape": (None,)},
    {"chunks": (150,), "compression": "gzip"},
]


@pytest.mark.parametrize("harmless", [hdf5_chunks.HARMLESS, 1000])
@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_chunks_that_are_what_they_say_are_read_and_large_ones_are_unpacked_for_trial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: dict[str, object], harmless: int
) -> None:
    monkeypatch.setattr(hdf5_chunks, "HARMLESS", harmless)
    monkeypatch.setattr(hdf5_chunks, "CELLS", min(hdf5_chunks.CELLS, harmless // 16))
    with h5py.File(tmp_path / "run.h5", "w") as file:
        for name, values in AXIS.items():
            file.create_dataset(name, data=values, **options)
    assert np.allclose(hdf5.read(tmp_path / "run.h5").values["q"], np.sin(T), atol=1e-5)


# A library that crashes, hangs or takes too much memory on a file costs a sentence, and the next file is read.

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
@pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")
@pytest.mark.usefixtures("tight")
def test_a_reader_that_fails_costs_a_sentence_and_the_next_file_is_read(
    tmp_path: Path, readers: Callable[[str], apart.Reader], capfd: pytest.CaptureFixture[str], name: str, sentence: str
) -> None:
    path = tmp_path / "run.h5"
    path.write_bytes(b"x")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(limits, "SECONDS", 9.0 if name == "grow" else 0.3)  # a busy machine is slow to give memory
        if name == "sleep":  # it ends alike, however soon, and nothing is done meanwhile
            patch.setattr(apart, "PATIENCE", 3.0)
        with pytest.raises(RecordingError, match=sentence):
            apart.read_apart(path, ".h5", readers(name))
    assert list(apart.read_apart(path, ".h5", readers("speak")).values["t"]) == [0, 1, 2]
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("name", "package"), [("run.h5", "h5py"), ("run.mf4", "asammdf")])
@pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")
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
