"""Whatever a file holds, reading it costs bounded memory and time, and ends in a recording or in one sentence."""

import gc
import gzip
import json
import random
import re
import resource
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pytest
from damages import damaged
from pyarrow import parquet
from scipy.io import savemat

from cosim.cli import main
from cosim.data import limits
from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.support.errors import CosimError, RecordingError

SAMPLES = Path(__file__).parents[1] / "samples"
ROWS = 400
T = np.arange(ROWS) * 1e-3
TABLE = {"t": T, "tau": np.cos(9 * T), "q": np.sin(9 * T)}


def csv_text(table: dict[str, np.ndarray]) -> str:
    lines = [",".join(table)] + [",".join(repr(float(x)) for x in row) for row in zip(*table.values(), strict=True)]
    return "\n".join(lines) + "\n"


def written(path: Path, data: str | bytes) -> Path:
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


@contextmanager
def bounded(megabytes: float) -> Iterator[None]:
    """Fail if the block raises the peak of memory by more."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak) / 1024 < megabytes


GARBLED = {name: np.where(np.arange(ROWS) == 2, 1e184, TABLE[of]) for name, of in (("q", "q"), ("current", "tau"))}
ALTERNATING = np.concatenate([[0.0], np.cumsum(np.resize([1e-9, 1e-9, 0.01], ROWS - 1))])
NUMBERS = {
    "1e308": ({"tau": 1e308 * np.sign(TABLE["tau"])}, 'column "tau" holds 1e+308 at row 1, which is beyond any axis.'),
    "a garbled row": (GARBLED, 'column "q" holds 1e+184 at row 3, which is beyond any axis.'),
    "5e9 s between samples": ({"t [s]": 5e9 * np.arange(ROWS), "t": None}, "is sampled every 5e+09 s; an axis is"),
    "a time of no known unit": ({"t": 5e9 * np.arange(ROWS)}, "Say which with --units t=ms."),
    "1e-9 s and 0.01 s in turns": ({"t": ALTERNATING}, "half of its time steps are 1e-09 s or less and others 0.01 s:"),
}  # fmt: skip


@pytest.mark.parametrize("what", NUMBERS)
def test_numbers_that_no_axis_has_are_refused(tmp_path: Path, what: str) -> None:
    changed, sentence = NUMBERS[what]
    table = {name: column for name, column in (changed | TABLE | changed).items() if column is not None}
    with pytest.raises(RecordingError, match=re.escape(sentence)):
        Recording.read(written(tmp_path / "run.csv", csv_text(table)))


def a_million_columns() -> bytes:
    row = ",".join(["1"] * 10**6)
    return f"{','.join(f'c{number}' for number in range(10**6))}\n{row}\n{row}\n".encode()


def a_gigabyte() -> bytes:
    return gzip.compress(b"t,tau,q\n") + 250 * gzip.compress(b"0.001,1,2\n" * 400_000)


@pytest.mark.parametrize(
    ("name", "made", "megabytes", "sentence"),
    [
        ("run.csv", a_million_columns, 600, "has 1,000,000 columns; a recording has at most 10,000."),
        ("run.csv.gz", a_gigabyte, 500, r"to 20\d MB or more; a file .* may unpack to 200 MB: .* limit=2\."),
    ],
)
def test_what_is_far_too_much_is_refused_before_it_is_parsed(
    tmp_path: Path, name: str, made: Callable[[], bytes], megabytes: float, sentence: str
) -> None:
    path = written(tmp_path / name, made())
    with bounded(megabytes), pytest.raises(RecordingError, match=sentence):
        Recording.read(path)


@pytest.mark.parametrize(
    ("bound", "most", "name", "sentence"),
    [
        ("TEXT", 1000, "run.csv", r"more than 1 kB of text; write it as Parquet, cut it in pieces, or .* limit=\d+"),
        ("COLUMNS", 2, "run.csv", r"has 3 columns; a recording has at most 2\."),
        ("COLUMNS", 2, "run.parquet", r"has 3 columns; a recording has at most 2\."),
    ],
)
def test_a_bound_holds_where_files_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bound: str, most: int, name: str, sentence: str
) -> None:
    path = Recording("run", TABLE).write(tmp_path / name)
    monkeypatch.setattr(limits, bound, most)
    with pytest.raises(RecordingError, match=sentence):
        Recording.read(path)


@pytest.mark.parametrize("origin", ["5", '"text"', "[1]", "null", "true", '{"file": 7, "version": ["x"]}', "{" * 5000])
def test_an_origin_may_be_anything(tmp_path: Path, origin: str) -> None:
    table = pa.table(TABLE).replace_schema_metadata({b"cosim.origin": origin.encode()})
    parquet.write_table(table, tmp_path / "odd.parquet")
    recording = Recording.read(tmp_path / "odd.parquet")
    assert len(recording.sha256) == 64
    assert ["its origin was left out" in note for note in recording.notes] == [True] * (origin[1:6] != '"file')


def test_messages_stay_short_however_long_names_are(tmp_path: Path) -> None:
    table = {f"{'x' * 5000}{number}": column for number, column in enumerate(TABLE.values())}
    with pytest.raises(RecordingError) as caught:
        Recording.read(written(tmp_path / "run.csv", csv_text(table)), {"tau": "y" * 9000})
    assert len(str(caught.value)) < 1000


SENTENCES: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "nothing": ("run.csv", bytes, "is empty"),
    "one blank line": ("run.csv", lambda: b"\n", "holds no samples"),
    "names alone": ("run.csv", lambda: b"t,tau,q\n", "holds no samples"),
    "noise": ("run.csv", lambda: random.Random(1).randbytes(4000), "is no text"),
    "a picture": ("run.csv", lambda: b"\x89PNG\r\n\x1a\n" + random.Random(2).randbytes(4000), "is no text"),
    "zero bytes at the end": ("run.csv", lambda: csv_text(TABLE).encode() + bytes(512), "holds a zero byte at byte"),
    "zero bytes only": ("run.csv", lambda: bytes(4096), "holds no table|is no text|zero byte"),
    "words": ("run.csv", lambda: b"hello world\nand so on\n", "no table of numbers; its first line is: 'hello world'"),
    "JSON": ("run.csv", lambda: json.dumps({"t": [0.1]}, indent=1).encode(), "no table of numbers|at least 2 are"),
    "UTF-8 that is none later": (
        "run.csv",
        lambda: b"\xef\xbb\xbf" + csv_text(TABLE).encode() + b"0.1,\x9d,3,4\n1,2,3\n",
        "holds bytes that are no UTF-8; --layout encoding=cp1252",
    ),
    "half a gzip": ("run.csv.gz", lambda: gzip.compress(csv_text(TABLE).encode())[:-900], "cannot be read as .csv.gz"),
    "no gzip": ("run.csv.gz", lambda: b"t,tau,q\n1,2,3\n", "cannot be read as .csv.gz: Not a gzipped file"),
    "no Parquet": ("run.parquet", lambda: b"PAR1" + bytes(90), "cannot be read as .parquet"),
    "no MAT": ("run.mat", lambda: b"MATLAB 5.0 MAT-file" + bytes(200), "cannot be read as .mat|holds no samples"),
    "no HDF5": ("run.h5", lambda: b"\x89HDF\r\n\x1a\n" + bytes(90), "cannot be read as .h5|needs the package h5py"),
    "no MDF": ("run.mf4", lambda: b"MDF     4.10    " + bytes(90), "cannot be read as .mf4|needs the package asammdf"),
    "no MCAP": ("run.mcap", lambda: b"\x89MCAP0\r\n" + bytes(90), "cannot be read as .mcap|needs the package mcap"),
    "no bag": ("run.db3", lambda: b"SQLite format 3\x00" + bytes(90), "cannot be read as .db3|needs the package mcap"),
    "a bag of messages that are not defined": ("run.db3", lambda: b"", "is empty"),
}  # fmt: skip


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("what", SENTENCES)
def test_what_is_no_recording_is_one_sentence(tmp_path: Path, what: str, capsys: pytest.CaptureFixture[str]) -> None:
    name, data, sentence = SENTENCES[what]
    path = written(tmp_path / name, data())
    with pytest.raises(SystemExit) as left:
        main(["show", str(path)])
    said = capsys.readouterr().err
    gc.collect()  # what a package could not open complains when it is thrown away
    assert left.value.code == 2
    assert re.search(sentence, said), said
    assert said.count("\n") == 1


@pytest.mark.parametrize("name", ["x" * 300 + ".csv", "a\0b.csv", "none.csv"])
def test_a_name_that_no_file_can_have_is_one_sentence(tmp_path: Path, name: str) -> None:
    with pytest.raises(RecordingError, match=r"cannot be opened|does not exist"):
        Recording.read(tmp_path / name)


def originals(folder: Path) -> list[tuple[str, bytes]]:
    """Small files of every kind that can be written here."""
    Recording("run", TABLE, {"t": "s", "q": "rad"}).write(folder / "run.parquet")
    Recording("run", TABLE).write(folder / "run.csv.gz")
    savemat(folder / "run.mat", TABLE, do_compression=True)
    with h5py.File(folder / "run.h5", "w") as file:
        for name, column in TABLE.items():
            file[name] = column
    files = [path for path in sorted(SAMPLES.iterdir()) if path.is_file() and path.suffix != ".py"]
    return [(path.name, path.read_bytes()) for path in (*files, *folder.iterdir())]


@pytest.mark.filterwarnings("ignore")
def test_three_hundred_damaged_files_end_in_a_recording_or_a_sentence(tmp_path: Path) -> None:
    draw, read = np.random.default_rng(17), 0
    with bounded(800):
        files = originals(tmp_path)
        for number in range(300):
            name, data = files[number % len(files)]
            path = written(tmp_path / f"{number}_{name}", damaged(data, draw))
            try:
                recording = preview(path).recording
                assert np.isfinite(np.stack([recording[one] for one in recording])).all()
                read += 1
            except CosimError as error:
                sentence = str(error)
                assert "\n" not in sentence
                assert len(sentence) < 2000, sentence
            path.unlink()
    assert 30 < read < 270, sys.stderr.write(f"{read} of 300 were read\n")


ARITHMETIC = ("X1*2+1", "2.5e-3 * (X - 4) / 7")
PROGRAMS = ("__import__('os').system('true')", "X.__class__", "9**9**9**9", "(X1\n**9)", "where(X>0,X,0)", "exp(X)")
NONSENSE = ("1" * 100 + "!", "X*" * 5000 + "X")


@pytest.mark.parametrize("formula", [*ARITHMETIC, *PROGRAMS, *NONSENSE])
def test_a_formula_in_a_file_runs_only_if_it_is_arithmetic(tmp_path: Path, formula: str) -> None:
    asammdf = pytest.importorskip("asammdf")
    t = np.arange(3000) / 500
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(np.sin(t), t, name="torque", conversion={"formula": formula})])
        file.append([asammdf.Signal(np.sin(3 * t), t, name="position")])
        file.save(tmp_path / "run.mf4")
    if formula in ARITHMETIC:
        assert np.isfinite(Recording.read(tmp_path / "run.mf4")["tau"]).all()
    else:
        with pytest.raises(RecordingError, match="converted by a formula that is no plain arithmetic"):
            Recording.read(tmp_path / "run.mf4")
