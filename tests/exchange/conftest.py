"""A motor with numbers to identify, a recording of one with other numbers, and its calibration."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from motor_fmu import TRUTH, motor, recorded

import cosim


@pytest.fixture(scope="session")
def fmu(tmp_path_factory) -> Path:
    return motor(tmp_path_factory.mktemp("motor"), 3)


@pytest.fixture(scope="session")
def table(fmu) -> dict:
    return recorded(fmu, TRUTH)


@pytest.fixture(scope="session")
def found(fmu) -> Callable[..., cosim.CalibrateResult]:
    """What a calibration of the motor comes to: of its three numbers, where nothing else is asked."""
    return partial(cosim.identify, fmu=fmu, free=list(TRUTH), starts=1, workers=1)
