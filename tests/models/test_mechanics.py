"""Axes that are not rigid, and inertia that changes: Newton for every body, no energy from nowhere."""

import numpy as np
import pytest
from effect_examples import INERTIA, linear, mount, response, simulate
from scipy.linalg import eigvals

from pyfmi_models.effects import Delay
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.effects.inertia_variation import InertiaVariation
from pyfmi_models.friction import Frictionless

SPRING = Compliance(antiresonance_hz=20.0, resonance_hz=25.0, damping_ratio=0.0)
PLAY = Backlash(gap_rad=1e-2, load_share=0.4)
FREE = Frictionless()
FAR = 0.36 * INERTIA
"""Inertia behind `SPRING`: 1 - (20/25)^2 of all."""


def poles(model) -> np.ndarray:
    """Natural frequencies [Hz] of the undamped modes of a plant at rest, but for the rigid one."""
    found = eigvals(linear(model)[0])
    return np.unique(np.round(np.abs(found[np.abs(found) > 1]) / (2 * np.pi), 6))


def zeros(model, output: str = "q") -> np.ndarray:
    """Finite zeros from tau to an output: where the pencil of (A, B, C, D) loses rank."""
    A, B, C, D = linear(model, output)
    system = np.block([[A, B[:, None]], [C[None, :], np.array([[D]])]])
    mass = np.zeros_like(system)
    mass[: len(A), : len(A)] = np.eye(len(A))
    found = eigvals(system, mass)
    return found[np.isfinite(found) & (np.abs(found) < 1e6)]


def test_compliance_has_the_resonance_and_the_antiresonance_it_was_given() -> None:
    model = mount(SPRING, friction=FREE).model()
    np.testing.assert_allclose(poles(model), [25.0], rtol=1e-6)
    np.testing.assert_allclose(np.abs(zeros(model)) / (2 * np.pi), [20.0, 20.0], rtol=1e-6)
    assert zeros(model, "q_load").size == 0  # the far side has no antiresonance
    at, beside = (abs(response(model, hertz)) for hertz in (20.0, 19.0))
    assert at < 1e-9 * beside


def test_compliances_in_a_row_are_a_chain_of_springs() -> None:
    """Three bodies; closed form: eigenvalues of M^-1 K."""
    second = Compliance(antiresonance_hz=50.0, resonance_hz=60.0, damping_ratio=0.0)
    far2 = FAR * (1 - (50 / 60) ** 2)
    k1, k2 = FAR * (2 * np.pi * 20) ** 2, far2 * (2 * np.pi * 50) ** 2
    stiffness = np.array([[k1, -k1, 0], [-k1, k1 + k2, -k2], [0, -k2, k2]])
    masses = np.array([INERTIA - FAR, FAR - far2, far2])
    expected = np.sqrt(np.sort(eigvals(stiffness / masses[:, None]).real)[1:]) / (2 * np.pi)
    np.testing.assert_allclose(poles(mount(SPRING, second, friction=FREE).model()), expected, rtol=1e-6)


def test_pushed_through_the_play_both_bodies_move_as_one_and_do_not_bounce() -> None:
    run = simulate(mount(PLAY, friction=FREE).model(), np.linspace(0, 1, 400), lambda t: 0.5)
    twist, start = run["backlash.twist"], np.argmax(run["backlash.twist"] > 5e-3)
    assert start > 10
    assert twist[start:].min() > 4.9e-3
    assert run["v"][-1] - run["v"][-101] == pytest.approx(0.5 / INERTIA * (run["t"][-1] - run["t"][-101]), rel=1e-3)


def test_a_damped_contact_never_gives_energy() -> None:
    model, t = mount(PLAY, friction=FREE).model(), np.linspace(0, 0.4, 400)
    run = simulate(model, t, start={"speed": 0.1, "backlash.twist_rate": 0.1})
    near, far = 0.6 * INERTIA, 0.4 * INERTIA
    depth = np.maximum(np.abs(run["backlash.twist"]) - 5e-3, 0)
    kinetic = near * run["v"] ** 2 / 2 + far * (run["v"] - run["backlash.twist_rate"]) ** 2 / 2
    energy = kinetic + far * (2 * np.pi * PLAY.contact_hz) ** 2 * depth**2 / 2
    assert np.diff(energy).max() < 1e-9
    momentum = INERTIA * run["v"] - far * run["backlash.twist_rate"]
    np.testing.assert_allclose(momentum, near * 0.1, rtol=1e-6)
    assert abs(run["backlash.twist_rate"][-1]) < 0.16 * 0.1  # a seventh of the impact's speed is left


def test_play_in_a_flexible_drive_with_a_delay_is_a_plant_too() -> None:
    model = mount(Delay(delay_ms=2.0), PLAY, SPRING).model()
    assert [s.name for s in model.states if "twist" in s.name] == [
        *("backlash.twist", "backlash.twist_rate", "compliance.twist", "compliance.twist_rate")
    ]
    run = simulate(model, np.linspace(0, 0.3, 50), lambda t: 4.0)
    assert np.all(np.isfinite(run["q_load"]))
    np.testing.assert_allclose(
        run["q"] - run["backlash.twist"] - run["compliance.twist"], run["q_load"], rtol=0, atol=1e-15
    )


@pytest.mark.parametrize("kind", ["rotary", "linear"])
def test_a_free_axis_with_varying_inertia_keeps_its_energy(kind: str) -> None:
    effect = InertiaVariation(relative_amplitude=0.5, cycles_per_rev=2, phase=0.3)
    run = simulate(mount(effect, friction=FREE, motion=kind).model(), np.linspace(0, 2, 100), start={"speed": 1.0})
    turn = 2 * np.pi if kind == "linear" else 1.0
    energy = INERTIA * (1 + 0.5 * np.cos(2 * turn * run["q"] + 0.3)) * run["v"] ** 2 / 2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-6)
    assert np.ptp(run["v"]) > 0.3
