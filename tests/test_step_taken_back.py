"""A step that a fit takes back: the next one costs the torque alone, to the last bit the same."""

from dataclasses import replace

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.estimation import fit as fitting
from cosim.estimation.fit import fit, free_parameters
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Prepared, prepare
from pyfmi_models.effects import Cogging, Delay, Effect
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance
from pyfmi_models.friction import LuGre
from pyfmi_models.mount import Axis, Mount

LAW = LuGre(Fc=2.0, Fs=2.4, Vs=0.05, sigma0=5e3, sigma1=20.0, sigma2=1.5)
MOUNT = Mount(name="axis", axis=Axis(inertia=5.0), friction=LAW)
PLAY = Backlash(gap_rad=5e-3, load_share=0.3, load_friction=0.5, load_viscous=0.3)
TONE = PeriodicDisturbance(frequency_hz=3.0, amplitude=0.3)


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    """A wandering motion with friction, a ripple and noise."""
    t = np.arange(8000) / 500
    tones = [(0.5, 0.11, 0.0), (0.1, 0.37, 1.0), (0.02, 0.9, 2.0)]
    q = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in tones)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    noise = 0.02 * np.random.default_rng(3).standard_normal(len(t))
    tau = 5 * a + 2 * np.tanh(v / 0.01) + 1.5 * v + 0.4 * np.sin(20 * q) + noise
    return prepare([Recording("r", {"t": t, "tau": tau, "q": np.asarray(q)})], 20.0)


@pytest.mark.parametrize("effect", [PLAY, TONE, Delay(delay_ms=4.0), Cogging(cycles_per_rev=20.0, amplitude=0.4)])
def test_torque_alone_has_the_bits_of_torque_with_its_derivatives(prepared: Prepared, effect: Effect) -> None:
    mount = replace(MOUNT, effects=(effect,))
    inverse = Inverse(mount, free_parameters(mount))
    model = fitting._Model(inverse, prepared.pieces)
    there = 1.01 * inverse.present
    expected = stacked(inverse, prepared.pieces, there)[0]
    assert np.array_equal(model.torque(there), expected)
    assert np.array_equal(model.torque(there), expected)  # as after a step that was taken back
    assert np.array_equal(model.whole(there)[0], expected)
    assert not np.array_equal(model.torque(inverse.present), expected)


def test_after_a_step_taken_back_torque_comes_alone(prepared: Prepared, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def counted(inverse: Inverse, *arguments: object) -> tuple[np.ndarray, np.ndarray]:
        asked.append(len(inverse.free))
        return stacked(inverse, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(fitting, "stacked", counted)
    found = fit(replace(MOUNT, effects=(PLAY,)), prepared.pieces, np.ones(len(prepared.recording_of)), MOUNT, 25)
    assert 0 < asked.count(0) < len(asked)
    assert asked[0] == asked[-1] == len(found.free)
    torque, slopes = stacked(Inverse(found.mount, found.free), prepared.pieces, found.values)
    np.testing.assert_allclose(found.torque, torque, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.slopes, slopes, rtol=1e-6, atol=1e-6)
