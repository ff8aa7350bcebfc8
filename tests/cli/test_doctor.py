"""What is installed and what works here, without doing any of it."""

import json
from importlib import metadata
from pathlib import Path

import pytest
from commands import call

from cosim.api import doctor as looked
from cosim.support.version import __version__


def test_versions_abilities_extras_and_caches_are_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(tmp_path))
    (tmp_path / "fmus").mkdir()
    (tmp_path / "fmus" / "one.fmu").write_bytes(bytes(1500))
    assert call("doctor", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["versions"]["mount-cosim"] == __version__
    assert found["versions"]["numpy"] == metadata.version("numpy")
    assert set(found["works"]) == {"run", "diagnose", "hardware", "export"}
    assert found["works"]["run"] == "yes, compiled loop"
    assert found["caches"] == {"fmus": 1500}
    assert call("doctor") == 0
    said = capsys.readouterr().out
    assert f"Caches in {tmp_path}" in said
    assert "fmus" in said


def test_what_is_missing_comes_with_the_command_that_installs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(tmp_path))
    there = looked._version_of
    gone = {"asammdf", "ziglang", "casadi"}
    monkeypatch.setattr(looked, "_version_of", lambda name: "" if name in gone else there(name))
    found = looked.doctor()
    assert found.extras["mdf"] == "MDF4 recordings: not installed (pip install asammdf)"
    assert found.works["export"] == "no compiler: pip install ziglang"
    assert found.versions["casadi"] == "missing: reinstall the package"
