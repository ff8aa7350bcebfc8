"""Plant and concealed truth mean the same by an effect: signs, phases, units, where it acts.

`cosim_studies/proof/truth.c` shares no code and no integrator with the plant; most effects are the same formula,
and that is what is tested. Its loop is run with the effect; the plant gets the recorded command, once with and once
without the effect. What the effect did must be explained.
"""

from typing import Any

import casadi as ca
import numpy as np
import pytest
from effect_examples import FORM, mount

from cosim_studies.proof import truth
from cosim_studies.proof.families import periodic_disturbance
from cosim_studies.proof.recorder import columns_of
from cosim_studies.proof.simulated_axis import draw_axis
from cosim_studies.proof.truth import BLOCKS, TICK, Drive
from pyfmi_models.effects import Cogging, Effect, GravityUnbalance
from pyfmi_models.friction import Coulomb, LuGre
from pyfmi_models.model import Model

LAW = LuGre(sigma0=3e4, sigma1=200.0, sigma2=5.0, Fc=2.0)
TRUTH = {
    **{"inertia": 2.0, "coulomb": 2.0, "breakaway": 2.0, "viscous": 5.0, "stiffness": 3e4, "damping": 200.0},
    **{"kp": 150.0, "kd": 25.0, "observer": 100.0, "loop_inertia": 2.0, "stribeck_speed": 0.02, "stribeck_power": 2.0},
    **{"block_weight": np.full(BLOCKS, 1 / BLOCKS), "block_reach": np.full(BLOCKS, 1e-4)},
}
QUARTER = np.pi / 2
"""The generator writes sines where cogging and periodic friction are cosines here."""


def cogging() -> tuple[tuple[Effect, ...], dict[str, float]]:
    x = np.linspace(0, 2 * np.pi, 100_001)
    half = float(np.ptp(np.sin(x) + 0.4 * np.sin(2 * x) - 0.2 * np.sin(3 * x))) / 2
    ours = Cogging(cycles_per_rev=20, amplitude=1.5 * half, phase=0.7 - QUARTER, harmonics=(0.4, -0.2))
    parts = {"cogging_1": 1.5, "cogging_2": 0.6, "cogging_3": -0.3}
    return (ours,), parts | {"cogging_cycles": 20.0, "cogging_phase": 0.7}


def two_masses(share: float, hertz: float, ratio: float) -> dict[str, float]:
    far, omega = 2.0 * share, 2 * np.pi * hertz
    parts = {"inertia": 2.0 - far, "load_inertia": far, "drive_stiffness": far * omega**2}
    return parts | {"drive_damping": 2 * ratio * omega * far}


def one(form: str, **numbers: float) -> tuple[Effect, ...]:
    return (FORM[form](**numbers),)


WEIGHT = GravityUnbalance(mgl=3.0, phase=0.4)
CASES: dict[str, tuple[tuple[Effect, ...], dict[str, float]]] = {
    "friction_asymmetry": (
        one("FrictionAsymmetry", level_asymmetry=0.2, viscous_asymmetry=-0.3),
        {"level_asymmetry": 0.2, "viscous_asymmetry": -0.3},
    ),
    "stribeck": (one("StribeckEffect", Fs=3.5, Vs=0.5), {"breakaway": 3.5, "stribeck_speed": 0.5}),
    "cogging": cogging(),
    "position_friction, periodic": (
        one("PeriodicFriction", cycles_per_rev=9, relative_amplitude=0.4, phase=0.3 - QUARTER),
        {"rough_relative": 0.4, "rough_cycles": 9, "rough_phase": 0.3},
    ),
    "position_friction, local": (
        one("LocalFriction", q_center=0.15, width=0.04, relative_amplitude=0.8),
        {"spot_relative": 0.8, "spot_center": 0.15, "spot_width": 0.04},
    ),
    "gravity_unbalance": ((WEIGHT,), {"unbalance": 3.0, "unbalance_phase": 0.4}),
    "torque_offset": (one("TorqueOffset", torque=-0.8), {"offset": -0.8}),
    "thermal_viscosity": (
        one("ThermalViscosity", viscous_per_degC=-0.04, coulomb_per_degC=-0.02),
        {"thermal_viscous": -0.04, "thermal_level": -0.02},
    ),
    "dwell_breakaway": (
        one("DwellBreakaway", torque_per_efold=0.8, onset_s=0.02, memory_rad=2e-2),
        {"dwell_torque": 0.8, "dwell_time": 0.02, "dwell_length": 2e-2},
    ),
    "compliance": (
        one("Compliance", antiresonance_hz=8.0, resonance_hz=8.0 / np.sqrt(0.6), damping_ratio=0.03),
        two_masses(0.4, 8.0, 0.03),
    ),
    "actuator_lag": (one("ActuatorLag", time_constant_ms=6.0), {"lag": 6e-3}),
    "delay": (one("Delay", delay_ms=6.0), {"delay": 6e-3}),
    "backlash": (
        one("Backlash", gap_rad=0.02, load_share=0.5, contact_hz=30.0),
        two_masses(0.5, 30.0, 0.75) | {"gap": 0.02},
    ),
    "encoder_eccentricity": (
        one("EncoderEccentricity", cycles_per_rev=8, amplitude_rad=2e-3, phase=0.5, second=0.3),
        {"ripple_1": 2e-3, "ripple_2": 6e-4, "ripple_cycles": 8, "ripple_phase": 0.5},
    ),
    "quadratic_drag": (one("QuadraticDrag", coefficient=2.0), {"quadratic": 2.0}),
    "cable_wrap": (
        one("CableWrap", stiffness=6.0, home=0.1, hardening=2.0),
        {"cable": 6.0, "cable_home": 0.1, "cable_hardening": 2.0},
    ),
    "inertia_variation": (
        one("InertiaVariation", relative_amplitude=0.4, cycles_per_rev=3, phase=0.6),
        {"inertia_swing": 0.4, "inertia_cycles": 3, "inertia_phase": 0.6},
    ),
    "load_dependent_friction": (
        (WEIGHT, *one("LoadDependentFriction", coulomb_per_Nm=0.3)),
        {"payload": 3.0, "payload_phase": 0.4, "load_sensitivity": 0.3},
    ),
    "torque_saturation": (one("TorqueSaturation", knee_torque=8.0, slope=0.4), {"knee": 8.0, "knee_slope": 0.4}),
}
"""Effects of the plant, and what conceals the same in the truth."""
LEFT = 0.01
"""Share of what an effect did to the position that the plant may leave; the two integrators differ by 16 urad."""
DEGREES = 32.0


def concealed(parameters: dict[str, Any], ticks: int = 6000) -> dict[str, np.ndarray]:
    """The loop of the truth on a swing of 0.4 rad and more than 1 Hz that starts softly."""
    t = truth.ticks(ticks)
    target = 0.4 * np.sin(8 * t) ** 2
    speed, acceleration = np.gradient(target, t), np.gradient(np.gradient(target, t), t)
    zero = np.zeros(ticks)
    drive = Drive(target, speed, acceleration, push=zero, level=zero + 1, noise=zero, ambient=zero + DEGREES)
    return truth.simulate(TRUTH | parameters, drive, DEGREES)


def replayed(model: Model, command: np.ndarray, **start: float) -> dict[str, np.ndarray]:
    """Outputs at the ticks under a held command: Runge-Kutta 4, eight steps a tick."""
    x, u, p = ca.SX.sym("x", len(model.states)), ca.SX.sym("u"), [one.start for one in model.parameters]
    inputs = ca.vertcat(u, 0, *([DEGREES] if len(model.inputs) > 2 else []))
    rates, outputs = model.equations(0, x, inputs, p)
    f, h, y = ca.Function("f", [x, u], [rates]), TICK / 8, x
    slope = [f(y, u)]
    for share in (0.5, 0.5, 1.0):
        slope.append(f(y + share * h * slope[-1], u))
    small = ca.Function("small", [x, u], [y + h / 6 * (slope[0] + 2 * slope[1] + 2 * slope[2] + slope[3])])
    y = ca.MX.sym("y", len(model.states))
    w = ca.MX.sym("w")
    tick = ca.Function("tick", [y, w], [small.mapaccum(8)(y, ca.repmat(w, 1, 8))[:, -1]])
    first = np.array([start.get(state.name, state.start) for state in model.states])
    after = tick.mapaccum(len(command) - 1)(first, command[:-1].reshape(1, -1)).full()
    states = np.column_stack([first, after])
    shown = ca.Function("shown", [x, u], [outputs]).map(len(command))(states, command.reshape(1, -1)).full()
    return {output.name: row for output, row in zip(model.outputs, shown, strict=True)}


@pytest.mark.parametrize("name", CASES)
def test_plant_and_truth_mean_the_same(name: str) -> None:
    effects, parameters = CASES[name]
    made = concealed(parameters)
    base = effects[:1] if name == "load_dependent_friction" else ()
    start = {"dwell_breakaway.age": 0.02}
    without, with_it = (replayed(mount(*e, friction=LAW).model(), made["command"], **start) for e in (base, effects))
    done = np.abs(without["q"] - made["clean_reading"]).max()
    left = np.abs(with_it["q"] - made["clean_reading"]).max()
    assert done > 1e-3
    assert left < LEFT * done
    if name == "encoder_eccentricity":
        assert np.abs(with_it["q_true"] - made["angle"]).max() < 2e-5


def test_a_periodic_disturbance_has_its_frequency_amplitude_and_phase() -> None:
    bench = draw_axis(1, "lugre", 1.0, 1000, 2.0)
    before = {name: drive.push for name, drive in bench.drives.items()}
    true = periodic_disturbance(bench, np.random.default_rng(1), 1.0)
    for name, phase in true["phases"].items():
        ours = FORM["PeriodicDisturbance"](frequency_hz=true["frequency_hz"], amplitude=true["amplitude"], phase=phase)
        t = truth.ticks(before[name].size)
        load = np.asarray(ours.load(mount().at(ca.DM(t), 0.0, 0.0))).ravel()
        np.testing.assert_allclose(load, bench.drives[name].push - before[name], atol=1e-9 * true["amplitude"])


def test_a_positive_offset_of_the_clocks_means_a_reading_ahead_of_the_torque() -> None:
    bench = draw_axis(1, "lugre", 1.0, 1000, 2.0)
    bench.clock = {"offset_ms": 5.0, "drift_ppm": 500.0}
    bench.noise["encoder_rms"] = 0.0
    t = truth.ticks(20_000)
    raw = {"command": 0 * t, "reading": t, "clean_reading": t, "temperature": 0 * t}  # reads its own time
    table = columns_of(bench, "train_1", raw, 1000, np.random.default_rng(0))
    ours = FORM["ClockSkew"](offset_ms=5.0, drift_ppm=500.0)
    expected = [float(ours.ahead(mount().at(time, 0.0, 0.0))) for time in table.t[:1000]]
    np.testing.assert_allclose((table.q - table.t)[:1000], expected, atol=bench.noise["quantum"])


def test_a_contact_that_bends_is_the_same_in_both() -> None:
    made = concealed({})
    static = Coulomb(Fc=2.0, sigma2=5.0)
    bent = replayed(mount(FORM["Presliding"](sigma0=3e4, sigma1=200.0), friction=static).model(), made["command"])
    assert np.abs(bent["q"] - made["angle"]).max() < 2e-5
