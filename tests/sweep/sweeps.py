"""A small sweep of two parameters over a closed loop, its file and its runs."""

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from cosim.system.scenario import read_scenario
from cosim_sweeps.conduct import Summary, conduct
from cosim_sweeps.file import read_sweep

SCENARIO = """
step = 1e-3
stop = 0.5
[components.plant]
fmu = "{fmu}"
[signals.r]
kind = "constant"
value = 1.0
unit = "rad"
[[connections]]
from = "r"
to = "plant.a"
[[connections]]
from = "plant.y"
to = "plant.b"
[record]
signals = { q = "plant.y", r = "r" }
"""
SWEEP = """
scenario = "loop.toml"
[vary]
"plant.k" = [1.0, 2.0, 4.0]
"r.value" = { low = 0.5, high = 1.5, count = 3 }
[statistics]
end = { signal = "q", kind = "final" }
error = { signal = "r", minus = "q", kind = "rms", from = 0.1, to = 0.4, unit = "mrad" }
"""
K = '"plant.k" = [1.0, 2.0, 4.0]'
R = '"r.value" = { low = 0.5, high = 1.5, count = 3 }'


@pytest.fixture
def folder(tiny: dict[int, Path], tmp_path: Path) -> Path:
    (tmp_path / "loop.toml").write_text(SCENARIO.replace("{fmu}", str(tiny[3])))
    (tmp_path / "sweep.toml").write_text(SWEEP)
    return tmp_path


def written(folder: Path, *changes: tuple[str, str]) -> Path:
    """Write the sweep with changes and return its path."""
    text = SWEEP
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "sweep.toml"
    path.write_text(text)
    return path


def run(path: Path, **settings: Any) -> tuple[Summary, pd.DataFrame]:
    sweep = read_sweep(path)
    done = conduct(sweep, read_scenario(sweep.scenario), path.parent / "out", **({"workers": 1} | settings))
    return done, pd.read_parquet(done.table)
