"""Concealed effects: what the plant gets, what is scaled to set the size, which channels carry it, what is reported."""

from dataclasses import dataclass, field

import numpy as np

from .machines import PI, between


@dataclass
class Drawn:
    """An effect of one case.

    `size`: parameters scaled together, `low` and `high`: bounds of the first; `power`: exponent of that scaling
    (negative: less is more); `channels`: the plant's channels that carry its torque.
    """

    name: str
    plant: dict
    size: list = field(default_factory=list)
    low: float = 0.0
    high: float = np.inf
    channels: tuple = ()
    power: float = 1.0
    kind: str = ""

    def scale(self, factor):
        """Scale the size; tell whether anything moved."""
        if not self.size:
            return False
        key = self.size[0]
        x = abs(self.plant[key])
        y = float(np.clip(x * factor**self.power, self.low, self.high))
        for one in self.size:
            self.plant[one] *= y / x
        return abs(y / x - 1) > 0.02


def _sign(rng):
    return float(rng.choice([-1, 1]))


def _where(rng, m, low, high):
    return m["stroke"] * rng.uniform(low, high) + m["start"]


def friction_asymmetry(r, m):
    p = dict(as_g=_sign(r) * between(r, 0.03, 0.15), as_v=_sign(r) * between(r, 0.03, 0.3))
    return Drawn("friction_asymmetry", p, ["as_g", "as_v"], 0.004, 0.4, ("asymmetry", "asymmetry_v"))


def stribeck(r, m):
    p = dict(Fs=m["Fc"] * r.uniform(1.15, 1.9), Vs=m["v"] * between(r, 0.015, 0.12))
    return Drawn("stribeck", p, [], channels=("stribeck",))


def presliding(r, m):
    return Drawn("presliding", dict(), [], channels=("bristles",))


def cogging(r, m):
    low, high = m["orders"]
    N = m["gear_order"] if r.random() < 0.3 else np.round(between(r, low, high))
    if m["linear"] and r.random() < 0.5:
        N = m["ratio"] * float(r.integers(1, 4))
    p = dict(cg_A=m["Fc"] * between(r, 0.03, 0.3), cg_N=float(N), cg_p1=r.uniform(-PI, PI), cg_half=1.0)
    if r.random() < 0.6:
        p |= dict(
            cg_h2=between(r, 0.05, 0.5), cg_p2=r.uniform(-PI, PI), cg_h3=between(r, 0.03, 0.3), cg_p3=r.uniform(-PI, PI)
        )
    a = np.linspace(0, 2 * PI, 2000)
    w = sum(
        p.get(h, 1.0 if k == 1 else 0.0) * np.sin(k * a + p.get(f"cg_p{k}", 0))
        for k, h in ((1, ""), (2, "cg_h2"), (3, "cg_h3"))
    )
    p["cg_half"] = float(np.ptp(w) / 2)
    return Drawn("cogging", p, ["cg_A"], 0.003 * m["Fc"], 1.5 * m["Fc"], ("cogging",))


def position_friction(r, m):
    if r.random() < 0.5:
        low = 2 * PI / (2 * m["stroke"] * m["turn"]) * 1.2
        p = dict(
            pf_kind=1.0,
            pf_N=float(max(np.round(between(r, low, 12 * low)), 1)),
            pf_p=r.uniform(-PI, PI),
            pf_h=r.uniform(0, 0.6),
        )
        p["pf_A"] = between(r, 0.05, 0.4)
    else:
        p = dict(
            pf_kind=float(r.choice([2, 3])), pf_q0=_where(r, m, -0.4, 0.4), pf_w=m["stroke"] * r.uniform(0.06, 0.25)
        )
        p["pf_A"] = between(r, 0.1, 0.7) * (1 if r.random() < 0.8 else -0.5)
    return Drawn(
        "position_friction", p, ["pf_A"], 0.02, 0.9 if p["pf_kind"] == 1 or p["pf_A"] < 0 else 2.5, ("position",)
    )


def gravity_unbalance(r, m):
    p = dict(gv=m["Fc"] * between(r, 0.05, 0.6), gv_p=r.uniform(-PI, PI))
    return Drawn("gravity_unbalance", p, ["gv"], 0.01 * m["Fc"], 4 * m["Fc"], ("gravity",))


def torque_offset(r, m):
    return Drawn(
        "torque_offset",
        dict(of=_sign(r) * m["Fc"] * between(r, 0.03, 0.3)),
        ["of"],
        0.005 * m["Fc"],
        m["Fc"],
        ("offset",),
    )


def thermal_viscosity(r, m):
    p = dict(th_v=-between(r, 0.004, 0.03), th_c=-between(r, 0.001, 0.012))
    return Drawn("thermal_viscosity", p, ["th_v", "th_c"], 0.001, 0.06, ("thermal", "thermal_v"))


def dwell_breakaway(r, m):
    p = dict(
        dw_b=m["Fc"] * between(r, 0.03, 0.15), dw_t=between(r, 0.1, 1.0), dw_D=m["stroke"] * between(r, 0.004, 0.03)
    )
    return Drawn("dwell_breakaway", p, ["dw_b"], 0.01 * m["Fc"], 0.4 * m["Fc"], ("dwell",))


def _two(r, m, f, damping):
    far = r.uniform(0.3, 0.7)
    k = m["J"] * far * (2 * PI * f) ** 2
    return dict(two=1.0, far=far, k=k, c=2 * damping * m["J"] * far * 2 * PI * f)


def compliance(r, m):
    p = _two(r, m, between(r, 7, 35), between(r, 0.01, 0.08))
    p["encoder_far"] = float(r.random() < 0.15)
    return Drawn(
        "compliance",
        p,
        ["k", "c"],
        m["J"] * p["far"] * (2 * PI * 4) ** 2,
        m["J"] * p["far"] * (2 * PI * 60) ** 2,
        ("two",),
        -0.5,
    )


def backlash(r, m):
    p = _two(r, m, between(r, 25, 160), between(r, 0.1, 0.5)) | dict(far_rub=r.uniform(0.15, 0.55))
    p["gap"] = max(4 * m["resolution"], m["stroke"] * between(r, 5e-4, 1e-2))
    p["encoder_far"] = float(r.random() < 0.1)
    return Drawn("backlash", p, ["gap"], 2 * m["resolution"], 0.04 * m["stroke"], ("two",))


def actuator_lag(r, m):
    return Drawn("actuator_lag", dict(lag=between(r, 2e-3, 1.5e-2)), ["lag"], 8e-4, 3e-2, ("lag",))


def delay(r, m):
    return Drawn("delay", dict(delay=between(r, 2e-3, 1.5e-2)), ["delay"], 6e-4, 2e-2, ("delay",))


def encoder_eccentricity(r, m):
    N = m["ratio"] if not m["linear"] or r.random() < 0.6 else 1 / (m["stroke"] * r.uniform(0.3, 1))
    if N * m["turn"] * m["v"] > 100:
        N = max(float(np.round(40 / m["turn"] / m["v"])), 1.0)
    A = 0.1 * m["Fc"] / (m["J"] * (N * m["turn"] * m["v"]) ** 2)
    p = dict(ec_N=N, ec_A=A, ec_p=r.uniform(-PI, PI), ec_2=r.uniform(0, 0.5), ec_p2=r.uniform(-PI, PI))
    return Drawn("encoder_eccentricity", p, ["ec_A"], 2 * m["noise"], 0.25 / (N * m["turn"]), ("reading",))


def quadratic_drag(r, m):
    return Drawn("quadratic_drag", dict(qd=m["Fc"] * between(r, 0.1, 1) / m["v"] ** 2), ["qd"], 0, np.inf, ("drag",))


def cable_wrap(r, m):
    p = dict(cw_k=m["Fc"] * between(r, 0.05, 0.5) / m["stroke"], cw_q0=_where(r, m, -0.6, 0.6))
    p["cw_h"] = r.choice([0, 1]) * between(r, 0.1, 2) / m["stroke"] ** 2
    return Drawn("cable_wrap", p, ["cw_k"], 0, np.inf, ("cable",))


def inertia_variation(r, m):
    if r.random() < 0.6:
        N = float(r.choice([1, 2])) if not m["linear"] else float(np.round(between(r, 0.3, 1.2) / m["stroke"], 3))
        p = dict(in_A=between(r, 0.03, 0.25), in_kind=1.0, in_N=N, in_p=r.uniform(-PI, PI))
    else:
        p = dict(
            in_A=_sign(r) * between(r, 0.03, 0.25),
            in_kind=2.0,
            in_q0=_where(r, m, -0.3, 0.3),
            in_w=m["stroke"] * r.uniform(0.2, 0.6),
        )
    return Drawn("inertia_variation", p, ["in_A"], 0.01, 0.6, ("inertia",))


def load_dependent_friction(r, m):
    return Drawn("load_dependent_friction", dict(ld=between(r, 0.01, 0.15)), ["ld"], 0.002, 0.6, ("load",))


def torque_saturation(r, m):
    top = 0.7 * m["J"] * m["a"] + m["Fc"] + 0.5 * m["s2"] * m["v"]
    p = dict(ts_T=top * r.uniform(0.4, 0.9))
    p |= dict(ts_n=r.uniform(3, 8)) if r.random() < 0.5 else dict(ts_slope=r.uniform(0.2, 0.7))
    return Drawn("torque_saturation", p, ["ts_T"], 0.15 * top, 2 * top, ("saturation",), -0.5)


def periodic_disturbance(r, m):
    p = dict(
        f=between(r, 0.5, 12),
        A=m["Fc"] * between(r, 0.02, 0.2),
        f2=between(r, 0.5, 12) if r.random() < 0.3 else 0.0,
        sway=r.uniform(0, 0.5),
    )
    return Drawn("periodic_disturbance", p, ["A"], 0.002 * m["Fc"], 1.5 * m["Fc"], ("tone",), kind="tone")


def clock_skew(r, m):
    if r.random() < 0.5:
        return Drawn(
            "clock_skew",
            dict(ppm=_sign(r) * between(r, 60, 600), offset=0.0),
            ["ppm"],
            30,
            2000,
            ("reading",),
            kind="clock",
        )
    return Drawn(
        "clock_skew", dict(ppm=0.0, offset=between(r, 1e-3, 8e-3)), ["offset"], 6e-4, 2e-2, ("reading",), kind="clock"
    )


EFFECTS = {
    f.__name__: f
    for f in (
        friction_asymmetry,
        stribeck,
        presliding,
        cogging,
        position_friction,
        gravity_unbalance,
        torque_offset,
        thermal_viscosity,
        dwell_breakaway,
        compliance,
        actuator_lag,
        delay,
        backlash,
        encoder_eccentricity,
        quadratic_drag,
        cable_wrap,
        inertia_variation,
        load_dependent_friction,
        torque_saturation,
        periodic_disturbance,
        clock_skew,
    )
}
