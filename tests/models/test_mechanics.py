"""Axes that are not rigid, and inertia that changes: Newton for every body, no energy from nowhere."""

from dataclasses import replace

import numpy as np
import pytest
from effect_examples import INERTIA, evaluate, linear, mount, response, simulate
from scipy.linalg import eigvals

from pyfmi_models.effects import Delay
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.effects.inertia_variation import InertiaVariation
from pyfmi_models.friction import Coulomb, Frictionless

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


def test_slow_motion_feels_the_whole_inertia_and_fast_motion_the_near_part() -> None:
    model = mount(SPRING, friction=FREE).model()
    for hertz, inertia in ((0.1, INERTIA), (1e4, INERTIA - FAR)):
        assert response(model, hertz) == pytest.approx(-1 / (inertia * (2 * np.pi * hertz) ** 2), rel=1e-4)


def test_damping_of_a_compliance_is_that_of_its_antiresonance() -> None:
    damped = Compliance(antiresonance_hz=20.0, resonance_hz=25.0, damping_ratio=0.1)
    for zero in zeros(mount(damped, friction=FREE).model()):
        assert -zero.real / abs(zero) == pytest.approx(0.1, rel=1e-9)
        assert abs(zero) == pytest.approx(2 * np.pi * 20.0, rel=1e-9)


def test_compliances_in_a_row_are_a_chain_of_springs() -> None:
    """Three bodies; closed form: eigenvalues of M^-1 K."""
    second = Compliance(antiresonance_hz=50.0, resonance_hz=60.0, damping_ratio=0.0)
    far2 = FAR * (1 - (50 / 60) ** 2)
    k1, k2 = FAR * (2 * np.pi * 20) ** 2, far2 * (2 * np.pi * 50) ** 2
    stiffness = np.array([[k1, -k1, 0], [-k1, k1 + k2, -k2], [0, -k2, k2]])
    masses = np.array([INERTIA - FAR, FAR - far2, far2])
    expected = np.sqrt(np.sort(eigvals(stiffness / masses[:, None]).real)[1:]) / (2 * np.pi)
    np.testing.assert_allclose(poles(mount(SPRING, second, friction=FREE).model()), expected, rtol=1e-6)


def test_drive_friction_and_loads_act_on_the_near_side_and_the_spring_on_both() -> None:
    model, twist, rate = mount(SPRING, friction=Coulomb(Fc=1.0, sigma2=3.0)).model(), 1e-3, 0.02
    found = evaluate(
        model, tau=5.0, disturbance=0.5, speed=0.2, **{"compliance.twist": twist, "compliance.twist_rate": rate}
    )
    passed = FAR * (2 * np.pi * 20) ** 2 * twist
    near = found["der(speed)"]
    assert near * (INERTIA - FAR) == pytest.approx(5.0 - 0.5 - 1.0 - 3.0 * 0.2 - passed)
    assert (near - found["der(compliance.twist_rate)"]) * FAR == pytest.approx(passed)
    assert found["der(compliance.twist)"] == rate
    assert found["q_load"] == found["q"] - twist


def test_an_undamped_spring_keeps_the_energy() -> None:
    model, t = mount(SPRING, friction=FREE).model(), np.linspace(0, 0.2, 100)
    run = simulate(model, t, start={"speed": 0.3, "compliance.twist_rate": 0.3})
    far = run["speed"] - run["compliance.twist_rate"]
    kinetic = (INERTIA - FAR) * run["speed"] ** 2 / 2 + FAR * far**2 / 2
    energy = kinetic + FAR * (2 * np.pi * 20) ** 2 * run["compliance.twist"] ** 2 / 2
    assert np.ptp(energy) < 1e-6 * energy[0]
    assert np.ptp(kinetic) > 0.1 * energy[0]


@pytest.mark.parametrize("twist", [-0.0049, -1e-3, 0.0, 0.002, 0.0049])
@pytest.mark.parametrize("rate", [-3.0, 0.0, 3.0])
def test_inside_the_gap_no_torque_passes(twist: float, rate: float) -> None:
    assert float(PLAY.torque(twist, rate, 0.8)) == 0
    found = evaluate(mount(PLAY, friction=FREE).model(), tau=1.0, **{"backlash.twist": twist})
    assert found["der(speed)"] == pytest.approx(1.0 / (0.6 * INERTIA))  # only the near part is felt
    assert found["der(backlash.twist_rate)"] == found["der(speed)"]  # and the far part stays as it is


def test_the_friction_of_a_far_side_is_a_bristle() -> None:
    play = replace(PLAY, load_friction=0.3, load_viscous=0.5, load_deflection=1e-4)
    at = {"speed": 0.1, "backlash.twist_rate": 0.3, "backlash.bristle": 5e-5}  # it goes backwards, bent forwards
    found = evaluate(mount(play, friction=FREE).model(), **at)
    assert found["der(backlash.bristle)"] == pytest.approx(-0.2 - 0.2 * 0.5)
    far = found["der(speed)"] - found["der(backlash.twist_rate)"]
    assert far * 0.4 * INERTIA == pytest.approx(-(0.3 * 0.5 - 0.5 * 0.2))


@pytest.mark.parametrize("rate", [-10.0, -0.1, 0.0, 0.1, 10.0])
def test_a_contact_pushes_and_never_pulls_and_takes_hold_gradually(rate: float) -> None:
    for side in (-1, 1):
        depths = np.geomspace(1e-13, 1e-3, 60)
        torques = np.array([float(PLAY.torque(side * (5e-3 + depth), rate, 0.8)) for depth in depths])
        assert np.all(side * torques >= 0)
        assert abs(torques[0]) < 1e-3
        assert side * torques[-1] > 0 or side * rate < -0.1


def test_pushed_through_the_play_both_bodies_move_as_one_and_do_not_bounce() -> None:
    run = simulate(mount(PLAY, friction=FREE).model(), np.linspace(0, 1, 400), lambda t: 0.5)
    twist, start = run["backlash.twist"], np.argmax(run["backlash.twist"] > 5e-3)
    assert start > 10
    assert twist[start:].min() > 4.9e-3
    assert run["v"][-1] - run["v"][-101] == pytest.approx(0.5 / INERTIA * (run["t"][-1] - run["t"][-101]), rel=1e-3)


def test_after_a_reversal_the_far_side_waits_for_the_gap() -> None:
    """Moved slowly to and fro by 49 mrad, a far side with friction of its own follows by 49 less the gap of 10."""
    play, t = Backlash(gap_rad=1e-2, load_share=0.4, load_friction=0.3), np.linspace(0, 6, 401)
    model = mount(play, friction=Coulomb(Fc=0.0, sigma2=400.0)).model()  # heavy oil: speed follows torque
    run = simulate(model, t, lambda t: 400.0 * 0.025 * np.pi / 2 * np.cos(np.pi / 2 * t))
    late = t > 2
    assert np.ptp(run["q"][late]) > 0.045
    assert np.ptp(run["q_load"][late]) == pytest.approx(np.ptp(run["q"][late]) - 1e-2, abs=2e-4)
    assert np.abs(run["backlash.twist"]).max() < 5e-3 + 2e-4


def test_in_the_gap_the_far_side_is_slowed_by_its_own_oil() -> None:
    """Closed form: w = w0 exp(-t load_viscous / J_far); the near side, alone and without friction, keeps its speed."""
    play = Backlash(gap_rad=1.0, load_share=0.4, load_viscous=0.5)
    run = simulate(mount(play, friction=FREE).model(), np.linspace(0, 1, 50), start={"speed": 0.2})
    far = run["v"] - run["backlash.twist_rate"]
    np.testing.assert_allclose(far, 0.2 * np.exp(-run["t"] * 0.5 / (0.4 * INERTIA)), rtol=1e-5)
    np.testing.assert_allclose(run["v"], 0.2, rtol=1e-9)


@pytest.mark.parametrize("side", [-1, 1])
def test_pushed_through_the_play_oil_and_dry_friction_of_the_far_side_are_felt(side: int) -> None:
    play = Backlash(gap_rad=1e-2, load_share=0.4, load_friction=0.2, load_viscous=1.5)
    run = simulate(mount(play, friction=FREE).model(), np.linspace(0, 12, 400), lambda t: side * 0.5)
    assert run["v"][-1] == pytest.approx(side * (0.5 - 0.2) / 1.5, rel=1e-2)  # J / load_viscous is less than a second


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


def test_varying_inertia_behind_a_spring_is_the_near_part() -> None:
    effect = InertiaVariation(relative_amplitude=0.5, cycles_per_rev=2)
    found = evaluate(mount(effect, SPRING, friction=FREE).model(), position=np.pi / 2, tau=1.0)
    assert found["der(speed)"] == pytest.approx(1 / (0.5 * (INERTIA - FAR)))
