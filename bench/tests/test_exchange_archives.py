"""The table of others' archives: what runs is compared, a refusal counts only where its reason is found elsewhere."""

import zipfile
from pathlib import Path

import pytest
from exchange_archives import page, rows_of
from exchange_truth import differ
from tiny_fmu import described


@pytest.fixture
def copies(tiny: dict[int, Path], tmp_path: Path) -> Path:
    folder = tmp_path / "someone+tool"
    folder.mkdir()
    (tmp_path / "copies.toml").write_text(
        '[[copies]]\nfolder = "someone+tool"\nrepository = "someone/tool"\ncommit = "0123456789abcdef"\n'
    )
    (folder / "good.fmu").write_bytes(tiny[3].read_bytes())
    described(tiny[2], folder / "old.fmu", '<fmiModelDescription fmiVersion="1.0" modelName="x" guid="g"/>')
    with zipfile.ZipFile(tiny[2]) as good, zipfile.ZipFile(folder / "windows.fmu", "w") as bare:
        bare.writestr("modelDescription.xml", good.read("modelDescription.xml"))
        bare.writestr("binaries/win64/tiny.dll", b"MZ")
    return tmp_path


def test_each_archive_runs_or_is_refused_for_a_reason_that_stands_in_it(copies: Path) -> None:
    rows = {row.path: row for row in rows_of(copies)}
    assert {path: row.became for path, row in rows.items()} == {
        "good.fmu": "run",
        "old.fmu": "refused",
        "windows.fmu": "refused",
    }
    assert "FMPy 0.0e+00" in rows["good.fmu"].said
    assert rows["old.fmu"].truth == "its fmiVersion is 1.0"
    assert rows["windows.fmu"].truth == "no file in binaries/linux64"
    text = "\n".join(page(list(rows.values())))
    assert "3 tried: 1 run, 2 refused truly, 0 wrong." in text
    assert "## someone/tool at `0123456789`" in text


def test_a_refusal_that_nothing_confirms_is_wrong(copies: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from cosim.support.errors import FmuError

    def refuse(*_: object) -> None:
        raise FmuError("no")

    monkeypatch.setattr("exchange_archives.simulate", refuse)
    assert next(row for row in rows_of(copies) if row.path == "good.fmu").became == "wrong"


def test_differences_are_relative_to_the_range() -> None:
    assert differ([0.0, 2.0], [0.0, 4.0]) == 0.5
    assert differ([float("nan"), 2.0], [0.0, 4.0]) == float("inf")
