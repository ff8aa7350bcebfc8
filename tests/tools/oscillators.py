"""An oscillator made of two FMUs, on which algorithms are judged."""

import re
from pathlib import Path
from typing import Any

import pytest
from simulating import simulate
from tiny_fmu import described, description

from cosim.master.result import RunResult

Tiny = dict[int, Path]
BOTH = pytest.mark.parametrize("compiled", [True, False])
VERSIONS = pytest.mark.parametrize("version", [2, 3])
BOND = (("mass.y", "spring.y"),)
H = 0.05


@pytest.fixture(scope="module")
def plain(tiny: Tiny, tmp_path_factory: pytest.TempPathFactory) -> Tiny:
    """The tiny FMU without units, so that a bond may be anything."""
    folder = tmp_path_factory.mktemp("plain")
    texts = {version: re.sub(r' unit="\w+"', "", description(version)) for version in tiny}
    return {version: described(tiny[version], folder / f"plain{version}.fmu", texts[version]) for version in tiny}


def oscillator(fmu: Path, algorithm: Any, ticks: int = 400, step: float = H, **options: Any) -> RunResult:
    """Simulate v' = 1 - x and x' = v, from rest, as two FMUs: x = 1 - cos t."""
    return simulate(
        {"mass": fmu, "spring": fmu},
        [("r", "mass.a"), ("spring.y", "mass.b"), ("mass.y", "spring.a")],
        record={"v": "mass.y", "x": "spring.y", "held": "spring.a"},
        step=step,
        ticks=ticks,
        signals={"r": 1.0},
        algorithm=algorithm,
        **options,
    )
