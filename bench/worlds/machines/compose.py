"""Everything of a case but its recordings, drawn: machine, truth, controller, noise, motions, card."""

import numpy as np

from .effects import EFFECTS
from .machines import CLASSES, LAWS, PI, between, draw, truth_friction
from .outside import unknown
from .recorder import WATCHED
from .users_card import draw_card

ROTARY_ONLY = {"gravity_unbalance", "load_dependent_friction"}
BY_TIMING = {"delay", "actuator_lag", "compliance"}
BY_ACCELERATION = BY_TIMING | {"clock_skew", "torque_saturation", "inertia_variation"}
WAVY = ("multisine", "chirp", "steps")
MOTIONS = ("sweeps", "triangle", "multisine", "stop_and_go", "steps", "short_strokes", "long_rests", "chirp")
OFTEN = (3, 2, 2, 4, 3, 2, 3, 1)
OFTEN_WITHOUT_RESTS = (5, 3, 2, 0.5, 0.5, 0, 0, 1)
"""Weights of the motions; a card that says nothing about held torque is mostly given few rests."""
DECOYS = ("humidity", "supply_voltage", "spindle_load", "vibration_rms")


def machine_for(rng, effects, kind):
    """Draw a machine on which the effects can be."""
    while True:
        m = draw(rng, str(rng.choice(list(CLASSES))))
        hanging = ROTARY_ONLY & set(effects) or kind == "payload_dropped"
        stiff = "compliance" in effects and (not m["compliant"] or m["rate"] < 250)
        slow = BY_TIMING & set(effects) and m["rate"] < 150
        if not ((m["linear"] and hanging) or stiff or slow or ("backlash" in effects and m["kind"] == "turntable")):
            return m


def _friction(rng, m, effects):
    """Choose truth and card law; returns plant numbers, truth, card law, whether the card has a Stribeck term."""
    card = str(rng.choice(["lugre", "static", "coulomb"], p=[0.5, 0.3, 0.2]))
    truth = str(rng.choice(LAWS, p=[0.3, 0.3, 0.1, 0.15, 0.15]))
    vt = None
    if "presliding" in effects:
        card = str(rng.choice(["static", "coulomb"]))
        truth = str(rng.choice(["lugre", "gms", "elasto_plastic", "dahl"]))
        m["presliding"] *= between(rng, 1, 20)
    elif card != "lugre" and rng.random() < 0.5:
        truth, vt = "tanh", m["v"] * between(rng, 3e-4, 3e-3)
    elif card != "lugre":
        truth = str(rng.choice(["lugre", "elasto_plastic", "dahl"]))
        m["presliding"] /= between(rng, 20, 100)
    elif rng.random() < 0.75:
        m["presliding"] = max(m["presliding"], m["quant"] * between(rng, 4, 30))
    stribeck = card != "coulomb" and bool(rng.random() < 0.75) and "stribeck" not in effects
    return truth_friction(rng, m, truth, stribeck, vt), truth, card, stribeck


def _plans(rng, effects, kind, few_rests):
    """Choose the kinds of motion of the three recordings; the first suits the effect."""
    weight = np.array(OFTEN_WITHOUT_RESTS if few_rests else OFTEN, float)
    pick = [str(x) for x in rng.choice(MOTIONS, 3, p=weight / weight.sum())]
    if BY_ACCELERATION & set(effects):
        pick[0], pick[2] = str(rng.choice(WAVY)), str(rng.choice([*WAVY, "sweeps", "stop_and_go"]))
    elif "dwell_breakaway" in effects:
        pick[0], pick[2] = "long_rests", str(rng.choice(["long_rests", "stop_and_go"]))
    elif {"presliding", "backlash"} & set(effects):
        pick[0] = str(rng.choice(["short_strokes", "sweeps", "stop_and_go"]))
    elif kind == "filter_switches":
        pick[0], pick[2] = str(rng.choice(WAVY)), str(rng.choice(WAVY))
    else:
        pick[0] = str(rng.choice(["sweeps", "sweeps", "triangle", "stop_and_go", "multisine"]))
    if pick[0] == pick[1] == pick[2] and rng.random() < 0.7:
        pick[2] = "sweeps" if pick[0] != "sweeps" else "triangle"
    return pick


def _payload(rng, m, wanted):
    """Hang a known load on a rotary axis."""
    m["payload_mgl"] = 0.0
    if m["linear"] or not (wanted or m["payload"]):
        return
    m["payload_mgl"], m["payload_phase"] = m["Fc"] * between(rng, 0.8, 4), rng.uniform(-PI, PI)
    m["limit"] += 1.5 * m["payload_mgl"]
    m["stroke"] = max(m["stroke"], 0.8) if wanted else m["stroke"]


def _effects(rng, m, p, effects, kind):
    """Draw the effects; the sizes of two of them are numbers of the friction law."""
    drawn = [unknown(rng, m, kind) if e == "unknown" else EFFECTS[e](rng, m) for e in effects]
    for e in drawn:
        if e.name == "presliding":
            e.plant, e.size, e.power = {"s0": p["s0"]}, ["s0"], -1.0
            e.low, e.high = p["Fs"] / (0.15 * m["stroke"]), p["Fs"] / (0.5 * m["resolution"])
        if e.name == "stribeck":
            e.plant = {"rise": e.plant["Fs"] / m["Fc"] - 1, "Vs": e.plant["Vs"]}
            e.size, e.low, e.high = ["rise"], 0.03, 2.0
    return drawn


def _controller(rng, m):
    small = m["kind"] == "hobby_servo"  # its loop is too slow to follow without being told
    ticks = (1, 1, 2, 4, 5) if m["rate"] < 3000 else (1, 2)
    control = {"kind": str(rng.choice(["cascade", "pid"])), "ratio": rng.uniform(3, 6), "damping": rng.uniform(0.6, 1),
               "ffd": float(small or rng.random() < 0.8), "feed": bool(rng.random() < (0.9 if small else 0.4)),
               "payload": bool(rng.random() < 0.5)}  # fmt: skip
    return {"control": control, "ticks": int(rng.choice(ticks)), "speed": rng.uniform(0.35, 1)}


def _noise(rng):
    """What nobody models: wandering level, torque noise, vibration of the ground, a slow thermometer."""
    return {"torque_noise": between(rng, 0.004, 0.03), "torque_memory": between(rng, 5e-3, 5e-2),
            "wander": between(rng, 0.005, 0.025), "wander_memory": between(rng, 8, 40),
            "ground": between(rng, 0.005, 0.04) if rng.random() < 0.25 else 0.0,
            "ground_band": (rng.uniform(2, 6), rng.uniform(8, 25)), "sensor_lag": between(rng, 0.5, 8)}  # fmt: skip


def _logger(rng, warm):
    """What is written: set point, temperature, columns that mean nothing, other names, a gap, jitter of the stamps."""
    temperatures = [rng.uniform(2, 12), rng.uniform(16, 24), rng.uniform(26, 36)]
    return {"recorded_temperature": warm or bool(rng.random() < 0.4), "recorded_q_d": bool(rng.random() < 0.7),
            "user_columns": [str(x) for x in rng.choice(DECOYS, 2, replace=False)] if rng.random() < 0.35 else [],
            "temperatures": [float(x) for x in rng.permutation(temperatures)],
            "tell_encoder": bool(rng.random() < 0.75), "renamed": bool(rng.random() < 0.1),
            "gap": rng.uniform(0.05, 0.5) if rng.random() < 0.06 else 0.0,
            "jitter": between(rng, 0.003, 0.03) if rng.random() < 0.1 else 0.0}  # fmt: skip


def compose(rng, family, effects, kind=""):
    """Draw a case: a dict of plain numbers, the machine, and the effects as drawn."""
    m = machine_for(rng, effects, kind)
    m["f_top"] *= 1.8 if BY_TIMING & set(effects) else 1.0
    _payload(rng, m, "load_dependent_friction" in effects or kind == "payload_dropped")
    m["start"] = rng.uniform(-1.5, 1.5) * (m["stroke"] if m["linear"] else 1)
    p, truth, card, stribeck = _friction(rng, m, effects)
    holds = card == "lugre" and truth != "tanh"
    m["rests"] = float(holds or "presliding" in effects or rng.random() < 0.2)
    drawn = _effects(rng, m, p, effects, kind)
    base = p | {"J": m["J"], "turn": m["turn"], "quant": m["quant"], "loop": between(rng, 4e-5, 2e-4)}
    if m["payload_mgl"]:
        base |= {"kn": m["payload_mgl"], "kn_p": m["payload_phase"]}
    case = {"family": family, "effects": list(effects), "kind": kind, "drawn": drawn, "machine": m, "base": base,
            "plant": {}, "truth": truth, "card": draw_card(rng, m, p, card, stribeck)}  # fmt: skip
    case |= _controller(rng, m) | _noise(rng)
    case |= _logger(rng, "thermal_viscosity" in effects or kind == "position_temperature_friction")
    case["loop"], case["seconds"] = m["rate"] * case["ticks"], (20, 50) if m["rate"] >= 3000 else (30, 80)
    case["kinds"] = _plans(rng, effects, kind, not holds or truth in ("elasto_plastic", "gms"))
    case["seeds"], case["slip_seed"] = [int(x) for x in rng.integers(0, 2**31, 3)], int(rng.integers(2**31))
    wanted = dict.fromkeys(c for e in drawn for c in e.channels if c not in WATCHED and c != "reading")
    return case | {"channels": list(wanted), "history": [], "complaints": []}
