"""One recording of a machine: set point, disturbances, plant, and what a logger writes of it."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter, sosfilt

from . import motions, plant
from .machines import PI, between, slips

STEP = 1e-4
"""s; longest integration step."""
EXTRAS = ("rise", "f", "A", "f2", "sway", "ppm", "offset")
"""Numbers of effects that act outside the plant's code."""
WATCHED = ("parasite", "dry", "bristles", "stribeck")


def coloured(rng, n, rate, memory):
    """Noise of unit size with a memory [s]; slow noise is drawn at a lower rate and interpolated."""
    thin = max(int(rate * memory / 50), 1)
    few = n // thin + 2
    a = np.exp(-thin / (rate * memory))
    x = lfilter([np.sqrt(1 - a * a)], [1, -a], rng.standard_normal(few + 300))[300:]
    return x[:n] if thin == 1 else np.interp(np.arange(n) / thin, np.arange(few), x)


def temperature(rng, n, rate, base):
    """Temperature of the bearing in degC: base, warming up, a slow wave."""
    t = np.arange(n) / rate
    rise = rng.uniform(-3, 7) * (1 - np.exp(-t / rng.uniform(15, 60)))
    return base + rise + 0.3 * np.sin(2 * PI * t / rng.uniform(30, 200) + rng.uniform(0, 6))


def tone(rng, n, rate, p):
    """Torque periodic in time, with a swaying envelope and a wandering phase."""
    t, out = np.arange(n) / rate, np.zeros(n)
    for f, size in ((p["f"], 1.0), (p["f2"], 0.6)):
        if f:
            swell = 1 + p["sway"] * np.sin(2 * PI * t * rng.uniform(0.01, 0.06) + rng.uniform(0, 6))
            phase = 2 * PI * f * t + rng.uniform(0, 6) + 0.15 * coloured(rng, n, rate, 30.0)
            out += size * swell * (np.sin(phase) + 0.12 * np.sin(2 * phase + 1))
    return p["A"] * out


def shake(rng, n, rate, case):
    """Torque noise that nobody models: coloured drive noise and vibration of the ground."""
    m = case["machine"]
    out = case["torque_noise"] * m["Fc"] * coloured(rng, n, rate, case["torque_memory"])
    if case["ground"]:
        low, high = case["ground_band"]
        sos = butter(2, (low, min(high, 0.4 * rate)), "band", fs=rate, output="sos")
        x = sosfilt(sos, rng.standard_normal(n))
        out += case["ground"] * m["Fc"] * x / np.std(x) * (1 + 0.5 * np.sin(2 * PI * np.arange(n) / rate / 17))
    return out


def gains(case, bandwidth):
    """Numbers of the controller for a bandwidth [rad/s]."""
    m, c, card = case["machine"], case["control"], case["card"]
    T = 1 / case["loop"]
    J, filtered = card["J"], max(0.15 / bandwidth, T)
    p = dict(
        cascade=float(c["kind"] == "cascade"),
        vfilter=1 - np.exp(-T / filtered),
        limit=m["limit"],
        ffv=0.01 * m["v"],
        ffd=c["ffd"],
    )
    if c["kind"] == "cascade":
        p |= dict(kd=J * bandwidth, kp=bandwidth / c["ratio"], ki=J * bandwidth**2 / (1.5 * c["ratio"]))
    else:
        w = bandwidth / 2
        p |= dict(kp=J * w * w, kd=2 * c["damping"] * J * w, ki=J * w**3 / c["ratio"])
    if c["feed"]:
        p |= dict(ffj=J, ffc=0.9 * card["Fc"], ffs2=card["s2"])
    if c["payload"] and m["payload_mgl"]:
        p |= dict(ffk=card["mgl"])
    return p


def fastest(case):
    """Find the largest bandwidth that quantisation, loop rate and flexibility allow [rad/s]."""
    m = case["machine"]
    by_noise = np.sqrt(0.25 * m["Fc"] / (m["J"] * m["resolution"]))
    soft = 0.6 * np.sqrt(case["plant"].get("k", np.inf) / m["J"])
    late = 0.25 / (case["plant"].get("delay", 0) + case["plant"].get("lag", 0) + case["plant"]["loop"] + 1e-4)
    return float(min(by_noise, 0.2 * case["loop"], soft, late))


def record(case, kind, seed, base_temperature):
    """Simulate one recording. Returns a dict, or None where the loop is no good at any bandwidth."""
    for attempt in range(5):
        found = _once(case, kind, seed, base_temperature, case["bandwidth"] * 0.65**attempt)
        if found is not None:
            return found
    return None


def _once(case, kind, seed, base_temperature, bandwidth):
    rng = np.random.default_rng(seed)
    m, rate = case["machine"], case["loop"]
    seconds = rng.uniform(*case["seconds"])
    p = {k: v for k, v in case["plant"].items() if k not in EXTRAS}
    for key in ("dp_t", "lc_t", "fs_t"):
        p |= {key: rng.uniform(0.3, 0.65) * seconds} if key in p else {}
    qd, vd, ad = motions.make(kind, rng, seconds, 1 / rate, m)
    n = len(qd)
    T = temperature(rng, n, rate, base_temperature)
    arrays = dict(
        qd=qd + m["start"],
        vd=vd,
        ad=ad,
        noise=m["noise"] * rng.standard_normal(n),
        temp=T,
        level=1 + case["wander"] * coloured(rng, n, rate, case["wander_memory"]),
        shake=shake(rng, n, rate, case),
        tone=tone(rng, n, rate, case["plant"]) if "f" in case["plant"] else np.zeros(n),
    )
    p |= gains(case, bandwidth) | dict(start=m["start"], runaway=m["stroke"] + 5 * m["resolution"])
    p["hold"] = _held(p)
    if "rise" in case["plant"]:
        p["Fs"] = p["Fc"] * (1 + case["plant"]["rise"])
    channels = [*case["channels"], *WATCHED]
    elements = slips(np.random.default_rng(case["slip_seed"]), p)
    out = plant.simulate(p, 1 / rate, max(int(np.ceil(1 / rate / STEP)), 2), arrays, elements, channels)
    if out is None:
        case["complaints"].append("runs away")
        return None
    found = _logged(case, rng, out, arrays, channels)
    found["info"] = dict(kind=kind, seconds=round(seconds, 2), bandwidth=round(bandwidth, 3))
    fault = complaint(found, m)
    case["complaints"].append(fault) if fault else None
    return None if fault else found


def _held(p):
    """Torque that holds the axis at its start, which the controller knows from before."""
    q, away = p["start"], p["start"] - p.get("cw_q0", 0.0)
    loads = sum(p.get(size, 0.0) * np.sin(q + p.get(phase, 0.0)) for size, phase in (("kn", "kn_p"), ("gv", "gv_p")))
    loads += p.get("of", 0.0) + p.get("cw_k", 0.0) * away * (1 + p.get("cw_h", 0.0) * away**2)
    return loads - p.get("ffk", 0.0) * np.sin(q + p.get("kn_p", 0.0))


def _means(x, ticks, rows):
    """Mean of a held signal over the row interval centred at each row."""
    total = np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x, 0)])
    edges = (rows[:, None] + np.array([-0.5, 0.5])) * ticks
    low = np.floor(edges).astype(int)
    part = (edges - low).reshape(*edges.shape, *[1] * (x.ndim - 1))
    at = total[low] + part * (total[low + 1] - total[low])
    return (at[:, 1] - at[:, 0]) / ticks


def _logged(case, rng, out, arrays, channels):
    command, position, reading, table = out
    m, ticks, dt = case["machine"], case["ticks"], 1 / case["machine"]["rate"]
    rows = np.arange(1, len(command) // ticks - 1)
    at = rows * ticks
    q, p = reading[at], case["plant"]
    aligned = unskewed = q
    if "ppm" in p:
        when = rows * dt * (1 + p["ppm"] * 1e-6) + p["offset"]
        clock = np.arange(len(position)) / case["loop"]
        there = CubicSpline(clock, position)(np.clip(when, 0, clock[-1]))
        q = there + m["noise"] * rng.standard_normal(len(rows))
        q = np.round(q / m["quant"]) * m["quant"]
    if "ec_A" in p:
        a = p["ec_N"] * m["turn"] * position[at]
        aligned = q - p["ec_A"] * (np.sin(a + p["ec_p"]) + p["ec_2"] * np.sin(2 * a + p["ec_p2"]))
    memory = np.exp(-dt / case["sensor_lag"])
    T = arrays["temp"][at]
    T = lfilter([1 - memory], [1, -memory], T, zi=[T[0] * memory])[0] + 0.03 * rng.standard_normal(len(T))
    return dict(
        dt=dt,
        t=rows * dt - dt,
        tau=_means(command, ticks, rows),
        q=q,
        aligned=aligned,
        unskewed=unskewed,
        q_d=arrays["qd"][at],
        temperature=np.round(T, 2),
        missing=_means(table, ticks, rows),
        names=list(channels),
        user=_user_columns(rng, len(rows), 1 / dt, case),
        error=arrays["qd"][at] - position[at],
    ) | _stamps(rng, rows * dt - dt, dt, case)


def _stamps(rng, t, dt, case):
    """Time stamps as written, and the rows that are."""
    kept, hole = np.ones(len(t), bool), int(case["gap"] / dt)
    if hole:
        begin = int(rng.uniform(0.2, 0.8) * len(t))
        kept[begin : begin + hole] = False
    return {"stamps": t + case["jitter"] * dt * np.clip(rng.standard_normal(len(t)), -3, 3), "kept": kept}


def _user_columns(rng, n, rate, case):
    """Columns that mean nothing to the axis."""
    kinds = {
        "humidity": (45, 3, 60.0),
        "supply_voltage": (48, 0.3, 2.0),
        "spindle_load": (20, 5, 8.0),
        "vibration_rms": (1, 0.2, 0.5),
    }
    return {
        name: np.round(kinds[name][0] + kinds[name][1] * coloured(rng, n, rate, kinds[name][2]), 3)
        for name in case["user_columns"]
    }


def complaint(found, m):
    """Say what is wrong with a loop: it chatters, saturates, is far off its path, or stands still; "" if nothing is."""
    jump = np.std(np.diff(found["tau"])) / np.sqrt(2)
    scale = m["Fc"] + 0.3 * m["J"] * m["a"]
    faults = {
        "chatters": jump > 0.4 * scale,
        "saturates": np.mean(np.abs(found["tau"]) > 0.99 * m["limit"]) > 0.03,
        "strays": np.std(found["error"]) > 0.15 * m["stroke"],
        "rests": np.ptp(found["q"]) < 8 * m["quant"],
    }
    return next((name for name, wrong in faults.items() if wrong), "")


__all__ = ["WATCHED", "between", "fastest", "record"]
