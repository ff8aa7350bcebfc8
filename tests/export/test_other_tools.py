"""The archives in tools of others: they load, and compute the same bits."""

import importlib
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from fmu_tools import TOOLS

from pyfmi_models.card import read_card
from pyfmi_models.export import export_fmu

STEPS = 100
CASES = [(tool, fmi) for tool, (_, versions) in TOOLS.items() for fmi in versions]


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Export plant or controller of the paper's mount once."""
    card, folder = read_card("paper_mount"), tmp_path_factory.mktemp("fmus")
    models = {"plant": card.plant().model(), "controller": card.controller_model()}
    return cache(lambda part, fmi: export_fmu(models[part], folder / f"{part}{fmi}.fmu", fmi=fmi))


def rows_in(tool, path, folder):
    try:
        importlib.import_module(TOOLS[tool][0])
    except (ImportError, OSError) as error:
        pytest.skip(f"{tool} is not installed: {error}")
    runner, out = Path(__file__).parents[2] / "bench" / "fmu_tools.py", folder / f"{tool}.npz"
    command = [sys.executable, str(runner), tool, str(path), str(STEPS), str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return np.load(out)["rows"]


@pytest.mark.parametrize("part", ["plant", "controller"])
@pytest.mark.parametrize(("tool", "fmi"), CASES)
def test_each_tool_loads_the_archive_and_finds_the_same_bits(archive, tool, fmi, part, tmp_path):
    own = rows_in("fmpy", archive(part, 3), tmp_path)
    assert np.ptp(own[:, 0]) > 0  # something moves
    assert rows_in(tool, archive(part, fmi), tmp_path).tobytes() == own.tobytes()
