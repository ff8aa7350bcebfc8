"""What the user believes about the machine, and the card that says it."""

import numpy as np

from .machines import LAWS, between

TANH = LAWS.index("tanh")
KEYS = {"lugre": ("s0", "s1", "s2", "Fc", "Fs", "Vs"), "static": ("s2", "Fc", "Fs", "Vs"), "coulomb": ("s2", "Fc")}
NAMES = {"s0": "sigma0", "s1": "sigma1", "s2": "sigma2"}


def draw_card(rng, m, p, law, stribeck):
    """Draw a card beside the truth `p`: every number off by 3-20 %, inertia and known load by 3-10 %.

    A `lugre` card beside a regularised truth has bristles as somebody may have guessed them.
    """

    def off(x, low=0.03, high=0.2):
        return float(x * (1 + rng.choice([-1, 1]) * rng.uniform(low, high)))

    c = {"law": law, "stribeck": stribeck, "J": off(m["J"], 0.03, 0.1), "s2": off(p["s2"]), "Fc": off(p["Fc"])}
    if law == "lugre" and p["law"] != TANH:
        c |= {"s0": off(p["s0"]), "s1": off(p["s1"])}
    elif law == "lugre":
        c["s0"] = p["Fs"] / (m["presliding"] * between(rng, 0.3, 2))
        c["s1"] = 0.5 * np.sqrt(c["s0"] * m["J"])
    if law != "coulomb":
        c |= {"Fs": max(off(p["Fs"]), 1.05 * c["Fc"]) if stribeck else c["Fc"], "Vs": off(p["Vs"])}
    if m["payload_mgl"]:
        c |= {"mgl": off(m["payload_mgl"], 0.03, 0.1), "phase": m["payload_phase"] + float(rng.normal(0, 0.03))}
    return c


def card_text(case):
    """Write the user's card."""
    c, m = case["card"], case["machine"]
    lines = ["[mount]", 'name = "axis"', f'motion = "{"linear" if m["linear"] else "rotary"}"']
    lines += [f"inertia = {c['J']:.5g}", f"torque_limit = {m['limit']:.5g}", "", "[friction]", f'model = "{c["law"]}"']
    lines += [f"{NAMES.get(key, key)} = {c[key]:.5g}" for key in KEYS[c["law"]]]
    lines += ["delta = 2.0"] if c["law"] != "coulomb" else []
    if "mgl" in c:
        lines += ["", "[unbalance]", f"mgl = {c['mgl']:.5g}", f"phase = {c['phase']:.5g}"]
    lines += _encoder(m) if case["tell_encoder"] else []
    if case["renamed"]:
        lines += ["", "[columns]", f'tau = "{command_name(case)}"']
    return "\n".join(lines) + "\n"


def _encoder(m):
    """Counts per turn of the encoder, which turns `ratio` times per turn (per metre) of the axis."""
    counts = round((1.0 if m["linear"] else 2 * np.pi) / m["quant"] / m["ratio"])
    return ["", "[encoder]", f"counts_per_rev = {max(counts, 1)}", f"noise_rms = {m['noise']:.2g}",
            f"ratio = {m['ratio']:.6g}"]  # fmt: skip


def command_name(case):
    """Name the column of the command."""
    return ("force" if case["machine"]["linear"] else "torque_command") if case["renamed"] else "tau"
