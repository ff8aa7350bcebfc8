"""Between torque and mass, and between mass and reading: saturation, eccentricity, clocks."""

import numpy as np
import pytest
from effect_examples import INERTIA, evaluate, mount, simulate

from pyfmi_models.effects.clock_skew import ClockSkew
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.effects.torque_saturation import TorqueSaturation
from pyfmi_models.friction import Frictionless
from pyfmi_models.mount import Axis

KNEE = TorqueSaturation(knee_torque=5.0, slope=0.4)
DISC = EncoderEccentricity(cycles_per_rev=8, amplitude_rad=1e-3, phase=0.3, second=0.2)


def test_the_torque_limit_acts_before_the_knee() -> None:
    model = mount(KNEE, axis=Axis(inertia=INERTIA, torque_limit=6.0)).model()
    assert evaluate(model, tau=100.0)["applied"] == pytest.approx(5.4, abs=1e-4)


def test_encoder_turns_of_a_linear_axis_are_per_metre() -> None:
    model = mount(DISC, motion="linear").model()
    assert evaluate(model, position=0.31)["q"] - 0.31 == pytest.approx(
        evaluate(model, position=0.31 + 1 / 8)["q"] - 0.31 - 1 / 8, abs=1e-15
    )
    assert next(v.unit for v in model.parameters if v.name.endswith("amplitude_rad")) == "m"


def test_errors_of_several_encoders_add_up() -> None:
    twice = mount(DISC, EncoderEccentricity(cycles_per_rev=1, amplitude_rad=2e-3)).model()
    one, two = (1e-3 * (np.sin(1.9) + 0.2 * np.sin(3.8)), 2e-3 * np.sin(0.2))
    assert evaluate(twice, position=0.2)["q"] - 0.2 == pytest.approx(one + two)


@pytest.mark.parametrize("offset", [-6.0, 6.0])
def test_a_skewed_clock_records_the_reading_of_another_time(offset: float) -> None:
    """Without friction a constant torque makes a parabola, for which the prediction is exact."""
    clock = ClockSkew(offset_ms=offset, drift_ppm=2000.0)
    run = simulate(mount(clock, friction=Frictionless()).model(), np.linspace(0, 2, 21), lambda t: 3.0)
    then = run["t"] + 1e-3 * offset + 2e-3 * run["t"]
    np.testing.assert_allclose(run["q"], 3.0 / INERTIA * run["t"] ** 2 / 2, atol=1e-9)
    np.testing.assert_allclose(run["q_recorded"], 3.0 / INERTIA * then**2 / 2, atol=1e-9)


def test_the_recorded_reading_of_a_swing_is_that_of_its_time_to_third_order() -> None:
    """The error is omega^3 ahead^3 / 6 of the amplitude, as the effect says."""
    t, omega = np.linspace(0, 2, 201), 10.0
    run = simulate(
        mount(DISC, ClockSkew(offset_ms=8.0), friction=Frictionless()).model(), t, lambda t: 2 * np.sin(omega * t)
    )
    true = lambda t: -2 * np.sin(omega * t) / (INERTIA * omega**2) + 2 * t / (INERTIA * omega)  # noqa: E731
    later = true(t + 8e-3)
    a = 8 * later + 0.3
    error = run["q_recorded"] - later - 1e-3 * (np.sin(a) + 0.2 * np.sin(2 * a))
    assert np.abs(error).max() < 1.2 * (omega * 8e-3) ** 3 / 6 * 2 / (INERTIA * omega**2)


def test_the_loop_does_not_see_the_clock() -> None:
    with_it, without = (
        evaluate(mount(*effects).model(), position=0.1, speed=0.2, tau=1.0)
        for effects in ([ClockSkew(offset_ms=5)], [])
    )
    assert with_it.pop("q_recorded") != with_it["q"]
    assert with_it == without
