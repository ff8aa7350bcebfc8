"""A recording is read as it is, judged in one sentence, and never repaired."""

import errno
import os
import re
from pathlib import Path

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.data.writer import StreamWriter
from cosim.support.errors import InputError, OutputError, RecordingError, UnitError
from cosim.support.units import conversion, unit

ROWS = 200


def columns(rows: int = ROWS) -> dict[str, np.ndarray]:
    t = np.arange(rows) * 1e-3
    return {"t": t, "tau": 2 * np.cos(7 * t), "q": 0.1 * np.sin(7 * t)}


def csv_file(path: Path, table: dict[str, np.ndarray], header: str = "") -> Path:
    lines = [header or ",".join(table)] + [
        ",".join(map(repr, map(float, row))) for row in zip(*table.values(), strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("suffix", [".parquet", ".csv", ".csv.gz"])
def test_what_is_written_is_read_back_bit_for_bit(tmp_path: Path, suffix: str) -> None:
    recording = Recording("run", columns() | {"temperature": np.full(ROWS, 20.5)}, {"q": "rad"})
    back = Recording.read(recording.write(tmp_path / f"run{suffix}"))
    assert back.columns == ("t", "tau", "q", "temperature")
    assert all(np.array_equal(back[name], recording[name]) for name in recording)


def test_parquet_keeps_units_and_origin(tmp_path: Path) -> None:
    recording = Recording("run", columns(), {"t": "s", "tau": "N", "q": "m"}, {"command": "cosim run x"})
    back = Recording.read(recording.write(tmp_path / "run.parquet"))
    assert back.units == {"t": "s", "tau": "N", "q": "m"}
    assert back.origin["command"] == "cosim run x"
    assert len(back.sha256) == 64


def test_units_of_the_user_become_si(tmp_path: Path) -> None:
    table = columns() | {"q_d": columns()["q"], "temperature": np.full(ROWS, 68.0)}
    path = csv_file(tmp_path / "run.csv", table, "t [ms],tau,q,q_d,temperature")
    units = {"tau": "mN.m", "q": "arcsec", "temperature": "degF"}
    recording = Recording.read(path, units=units)
    assert recording.units == {"t": "s", "tau": "N.m", "q": "rad", "q_d": "rad", "temperature": "degC"}
    np.testing.assert_allclose(recording["q"], table["q"] * np.pi / 648000)
    np.testing.assert_array_equal(recording["q_d"], recording["q"])
    np.testing.assert_allclose(recording["temperature"], 20.0)
    np.testing.assert_allclose(recording.sample_time, 1e-6)


def test_columns_are_renamed_and_a_name_taken_over_is_kept(tmp_path: Path) -> None:
    path = csv_file(tmp_path / "run.csv", columns() | {"force": 3 * columns()["tau"]})
    recording = Recording.read(path, {"tau": "force"})
    assert recording.columns == ("t", "tau_original", "q", "tau")
    np.testing.assert_array_equal(recording["tau"], 3 * columns()["tau"])


def test_gaps_and_jitter_are_reported_and_left_as_they_are(tmp_path: Path) -> None:
    keep = np.r_[0:50, 60:ROWS]
    table = {name: column[keep] for name, column in columns().items()}
    table["t"] = table["t"] + np.random.default_rng(1).uniform(-5e-5, 5e-5, len(keep))
    recording = Recording.read(csv_file(tmp_path / "run.csv", table))
    (gap,) = recording.gaps
    assert (gap.row, gap.missing) == (50, 10)
    np.testing.assert_array_equal(recording.t, table["t"])
    assert recording.jitter == pytest.approx(5e-5 / 1e-3 * np.sqrt(2 / 3), rel=0.1)  # two even draws
    jitter, gaps = recording.quality()
    assert "jitters" in jitter
    assert "1 gap(s)" in gaps


def test_an_extra_column_that_is_no_number_is_left_out_and_said_so(tmp_path: Path) -> None:
    path = csv_file(tmp_path / "run.csv", columns() | {"note": np.full(ROWS, np.nan)})
    recording = Recording.read(path)
    assert "note" not in recording
    assert recording.quality() == (
        'run: column "note" was left out because it holds nan at row 1, which is not a finite number (200 such rows).',
    )


def spoiled(name: str, row: int, value: float) -> dict[str, np.ndarray]:
    table = columns()
    table[name][row] = value
    return table


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        (spoiled("t", 100, 0.0), "time runs backwards at row 101 (0.099 s to 0 s). These are 2 recordings, if"),
        (spoiled("t", 100, 0.099), 'stands still at row 101 (0.099 s to 0.099 s) and its rows differ: "q" is '),
        (spoiled("q", 6, np.nan), 'column "q" holds nan at row 7, which is not a finite number.'),
        (spoiled("tau", 6, np.inf), 'column "tau" holds inf at row 7, which is not a finite number.'),
        (columns() | {"q": np.full(ROWS, np.inf)}, 'column "q" holds inf at row 1, which is not a finite number ('),
        (columns() | {"q": np.full(ROWS, 2.5)}, 'column "q" is 2.5 in every row; a constant signal tells nothing.'),
        (columns() | {"tau": np.zeros(ROWS)}, 'column "tau" is 0 in every row; a constant signal tells nothing.'),
        (columns(9), "has 9 rows; at least 100 are needed."),
    ],
)
def test_numbers_that_break_a_rule_are_named(tmp_path: Path, table: dict[str, np.ndarray], sentence: str) -> None:
    path = csv_file(tmp_path / "run.csv", table)
    with pytest.raises(RecordingError, match=re.escape(sentence)) as caught:
        Recording.read(path)
    assert str(path) in str(caught.value)


def test_text_in_a_column_is_named_with_its_row(tmp_path: Path) -> None:
    path = csv_file(tmp_path / "run.csv", columns())
    path.write_text(path.read_text().replace("\n0.003,", "\n0.003,oops", 1))
    with pytest.raises(RecordingError, match=r'column "tau" holds "oops.*" at row 4, which is not a number'):
        Recording.read(path)


@pytest.mark.parametrize(
    ("columns_given", "units", "sentence"),
    [
        ({"tau": "torque"}, {}, 'has no column "torque" to serve as tau; it has: t, tau, q.'),
        ({}, {"position": "deg"}, 'has no column "position" to give a unit to; it has: t, tau, q.'),
        ({"load": "tau"}, {}, "has no column tau; it has: t, load, q. Name it with --columns tau=..."),
        ({"angle": "q"}, {}, "has no column q or v; it has: t, tau, angle."),
    ],
)
def test_names_that_are_not_there_are_met_with_those_that_are(
    tmp_path: Path, columns_given: dict[str, str], units: dict[str, str], sentence: str
) -> None:
    path = csv_file(tmp_path / "run.csv", columns())
    with pytest.raises(RecordingError, match=re.escape(sentence)):
        Recording.read(path, columns_given, units)


def test_nothing_is_overwritten_or_left_half_written(tmp_path: Path) -> None:
    recording = Recording("run", columns())
    path = recording.write(tmp_path / "run.csv")
    with pytest.raises(OutputError, match=r"run.csv exists already; give --force to overwrite it."):
        recording.write(path)
    recording.write(path, force=True)
    with pytest.raises(OutputError, match=r"cannot be written; a recording becomes: .parquet, .csv, .csv.gz"):
        recording.write(tmp_path / "run.xlsx")
    with pytest.raises(OutputError, match=r"cannot be made: .*run.csv is a file"):
        recording.write(path / "deeper" / "run.csv")
    assert [item.name for item in tmp_path.iterdir()] == ["run.csv"]


def test_a_stream_is_a_complete_file_even_when_the_run_breaks(tmp_path: Path) -> None:
    table = columns()

    def interrupted() -> None:
        with StreamWriter(tmp_path / "run.parquet", {"t": "s", "tau": "", "q": "rad"}, {}) as file:
            file.write(table)
            file.origin["interrupted"] = True
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    back = Recording.read(tmp_path / "run.parquet")
    assert back.origin["interrupted"] is True
    np.testing.assert_array_equal(back["q"], table["q"])


def test_a_stream_that_finds_the_disk_full_says_so_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("cosim.data.writer.GROUP", 1)
    monkeypatch.setattr("pyarrow.parquet.ParquetWriter.write_table", full)
    stream = StreamWriter(tmp_path / "run.parquet", {"t": "s", "tau": "", "q": "rad"}, {})
    stream.write(columns())
    with pytest.raises(OSError, match="No space left"):
        stream.write(columns())
    with pytest.raises(OutputError, match=r"run.parquet cannot be written: No space left on device."):
        stream.close()
    assert not list(tmp_path.iterdir())


def test_units_of_different_kinds_do_not_mix() -> None:
    assert conversion("N.m", "mN.m") == (1000.0, 0.0)
    assert conversion("", "V") == (1.0, 0.0)
    with pytest.raises(UnitError, match=r'"N.m" cannot become "rad": they are different kinds of quantity'):
        conversion("N.m", "rad")
    with pytest.raises(InputError, match='"furlong" is no unit known here; known are: 1, %,'):
        unit("furlong")
