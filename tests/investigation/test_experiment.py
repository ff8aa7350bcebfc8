"""The next experiment differs most where the rival cannot follow, stays where the axis has been, and can be run."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.measure.experiment import best, in_words, motions, scenario
from cosim.estimation.prepare import Prepared, prepare
from cosim.system.scenario import read_scenario
from pyfmi_models.card import read_card
from pyfmi_models.effects import ActuatorLag, Cogging, Delay, TorqueOffset


@pytest.fixture(scope="module")
def night() -> Prepared:
    t = np.arange(30_000) / 1000
    q = 0.5 + 0.3 * np.sin(0.5 * t) + 0.002 * np.sin(20 * t)
    torque = 30 * (-0.075 * np.sin(0.5 * t) - 0.8 * np.sin(20 * t)) + 3
    return prepare([Recording("night", {"t": t, "tau": torque, "q": q})], 30.0)


def test_a_chirp_tells_a_lag_from_a_delay_and_nothing_slow_does(night: Prepared) -> None:
    base = read_card("paper_mount").plant()
    lag, delay = (replace(base, effects=(one,)) for one in (ActuatorLag(time_constant_ms=5.0), Delay(delay_ms=5.0)))
    found = best(lag, delay, ("actuator_lag", "delay"), night)
    assert found is not None
    assert found.signal.kind in ("chirp", "multisine")
    assert found.difference > 0.05


def test_what_a_rival_can_imitate_is_no_difference(night: Prepared) -> None:
    base = read_card("paper_mount").plant()
    one, other = (replace(base, effects=(TorqueOffset(torque=torque),)) for torque in (0.5, 0.1))
    found = best(one, other, ("torque_offset", "torque_offset"), night)
    assert found is None or found.difference < 1e-6


def test_motions_stay_where_the_axis_has_been(night: Prepared) -> None:
    low, high = night.ranges["q"]
    base = read_card("paper_mount").plant()
    ripple = replace(base, effects=(Cogging(cycles_per_rev=20, amplitude=0.5, phase=0.0),))
    found = best(ripple, base, ("cogging", "none"), night)
    assert found is not None
    for _, signal in motions(found.visited):
        q = found.visited.middle + signal.stream(0.01)(np.arange(4000))[0]
        assert low - 1e-9 <= q.min() <= q.max() <= high + 1e-9


def test_the_scenario_is_one_that_cosim_run_reads(night: Prepared, tmp_path: Path) -> None:
    card = read_card("paper_mount")
    base = card.plant()
    pair = (replace(base, effects=(one,)) for one in (ActuatorLag(time_constant_ms=5.0), Delay(delay_ms=5.0)))
    found = best(*pair, ("actuator_lag", "delay"), night)
    assert found is not None
    (tmp_path / "next_experiment.toml").write_text(scenario(found, card))
    read = read_scenario(tmp_path / "next_experiment.toml")
    assert set(read.records) == {"tau", "q", "q_d"}
    assert read.stop == 40.0
    assert in_words(found, True)["scenario"] == "next_experiment.toml"
    assert "scenario" not in in_words(found, False)
