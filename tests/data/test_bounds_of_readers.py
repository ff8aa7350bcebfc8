"""Each bound of a reader: what just fits is read, one more is refused, before it takes memory."""

import gzip
import json
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import attack_files
import h5py
import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from scipy.io import savemat

from cosim.data import limits
from cosim.data.binary import channels, numpy_files
from cosim.data.binary import parquet as parquet_files
from cosim.data.limits import Allowance, allowed_by, check_cells, check_columns, check_text, check_unpacked, within
from cosim.data.recording import Recording
from cosim.data.text import json_records
from cosim.data.text.reader import read_text
from cosim.reading import options_of
from cosim.support.errors import RecordingError
from cosim_readers import hdf5, matlab

ROWS, COLUMNS = 120, 3
TABLE = {name: np.linspace(k, k + 1.5, ROWS) for k, name in enumerate(("t", "tau", "q"))}
PATH = Path("run")


def allowing(numbers: float, raised: int = 1) -> Allowance:
    return Allowance(1000, raised, numbers * limits.NUMBER, 60.0)


def hdf5_of(path: Path, table: dict[str, np.ndarray] = TABLE, **packed: object) -> None:
    with h5py.File(path, "w") as file:
        for name, values in table.items():
            file.create_dataset(name, data=values, **packed)


def short() -> pa.Table:
    """Four bytes a number: so the count of numbers is met before that of bytes."""
    return pa.table({name: values.astype(np.float32) for name, values in TABLE.items()})


def rows() -> list[list[float]]:
    return np.column_stack(list(TABLE.values())).tolist()


WRITERS: dict[str, tuple[Callable[[Path], object], Callable[[Path], object], int]] = {
    "parquet": (lambda path: parquet.write_table(short(), path), parquet_files.read, 0),
    "h5": (hdf5_of, hdf5.read, 0),
    "mat": (lambda path: savemat(path, TABLE), matlab.read, 0),
    "npz": (lambda path: np.savez(path, **TABLE), numpy_files.read, COLUMNS * 128 // limits.NUMBER),
    "csv": (lambda path: path.write_text("t,tau,q\n" + "".join(f"{a},{b},{c}\n" for a, b, c in rows())), read_text, 0),
}
"""How a table is written in each format, its reader, and numbers that the headers of its parts are as long as."""


@pytest.mark.parametrize("format_", WRITERS)
def test_a_table_that_just_fits_is_read_and_one_number_more_is_refused(format_: str, tmp_path: Path) -> None:
    write, read, heads = WRITERS[format_]
    path = tmp_path / f"run.{format_}"
    write(path)
    exact = ROWS * COLUMNS + heads
    with within(allowing(exact)):
        found = read(path).values  # type: ignore[attr-defined]
    np.testing.assert_allclose(np.asarray(found["q"], float), TABLE["q"], rtol=1e-6)
    with within(allowing(exact - 1)), pytest.raises(RecordingError, match="limit=2"):
        read(path)


LARGE = 400_000
"""Numbers of a column that packs to next to nothing."""


PACKED: dict[str, Callable[[Path], object]] = {
    "h5": lambda path: hdf5_of(path, dict.fromkeys(TABLE, np.zeros(LARGE)), compression="gzip", chunks=(1000,)),
    "mat": lambda path: savemat(path, dict.fromkeys(TABLE, np.zeros(LARGE)), do_compression=True),
    "npz": lambda path: np.savez_compressed(path, **dict.fromkeys(TABLE, np.zeros(LARGE))),
}


@pytest.mark.parametrize("format_", PACKED)
def test_too_many_numbers_are_refused_before_they_take_memory(format_: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{format_}"
    PACKED[format_](path)
    tracemalloc.start()
    try:
        with within(allowing(10_000)), pytest.raises(RecordingError, match="limit="):
            WRITERS[format_][1](path)
        assert tracemalloc.get_traced_memory()[1] < LARGE * limits.NUMBER, "not even one column"
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("check", "most"),
    [
        (lambda count: check_columns(PATH, count), 10_000),
        (lambda count: check_cells(PATH, count, 1), 25_000_000),
        (lambda count: check_cells(PATH, 1, count), 10_000),
        (lambda count: check_cells(PATH, 2_500, count), 10_000),
        (lambda count: check_unpacked(PATH, count), 200_000_000),
        (lambda count: check_text(PATH, count), 1_000_000_000),
    ],
)
def test_a_bound_is_the_documented_number_and_the_next_one_is_beyond(check: Callable[[int], None], most: int) -> None:
    check(most)
    with pytest.raises(RecordingError):
        check(most + 1)
    with within(allowing(1e12, raised=3)):
        if most not in (25_000_000, 200_000_000):  # those are the allowance's own
            check(3 * most)
            with pytest.raises(RecordingError):
                check(3 * most + 1)


@pytest.mark.parametrize(("size", "times"), [(1, 1), (50_000_000, 1), (75_000_000, 1.5), (500_000_000, 10)])
def test_a_larger_file_may_take_as_much_more_up_to_two_gigabytes(size: int, times: float) -> None:
    for raised in (1, 7):
        found = Allowance.of(size, raised)
        assert found.unpacked == pytest.approx(raised * 2e8 * times)
        assert found.seconds == pytest.approx(raised * 10 * times)
    assert Allowance.of(10 * size + 5_000_000_000).unpacked == 2e9


@pytest.mark.parametrize(("said", "factor"), [("", 1), ("1", 1), ("2", 2), ("1000", 1000)])
def test_limits_are_raised_by_whole_factors_up_to_a_thousand(said: str, factor: int, tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("t\n")
    assert allowed_by(path, said).raised == factor
    for wrong in ("0", "-1", "1.5", "many", "1001", "9" * 50):
        with pytest.raises(RecordingError, match="from 1 to 1,000"):
            allowed_by(path, wrong)


@pytest.mark.parametrize(("held", "factor"), [(101, 2), (200, 2), (201, 3), (100_000, 1000), (100_001, None)])
def test_a_refusal_names_the_least_factor_that_would_do_if_any_does(held: int, factor: int | None) -> None:
    with within(allowing(100)), pytest.raises(RecordingError) as refused:
        check_cells(PATH, held, 1)
    said = str(refused.value)
    assert said.endswith(f"--layout limit={factor}.") if factor else "--layout" not in said
    with within(allowing(100 * (factor or 1001), raised=factor or 1)):
        check_cells(PATH, held, 1)


@pytest.mark.parametrize(("rows", "fits"), [(33, True), (34, False)])
def test_vectors_and_tables_of_a_package_count_together(rows: int, fits: bool) -> None:
    """A vector and the two columns of a table are three numbers a row, of a hundred that may be held."""
    found = {"t": np.arange(float(rows)), "q": np.ones((rows, 2)), "gains": np.ones(7), "name": np.array(["run"])}
    with within(allowing(100)):
        if fits:
            assert channels.vectors(PATH, found).keys() == {"t", "q_1", "q_2"}
            return
        with pytest.raises(RecordingError, match="34 rows of 3 columns"):
            channels.vectors(PATH, found)


@pytest.mark.parametrize(("depth", "fits"), [(hdf5.DEEPEST, True), (hdf5.DEEPEST + 1, False)])
def test_groups_of_hdf5_lie_a_hundred_deep_and_no_deeper(depth: int, fits: bool, tmp_path: Path) -> None:
    hdf5_of(tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5", "a") as file:
        file.create_group("/".join(["g"] * depth))
    if fits:
        assert set(hdf5.read(tmp_path / "run.h5").values) == set(TABLE)
    else:
        with pytest.raises(RecordingError, match="more than 100 groups"):
            hdf5.read(tmp_path / "run.h5")


# What reading a file may cost is one rule for all readers, and `--layout limit=...` raises it.


def test_too_many_numbers_are_refused_the_named_factor_lets_them_in_and_time_is_limited_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "UNPACKED", 250 * limits.NUMBER)
    parquet.write_table(pa.table(TABLE), tmp_path / "run.parquet")
    with pytest.raises(RecordingError, match=r"at most 250 numbers are read.* --layout limit=2\."):
        Recording.read(tmp_path / "run.parquet")
    assert len(Recording.read(tmp_path / "run.parquet", layout={"limit": "2"})) == ROWS
    monkeypatch.undo()
    monkeypatch.setattr(limits, "SECONDS", 0.0)
    (tmp_path / "run.csv.gz").write_bytes(gzip.compress(b"t,tau,q\n" + b"0.001,1,2\n" * 1000))
    with pytest.raises(RecordingError, match=r"took more than 0 s of a processor .* --layout limit=3\."):
        Recording.read(tmp_path / "run.csv.gz")


def test_a_limit_leaves_an_importer_its_file_and_counts_records_of_json_as_a_table(tmp_path: Path) -> None:
    """Options on how a text is written switch the importers off; a limit says nothing of that."""
    lines = "".join(f"pos {q:+.6f} tau {tau:+.6f}\n" for _, tau, q in rows())
    (tmp_path / "run.log").write_text(f"Sampling period is 1000000 ns\n\n{lines}")
    options = options_of(tmp_path / "run.log", None, None, ["limit=2"])
    read = Recording.read(tmp_path / "run.log", {"q": "pos"}, layout=options["layout"])
    assert read.sample_time == pytest.approx(1e-3)
    path = tmp_path / "run.json"
    path.write_text(json.dumps([dict(zip(TABLE, row, strict=True)) for row in rows()]))
    with within(allowing(1e6)):
        assert len(json_records.read(path).values["q"]) == ROWS
    with within(allowing(ROWS * COLUMNS - 1)), pytest.raises(RecordingError, match="limit="):
        json_records.read(path)


# A file that was made to cost memory or time is read or refused within 20 s of a processor and 1 GB.

KINDS = sorted({name.partition(":")[0] for name in attack_files.FILES.keys() - attack_files.LONG})


@pytest.fixture(scope="module")
def costs() -> dict[str, attack_files.Cost]:
    """What a file of each kind costs, none that takes long; `python bench/attack_files.py` shows all."""
    if sys.platform != "linux":
        pytest.skip("the bench forks and limits the memory of what it forks, which Linux alone allows as it does")
    command = [sys.executable, str(attack_files.__file__), "--read", "--json", "--sample", "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout[done.stdout.index("[") :])  # a library may print before
    return {one["name"].partition(":")[0]: attack_files.Cost(**one) for one in told}


@pytest.mark.parametrize("kind", KINDS)
def test_a_crafted_file_is_read_or_refused_at_a_bounded_cost(kind: str, costs: dict[str, attack_files.Cost]) -> None:
    assert costs[kind].is_fine, costs[kind]
    assert costs[kind].name not in attack_files.FOREIGN or costs[kind].code != 0
