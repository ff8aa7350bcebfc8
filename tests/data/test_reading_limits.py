"""What reading a file may cost is one rule for all readers, and `--layout limit=...` raises it."""

import gzip
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from cosim.data import limits
from cosim.data.recording import Recording
from cosim.reading import options_of
from cosim.support.errors import RecordingError

ROWS = 400
T = np.arange(ROWS) * 1e-3
TABLE = {"t": T, "tau": np.cos(9 * T), "q": np.sin(9 * T)}


def test_too_many_numbers_are_refused_and_the_named_factor_lets_them_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "UNPACKED", 1000 * limits.NUMBER)
    path = tmp_path / "run.parquet"
    parquet.write_table(pa.table(TABLE), path)
    with pytest.raises(RecordingError, match=r"at most 1,000 numbers are read.* --layout limit=2\."):
        Recording.read(path)
    assert len(Recording.read(path, layout={"limit": "2"})) == ROWS


def test_the_limit_grows_with_the_size_of_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    small, large, huge = (limits.Allowance.of(size) for size in (1000, 3 * limits.ORDINARY, 10**12))
    assert small.unpacked == limits.UNPACKED
    assert large.unpacked == 3 * limits.UNPACKED
    assert huge.unpacked == limits.MOST
    assert large.seconds == 3 * small.seconds == 3 * limits.SECONDS


def test_time_is_limited_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "SECONDS", 0.0)
    (tmp_path / "run.csv.gz").write_bytes(gzip.compress(b"t,tau,q\n" + b"0.001,1,2\n" * 1000))
    with pytest.raises(RecordingError, match=r"took more than 0 s of a processor .* --layout limit=3\."):
        Recording.read(tmp_path / "run.csv.gz")


@pytest.mark.parametrize("said", ["0", "-1", "1.5", "many", "1001", "9" * 50])
def test_a_limit_that_is_none_is_refused(tmp_path: Path, said: str) -> None:
    parquet.write_table(pa.table(TABLE), tmp_path / "run.parquet")
    with pytest.raises(RecordingError, match=r"--layout limit=.*: it is the factor .* from 1 to 1,000\."):
        Recording.read(tmp_path / "run.parquet", layout={"limit": said})


def test_a_limit_leaves_an_importer_its_file(tmp_path: Path) -> None:
    """Options on how a text is written switch the importers off; a limit says nothing of that."""
    rows = "".join(f"pos {x:+.6f} tau {y:+.6f}\n" for x, y in zip(TABLE["q"], TABLE["tau"] + 2, strict=True))
    (tmp_path / "run.log").write_text(f"Sampling period is 1000000 ns\n\n{rows}")
    options = options_of(tmp_path / "run.log", None, None, ["limit=2"])
    read = Recording.read(tmp_path / "run.log", {"q": "pos"}, layout=options["layout"])
    assert read.sample_time == pytest.approx(1e-3)
