"""What is installed and what works here, without doing any of it."""

import json
import subprocess
import sys
from importlib import metadata
from importlib.resources import files
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


def test_what_is_missing_comes_with_the_command_that_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    there = looked._version_of
    gone = {"asammdf", "ziglang", "casadi"}
    monkeypatch.setattr(looked, "_version_of", lambda name: "" if name in gone else there(name))
    found = looked.doctor()
    assert found.extras["mdf"] == "MDF4 recordings: not installed (pip install asammdf)"
    assert found.works["export"] == "no compiler: pip install ziglang"
    assert found.versions["casadi"] == "missing: reinstall the package"


# What is asked most often loads little: help without numpy, a card without what reads recordings.

CODE = """
import sys
from cosim.cli import main
try:
    main({arguments})
finally:
    print(*(one for one in {heavy} if one in sys.modules), file=sys.stderr)
"""


def loading(arguments: list[str], heavy: tuple[str, ...]) -> "subprocess.CompletedProcess[str]":
    code = CODE.format(arguments=arguments, heavy=heavy)
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


CARD = str(files("pyfmi_models") / "cards" / "paper_mount.toml")


@pytest.mark.parametrize(
    ("arguments", "heavy"),
    [
        (["--help"], ("numpy", "pydantic", "casadi", "pyarrow", "pandas", "scipy")),
        (["diagnose", "--help"], ("numpy", "casadi", "pyarrow", "pandas", "scipy")),
        (["show", CARD], ("pyarrow", "pandas", "scipy", "matplotlib", "cosim.data.recording", "cosim.system.scenario")),
    ],
)
def test_nothing_heavy_is_loaded(arguments: list[str], heavy: tuple[str, ...]) -> None:
    done = loading(arguments, heavy)
    assert done.stdout
    assert done.stderr.strip() == ""


def test_a_run_with_its_page_loads_nothing_that_reads_recordings_fits_or_draws(tmp_path: Path) -> None:
    heavy = ("cosim.data.formats", "pyarrow.compute", "pandas", "scipy", "casadi", "ziglang", "matplotlib")
    done = loading(["run", "sidereal", "--stop", "0.05", "--out", str(tmp_path)], heavy)
    assert (tmp_path / "run.html").is_file(), done.stderr
    assert done.stderr.splitlines()[-1] == ""
