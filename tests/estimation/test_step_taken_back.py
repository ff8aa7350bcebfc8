"""What a fit looks at: nothing twice, torque alone after a step that it takes back; and the prior beside it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.estimation import fit as fitting
from cosim.estimation.fit import fit, free_parameters
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Piece, Prepared, prepare
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
    asked: list[tuple[int, bytes]] = []

    def counted(inverse: Inverse, pieces: Sequence[Piece], values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        asked.append((len(inverse.by), values.tobytes()))
        return stacked(inverse, pieces, values)

    monkeypatch.setattr(fitting, "stacked", counted)
    start = replace(MOUNT, effects=(replace(PLAY, gap_rad=0.05),))
    found = fit(start, prepared.pieces, np.ones(len(prepared.recording_of)), MOUNT, 25)
    counts = [count for count, _ in asked]
    assert 0 < counts.count(0) < len(asked) <= 25
    assert counts[0] == len(found.free)
    assert len(set(asked)) == len(asked)  # nothing is looked at twice
    torque, slopes = stacked(Inverse(found.mount, found.free), prepared.pieces, found.values)
    np.testing.assert_allclose(found.torque, torque, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.slopes, slopes, rtol=1e-6, atol=1e-6)


def test_evaluations_are_spent_once(prepared: Prepared, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def counted(inverse: Inverse, *arguments: object) -> tuple[np.ndarray, np.ndarray]:
        asked.append(len(inverse.by))
        return stacked(inverse, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(fitting, "stacked", counted)
    fit(replace(MOUNT, effects=(PLAY,)), prepared.pieces, np.ones(len(prepared.recording_of)), MOUNT, 4)
    assert len(asked) == 4


def test_a_prior_that_is_a_share_of_the_misfit_has_exact_derivatives() -> None:
    rng, pull = np.random.default_rng(4), fitting._Prior(np.array([2.0, 0.0, 0.5]))
    rest, slopes, values = rng.normal(size=30), rng.normal(size=(30, 3)), np.array([3.0, -1.0, 0.2])

    def rows(values: np.ndarray, at: np.ndarray) -> np.ndarray:
        return np.asarray(np.linalg.norm(rest + slopes @ (values - at)) * pull(values)[0])

    step = 1e-6 * np.eye(3)
    by_hand = [(rows(values + one, values) - rows(values - one, values)) / 2e-6 for one in step]
    np.testing.assert_allclose(pull.slopes(values, rest, slopes), np.column_stack(by_hand), rtol=1e-6, atol=1e-9)
    assert rows(values, values)[0] == pytest.approx(np.linalg.norm(rest) * np.log(1.5) / (20 * np.log(2)))
    assert rows(values, values)[1] == 0
    assert not pull.slopes(values, np.zeros(30), slopes).any()
