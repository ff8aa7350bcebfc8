"""Effects that a card may hold and a diagnosis does not ask for yet: a dead band, viscous friction that rises less."""

import numpy as np
import pytest
from effect_examples import mount

from pyfmi_models.effects.concave_viscous import ConcaveViscous
from pyfmi_models.effects.dead_band import DeadBand


def test_a_dead_band_takes_its_width_of_large_commands_and_most_of_small_ones() -> None:
    drive = DeadBand(band=0.5)
    given = np.array([float(drive.applied((), u)) for u in (-20.0, -0.1, 0.0, 0.1, 20.0)])
    np.testing.assert_allclose(given[[0, 2, 4]], [-19.5, 0.0, 19.5], atol=1e-12)
    assert given[3] == pytest.approx(-given[1])
    assert 0.0 < given[3] < 0.1 * 0.1


@pytest.mark.parametrize("softness", [0.2, 0.25, 2.0])
def test_each_torque_has_its_command(softness: float) -> None:
    command = np.linspace(-3, 3, 2001)
    given = np.array([float(DeadBand(band=0.5, softness=softness).applied((), u)) for u in command])
    assert np.all(np.diff(given) > 0.01 * np.diff(command))
    within = (given[1001] - given[999]) / (command[1001] - command[999])
    assert within == pytest.approx(2 / (1 + np.exp(1 / softness)), rel=1e-3)


@pytest.mark.parametrize("exponent", [-1.0, -0.4, 0.0, 0.6, 1.0])
def test_far_above_its_speed_viscous_friction_is_a_power_and_far_below_a_line(exponent: float) -> None:
    effect, line = ConcaveViscous(thinning_speed=0.1, exponent=exponent), 3.0

    def torque(v: float) -> float:
        return float(effect.viscous(line * v, mount(effect).at(0.0, 0.0, v)))

    assert torque(1e-4) == pytest.approx(line * 1e-4, rel=1e-5)
    assert torque(200.0) / torque(100.0) == pytest.approx(2.0**exponent, rel=1e-5)
    assert torque(100.0) == pytest.approx(line * 100.0 * 1000.0 ** (exponent - 1), rel=1e-5)
    assert torque(-0.3) == -torque(0.3) < 0.0
