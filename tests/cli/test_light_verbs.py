"""What is asked most often loads little: help without numpy, a card without what reads recordings."""

import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest

CODE = """
import sys
from cosim.cli import main
try:
    main({arguments})
finally:
    print(*(one for one in {heavy} if one in sys.modules), file=sys.stderr)
"""
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
    code = CODE.format(arguments=arguments, heavy=heavy)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout
    assert done.stderr.strip() == ""


def test_a_run_with_its_page_loads_nothing_that_reads_recordings_fits_or_draws(tmp_path: Path) -> None:
    heavy = ("cosim.data.formats", "pyarrow.compute", "pandas", "scipy", "casadi", "ziglang", "matplotlib")
    code = CODE.format(arguments=["run", "sidereal", "--stop", "0.05", "--out", str(tmp_path)], heavy=heavy)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (tmp_path / "run.html").is_file(), done.stderr
    assert done.stderr.splitlines()[-1] == ""
