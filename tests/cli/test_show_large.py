"""`cosim show` of an FMU with very many variables prints every one without drawing a table."""

import zipfile
from pathlib import Path

import pytest
from commands import call


def test_a_table_of_very_many_variables_is_written_plainly(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = "".join(
        f'<ScalarVariable name="n[{k}].v" valueReference="{k}" causality="local" description="node [{k}]"><Real/>'
        "</ScalarVariable>"
        for k in range(2000)
    )
    with zipfile.ZipFile(tmp_path / "many.fmu", "w") as archive:
        archive.writestr(
            "modelDescription.xml",
            '<fmiModelDescription fmiVersion="2.0" modelName="many" guid="1"><CoSimulation modelIdentifier="many"/>'
            f"<ModelVariables>{rows}</ModelVariables><ModelStructure/></fmiModelDescription>",
        )
    monkeypatch.setattr("rich.table.Table.add_row", lambda *_: pytest.fail("a long table was drawn row by row"))
    assert call("show", tmp_path / "many.fmu") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-2000].split() == ["n[0].v", "local", "Float64", "node", "[0]"]
    assert lines[-1].split() == ["n[1999].v", "local", "Float64", "node", "[1999]"]
    assert lines[-2001].split() == ["variable", "causality", "type", "unit", "start", "description"]
