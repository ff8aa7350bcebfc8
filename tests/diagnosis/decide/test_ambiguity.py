"""What an effect that is really another is called."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.measure.bounds import not_found
from cosim.diagnosis.search.admissibility import in_time, is_degenerate
from cosim.diagnosis.search.stages import CandidateFit
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from pyfmi_models.effects import (
    ActuatorLag,
    Delay,
    StribeckEffect,
    TorqueOffset,
)
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

Array = npt.NDArray[np.float64]
MOUNT = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=1.0))
NONE: Array = np.zeros(0)


def problem(speed: Array, **columns: Array) -> Problem:
    t = np.arange(len(speed)) / 1000
    given = {"t": t, "tau": speed, "q": np.cumsum(speed) / 1000, **columns}
    prepared = prepare([Recording("r", given)], 10.0)
    return Problem(MOUNT, prepared, np.ones(len(prepared.recording_of)), 1e-3)


@pytest.mark.parametrize(("ms", "degenerate"), [(0.51, True), (0.57, False), (5.0, False)])
def test_what_is_half_a_sample_late_is_how_it_was_read(ms: float, degenerate: bool) -> None:
    """Read at 1 kHz; a value that is held, or stamped at the other end of its row, is half a sample late."""
    swing = problem(np.sin(np.arange(20_000) / 1000))
    assert is_degenerate(swing, Delay(delay_ms=ms)) is degenerate
    assert is_degenerate(swing, ActuatorLag(time_constant_ms=ms)) is degenerate


def test_a_spring_that_no_card_may_hold_is_no_answer() -> None:
    swing = problem(np.sin(np.arange(20_000) / 1000))
    assert is_degenerate(swing, Compliance(antiresonance_hz=30.0, resonance_hz=20.0))
    assert not is_degenerate(swing, Compliance(antiresonance_hz=20.0, resonance_hz=30.0))


def test_a_cable_whose_home_is_far_beside_the_travel_is_an_offset() -> None:
    swing = problem(np.sin(np.arange(20_000) / 1000))  # from 0 to 2 rad
    assert not is_degenerate(swing, CableWrap(stiffness=0.1, home=-0.45))
    assert is_degenerate(swing, CableWrap(stiffness=0.1, home=-0.55)), "it pulls one way all along, as a weight does"
    assert is_degenerate(swing, CableWrap(stiffness=0.1, home=2.55))


def test_noise_at_constant_speed_tells_no_delay_unless_a_set_point_asks_for_it() -> None:
    steady = 1 + 0.02 * np.random.default_rng(1).standard_normal(20_000)
    for found, told in ((problem(steady), False), (problem(steady, q_d=np.arange(20_000) / 1000), True)):
        residual = np.zeros(len(found.prepared.recording_of))
        late = CandidateFit(Delay(delay_ms=5.0), Fit(MOUNT, (), NONE, NONE, NONE, residual), 50.0, 0.0, 0.5)
        assert in_time(found, late) is told


def test_how_a_cable_hardens_is_fitted_as_its_grid_knows_it_only_roughly() -> None:
    t = np.arange(40_000) / 1000
    q, v = 1.5 * np.sin(0.9 * t), 1.35 * np.cos(0.9 * t)
    tau = -0.81 * 5 * q + np.sign(v) + 2 * (q - 0.2) * (1 + 0.3 * (q - 0.2) ** 2)
    this = problem(v, tau=tau, q=q)
    rough = replace(MOUNT, effects=(CableWrap(stiffness=1.0, home=0.0, hardening=4 / 9),))
    cable = rough.effects[0]
    tuned = hypothesis_of(cable).tuned(this, this.fit(rough, 12), cable, lambda fit: -this.error(fit))
    found = tuned.mount.effects[-1]
    assert isinstance(found, CableWrap)
    assert float(found.hardening) == pytest.approx(0.3, rel=0.05)
    assert float(found.home) == pytest.approx(0.2, rel=0.05)


def steady(speeds: list[float], torque: Callable[[float], float]) -> Problem:
    """One recording a speed."""
    t = np.arange(300) / 100
    signals = [{"t": t, "q": v * t, "tau": np.full(300, torque(v))} for v in speeds]
    prepared = prepare([Recording(f"r{number}", one) for number, one in enumerate(signals)], 10.0)
    return Problem(MOUNT, prepared, np.ones(len(prepared.recording_of)), 1e-2)


def test_a_stribeck_curve_is_found_from_a_start_narrower_than_the_gap_between_the_speeds() -> None:
    speeds = [side * v for v in (0.1, 3.0, 6.0, 9.0, 12.0, 15.0, 18.0, 21.0) for side in (1, -1)]
    this = steady(speeds, lambda v: float(np.sign(v) * (1 + 0.2 * np.exp(-abs(v) / 5)) + 0.02 * v))
    narrow = StribeckEffect(Fs=1.2, Vs=0.1)
    found = (
        hypothesis_of(narrow)
        .tuned(this, this.fit(replace(MOUNT, effects=(narrow,)), 12), narrow, lambda fit: -this.error(fit))
        .mount.effects[-1]
    )
    assert isinstance(found, StribeckEffect)
    assert float(found.Vs) == pytest.approx(5, rel=0.01)
    assert float(found.Fs) == pytest.approx(1.2, rel=0.01)


def test_of_an_asymmetry_that_looks_like_the_offset_found_it_is_said_that_it_does() -> None:
    t = np.arange(0, 20, 0.01)
    v = np.cos(2 * t) + 0.5 * np.cos(0.7 * t)
    q = np.sin(2 * t) / 2 + np.sin(0.7 * t) / 1.4
    one = {"t": t, "q": q, "tau": np.sign(v) + 0.2 + 5 * np.gradient(v, t)}
    prepared = prepare([Recording("r", one)], 10.0)
    this = Problem(MOUNT, prepared, np.ones(len(prepared.recording_of)), 1e-2)
    found = this.fit(replace(MOUNT, effects=(TorqueOffset(torque=1.0),)), 5)
    comparison = Comparison.of(this, this.fit(MOUNT, 5), POLICY)
    absent = {finding.effect: finding for finding in not_found(comparison, found, ["torque_offset"], 0.0)}
    assert absent["friction_asymmetry"].answer == "not_testable"
    assert "torque offset" in absent["friction_asymmetry"].evidence
