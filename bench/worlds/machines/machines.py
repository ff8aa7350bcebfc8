"""Classes of machines: numbers of a real one, drawn."""

import numpy as np

PI = np.pi


def between(rng, low, high):
    """Draw evenly on a logarithmic scale."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def robot_joint(rng):
    """A joint with a strain-wave gear; the encoder sits on the motor, seen from the axis."""
    gear, J = float(rng.choice([50, 80, 100, 120, 160])), between(rng, 0.3, 8)
    v = rng.uniform(0.8, 2.5)
    return dict(
        linear=False,
        J=J,
        Fc=J * between(rng, 2, 8),
        v=v,
        a=v * rng.uniform(2.5, 6),
        stroke=rng.uniform(0.7, 2),
        visc=rng.uniform(0.4, 1.5),
        quant=2 * PI / (gear * float(rng.choice([4096, 8192, 65536]))),
        ratio=gear,
        presliding=between(rng, 1e-4, 6e-4),
        rate=rng.choice([500, 1000, 1000, 2000, 4000]),
        payload=rng.random() < 0.5,
        orders=(2, 60),
        gear_order=2 * gear,
        compliant=True,
    )


def ball_screw(rng):
    """A linear axis on a ball screw: rotary encoder on the motor or a linear scale."""
    M, v, lead = between(rng, 15, 400), rng.uniform(0.08, 0.5), float(rng.choice([5e-3, 1e-2, 2e-2]))
    scale = rng.random() < 0.4
    return dict(
        linear=True,
        J=M,
        Fc=M * between(rng, 0.15, 0.8),
        v=v,
        a=rng.uniform(0.6, 3),
        stroke=rng.uniform(0.08, 0.3),
        visc=rng.uniform(0.3, 2),
        quant=float(rng.choice([1e-7, 5e-7, 1e-6])) if scale else lead / 4096,
        ratio=1 / lead,
        presliding=between(rng, 2e-6, 3e-5),
        rate=rng.choice([1000, 1000, 2000, 4000, 5000]),
        payload=False,
        orders=(5, 2 / lead),
        gear_order=1 / lead,
        compliant=True,
    )


def belt(rng):
    """A carriage on a toothed belt, the encoder on the motor's pulley."""
    M, v, turn = between(rng, 1.5, 40), rng.uniform(0.4, 2), 2 * PI * rng.uniform(0.012, 0.03)
    return dict(
        linear=True,
        J=M,
        Fc=M * between(rng, 0.4, 2),
        v=v,
        a=v * rng.uniform(2, 6),
        stroke=rng.uniform(0.2, 0.7),
        visc=rng.uniform(0.2, 1.2),
        quant=turn / float(rng.choice([2000, 4096, 16384])),
        ratio=1 / turn,
        presliding=between(rng, 1e-5, 1e-4),
        rate=rng.choice([250, 500, 1000, 1000, 2000]),
        payload=False,
        orders=(3, 40),
        gear_order=1 / turn,
        compliant=True,
    )


def turntable(rng):
    """A table with a direct drive: light, fast, many slots."""
    J, v = between(rng, 0.02, 4), rng.uniform(1, 6)
    return dict(
        linear=False,
        J=J,
        Fc=J * between(rng, 1, 5),
        v=v,
        a=v * rng.uniform(1.5, 5),
        stroke=rng.uniform(1, 6),
        visc=rng.uniform(0.2, 1.5),
        quant=2 * PI / 2.0 ** int(rng.integers(18, 24)),
        ratio=1.0,
        presliding=between(rng, 2e-5, 4e-4),
        rate=rng.choice([1000, 1000, 2000, 5000]),
        payload=rng.random() < 0.2,
        orders=(4, 48),
        gear_order=float(rng.integers(12, 40)),
        compliant=False,
    )


def rotary_table(rng):
    """A table with a worm: slow, much friction."""
    J, v = between(rng, 0.5, 20), rng.uniform(0.15, 0.8)
    return dict(
        linear=False,
        J=J,
        Fc=J * between(rng, 0.3, 1.5),
        v=v,
        a=v * rng.uniform(2, 5),
        stroke=rng.uniform(0.4, 2),
        visc=rng.uniform(0.3, 1.5),
        quant=2 * PI / 2.0 ** int(rng.integers(17, 22)),
        ratio=float(rng.choice([1, 60, 90])),
        presliding=between(rng, 2e-5, 2e-4),
        rate=rng.choice([500, 1000, 1000, 2000]),
        payload=rng.random() < 0.3,
        orders=(6, 100),
        gear_order=float(rng.choice([60, 72, 90])),
        compliant=True,
    )


def hobby_servo(rng):
    """A small servo with a coarse encoder, mostly under a pendulum."""
    J, v = between(rng, 3e-4, 6e-3), rng.uniform(1.5, 5)
    step = float(rng.choice([2 * PI / 4096, 2 * PI / 4096, 3e-3]))
    return dict(
        linear=False,
        J=J,
        Fc=J * between(rng, 8, 25),
        v=v,
        a=v * rng.uniform(5, 10),
        stroke=rng.uniform(0.8, 1.6),
        visc=rng.uniform(0.3, 1.2),
        quant=step,
        ratio=1.0,
        presliding=between(rng, 1e-3, 6e-3),
        rate=rng.choice([100, 200, 200, 250]),
        payload=rng.random() < 0.7,
        orders=(2, 12),
        gear_order=float(rng.integers(4, 12)),
        compliant=False,
    )


def mount(rng):
    """An axis of a telescope under an ordinary PID."""
    J, v = between(rng, 5, 60), rng.uniform(0.1, 0.8)
    return dict(
        linear=False,
        J=J,
        Fc=J * between(rng, 0.05, 0.3),
        v=v,
        a=v * rng.uniform(0.8, 2.5),
        stroke=rng.uniform(0.4, 1.5),
        visc=rng.uniform(0.3, 2),
        quant=2 * PI / 2.0 ** int(rng.integers(22, 27)),
        ratio=float(rng.choice([1, 1, 24, 36])),
        presliding=between(rng, 2e-5, 3e-4),
        rate=rng.choice([500, 1000, 1000, 1000]),
        payload=rng.random() < 0.3,
        orders=(8, 60),
        gear_order=float(rng.integers(12, 48)),
        compliant=True,
    )


CLASSES = {f.__name__: f for f in (robot_joint, ball_screw, belt, turntable, rotary_table, hobby_servo, mount)}
LAWS = ("lugre", "gms", "tanh", "elasto_plastic", "dahl")


def draw(rng, kind):
    """Draw a machine: its class's numbers and what all classes share."""
    m = CLASSES[kind](rng) | {"kind": kind, "turn": 1.0}
    m["turn"] = 2 * PI if m["linear"] else 1.0
    m["rate"] = float(m["rate"])
    m["s2"] = m["visc"] * m["Fc"] / m["v"]
    m["slowest"] = between(rng, 0.02, 0.2)
    m["f_top"] = rng.uniform(2.5, 7.0) if m["rate"] > 150 else rng.uniform(1.5, 3.0)
    m["noise"] = between(rng, 0.1, 1.0) * m["quant"] if rng.random() < 0.7 else 0.3 * m["quant"]
    m["noise"] = max(m["noise"], 1e-7 * (0.1 if m["linear"] else 1) * rng.uniform(0.5, 2))
    m["noise"] = m["quant"] * between(rng, 0.05, 0.3) if kind == "hobby_servo" else m["noise"]
    m["resolution"] = max(m["quant"], 2 * m["noise"])
    m["presliding"] = max(m["presliding"], 2e-2 * m["resolution"])
    m["limit"] = 1.6 * (m["J"] * m["a"] + 2.5 * m["Fc"] + m["s2"] * m["v"])
    return m


def truth_friction(rng, m, law, stribeck, vt=None):
    """Friction as it is: numbers of a law. `presliding` of the machine is the distance to break-away."""
    Fs = m["Fc"] * (rng.uniform(1.15, 1.6) if stribeck else 1.0)
    s0 = Fs / m["presliding"]
    p = dict(law=LAWS.index(law), Fc=m["Fc"], Fs=Fs, Vs=m["v"] * between(rng, 0.01, 0.06), delta=2.0, s2=m["s2"], s0=s0)
    if law == "dahl":
        p["delta"] = 2.0
    p["s1"] = 2 * rng.uniform(0.1, 0.6) * np.sqrt(s0 * m["J"]) * rng.uniform(0.3, 1)
    p["vt"] = vt or m["v"] * between(rng, 5e-4, 3e-3)
    p["ep_ba"], p["dahl_n"] = rng.uniform(0.2, 0.8), rng.uniform(0.6, 1.6)
    p["gms_rate"] = between(rng, 5, 60) * m["v"] / m["presliding"] * 0.02
    p["vsmall"] = max(m["v"] * 5e-4, 1e-12)
    return p


def slips(rng, p):
    """Maxwell-slip elements: stiffness and share of the level, springs that give way one after another."""
    n = int(rng.integers(4, 9))
    share = rng.dirichlet(np.full(n, 3.0))
    give = np.sort(np.exp(rng.uniform(np.log(0.15), np.log(2.5), n)))
    return p["s0"] * share / give, share
