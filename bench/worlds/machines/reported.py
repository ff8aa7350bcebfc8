"""Truth in the names and units in which the tool reports."""

import numpy as np

from .machines import PI

NUMBERS = {
    "friction_asymmetry": dict(level_asymmetry="as_g", viscous_asymmetry="as_v"),
    "stribeck": dict(Fs="Fs", Vs="Vs"),
    "cogging": dict(cycles_per_rev="cg_N", amplitude="cg_A", phase="cg_p1"),
    "gravity_unbalance": dict(mgl="gv", phase="gv_p"),
    "torque_offset": dict(torque="of"),
    "thermal_viscosity": dict(viscous_per_degC="th_v", coulomb_per_degC="th_c"),
    "dwell_breakaway": dict(torque_per_efold="dw_b"),
    "backlash": dict(gap_rad="gap"),
    "encoder_eccentricity": dict(cycles_per_rev="ec_N", amplitude_rad="ec_A"),
    "quadratic_drag": dict(coefficient="qd"),
    "cable_wrap": dict(stiffness="cw_k", home="cw_q0"),
    "load_dependent_friction": dict(coulomb_per_Nm="ld"),
    "torque_saturation": dict(knee_torque="ts_T"),
    "periodic_disturbance": dict(frequency_hz="f", amplitude="A"),
    "clock_skew": dict(drift_ppm="ppm"),
}
"""The tool's name of a number and the plant's, where they are the same number."""


def reported(e, m):
    """Truth in the units and names that the tool reports."""
    p = e.plant
    out = {name: float(p[key]) for name, key in NUMBERS.get(e.name, {}).items() if key in p}
    if e.name == "presliding":
        out = dict(sigma0=m["s0_true"])
    if e.name == "position_friction":
        out = dict(relative_amplitude=p["pf_A"]) | (
            dict(cycles_per_rev=p["pf_N"]) if p["pf_kind"] == 1 else dict(q_center=p["pf_q0"], width=p["pf_w"])
        )
    if e.name == "compliance":
        far = p["far"]
        fa = np.sqrt(p["k"] / (m["J"] * far)) / (2 * PI)
        out = dict(antiresonance_hz=float(fa), resonance_hz=float(fa / np.sqrt(1 - far)))
    if e.name == "actuator_lag":
        out = dict(time_constant_ms=1e3 * p["lag"])
    if e.name == "delay":
        out = dict(delay_ms=1e3 * p["delay"])
    if e.name == "clock_skew":
        out["offset_ms"] = 1e3 * p["offset"]
    if e.name == "inertia_variation":
        out = dict(relative_amplitude=abs(p["in_A"])) | (dict(cycles_per_rev=p["in_N"]) if p["in_kind"] == 1 else {})
    if e.name == "unknown":
        out = dict(kind=e.kind)
    return out
