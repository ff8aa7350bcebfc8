"""docs/adding_physics.md holds: its two files in a copy of the package, and nothing else, are a law and an effect."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu

import pyfmi_models

ROOT = Path(__file__).parents[1]
GUIDE = (ROOT / "docs" / "adding_physics.md").read_text("utf-8")
EXPORT = """
from pyfmi_models.card import read_card
from pyfmi_models.card_writer import card_text
from pyfmi_models.card import parse_card
from pyfmi_models.export import export_fmu
card = read_card("tube.toml")
assert parse_card(card_text(card), "tube.toml") == card
export_fmu(card.plant().model(), "tube.fmu")
"""


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", GUIDE, re.MULTILINE | re.DOTALL)


def run(folder: Path, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a copy of the package, the guide's files in it, and the guide's card."""
    folder = tmp_path_factory.mktemp("copy")
    source = Path(str(pyfmi_models.__file__)).parent
    shutil.copytree(source, folder / "pyfmi_models", ignore=shutil.ignore_patterns("__pycache__"))
    for block in blocks("python"):
        name = block.partition("\n")[0].removeprefix("# ")
        assert not (folder / name).exists()
        (folder / name).write_text(block, "utf-8")
    (folder / "tube.toml").write_text(blocks("toml")[0], "utf-8")
    return folder


def test_a_law_and_an_effect_of_one_file_each_are_exported_from_a_card(copy: Path) -> None:
    run(copy, "-c", EXPORT)
    inputs = np.array([(0, 9.0, 15.0), (30, 9.0, 15.0)], dtype=[("time", float), ("tau", float), ("wind", float)])
    found = simulate_fmu(str(copy / "tube.fmu"), stop_time=30.0, output_interval=0.1, input=inputs)
    q, v = found["q"], found["v"]
    # Newton, with the guide's equations: J v' = 9 - 2 - 12 sqrt(v) - 0.02 15^2 sin(q)
    needed = 2.0 + 12.0 * np.sqrt(np.maximum(v, 0)) + 4.5 * np.sin(q)
    moving = v > 0.01
    assert moving.sum() > 100
    assert np.abs(30.0 * np.gradient(v, found["time"])[moving] + needed[moving] - 9.0).max() < 0.15


def test_the_property_tests_meet_them_by_themselves(copy: Path) -> None:
    chosen = "HerschelBulkley or herschel_bulkley or WindLoad"
    files = [str(ROOT / "tests" / name) for name in ("test_effect_properties.py", "test_friction_properties.py")]
    out = run(copy, "-m", "pytest", "-p", "no:cacheprovider", "-k", chosen, *files)
    assert int(re.findall(r"(\d+) passed", out)[-1]) >= 10
