"""A diagnosis made up by hand, with everything a report can hold: two effects, none, or something unknown."""

import re
from functools import cache
from typing import Any

import numpy as np

from cosim.diagnosis.answer.result import Diagnosis, Finding, HeldOut, Region, Trace, Where
from cosim.diagnosis.measure.breakdown import parts
from cosim.report import render

RATE, SECONDS = 1000, 60
FLOOR = 0.16
KINDS = [("two", "rotary"), ("none", "rotary"), ("unknown", "rotary"), ("two", "linear")]


def motion(seed: int, scale: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (t, q, v) of a machine that sweeps back and forth at several speeds, with stops."""
    rng = np.random.default_rng(seed)
    t = np.arange(SECONDS * RATE) / RATE
    level = np.repeat(rng.uniform(0.3, 1.6, SECONDS // 3) * np.tile([1, -1], SECONDS // 6), 3 * RATE)
    level[np.repeat(rng.random(SECONDS // 3) < 0.15, 3 * RATE)] = 0.0
    v = np.convolve(np.pad(level, 200, mode="edge"), np.hanning(401) / np.hanning(401).sum(), "valid") * scale
    return t, 2.0 + np.cumsum(v) / RATE, v


def trace(name: str, seed: int, heldout: bool, missing: str, scale: float = 1.0) -> Trace:
    t, q, v = motion(seed, scale)
    rng = np.random.default_rng(seed + 100)
    noise = np.convolve(rng.normal(0, 1, t.size + 32), np.hanning(33), "valid")[: t.size]
    noise *= FLOOR / noise.std()
    base = 0.8 * np.gradient(v, t) + 1.1 * np.tanh(v / 0.01 / scale) + 0.2 * v / scale
    extra = {
        "two": 0.42 * np.cos(24 * q + 0.4) + 0.13 * np.abs(np.tanh(v / 0.01)) + 0.1 * np.sin(q),
        "none": np.zeros_like(t),
        "unknown": 0.9 * np.exp(-(((np.mod(q, 2 * np.pi) - 3.7) / 0.2) ** 2)) * (v > 0),
    }[missing]
    after = base + (extra - 0.1 * np.sin(q) if missing == "two" else 0.0)
    gap = base + extra + noise - base
    return Trace(
        name=name, heldout=heldout, t=t, q=q, v=v, tau=base + extra + noise, before=base, after=after,
        missing=gap, band=np.full_like(t, 2 * FLOOR), intervals=((10.0, 12.5),) if missing != "none" else (),
    )  # fmt: skip


def region(axis: str, unit: str, traces: tuple[Trace, ...], after: bool) -> Region:
    x = np.concatenate(
        [np.sign(tr.v) if axis == "direction" else tr.q if axis == "position" else tr.v for tr in traces]
    )
    y = np.concatenate([tr.tau - tr.after if after else tr.missing for tr in traces])
    edges = np.array([-1.5, 0, 1.5]) if axis == "direction" else np.linspace(x.min() - 0.2, x.max() + 0.2, 41)
    count, total = np.histogram(x, edges)[0].astype(float), np.histogram(x, edges, weights=y)[0]
    mean = np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0)
    centres = np.array([-1.0, 1.0]) if axis == "direction" else 0.5 * (edges[1:] + edges[:-1])
    band = np.where(count > 0, 1.96 * FLOOR / np.sqrt(np.maximum(count / 30, 1)), np.nan)
    return Region(axis=axis, unit=unit, centres=centres, mean=mean, band=band, count=count)


FOUND = (
    Finding(
        effect="cogging", title="Cogging", answer="found", probability=0.97, gain=0.62,
        parameters={"cycles_per_rev": 24.0, "amplitude": 0.42, "phase": 0.4},
        harmonics=({"cycles_per_rev": 48.0, "amplitude": 0.125, "phase": -0.3},),
        units={"amplitude": "N·m", "phase": "rad"},
        standard_errors={"amplitude": 0.015, "phase": 0.03}, ranges={"amplitude": (0.39, 0.45), "phase": (0.34, 0.46)},
        size="0.42 N·m", size_range="0.39 to 0.45", visible_from=0.05,
        statement="The motor torque ripples 24 times per turn, by 0.42 N·m; it has 24 slots, nothing needs repair",
        where=Where(axis="position", description="the whole turn, same phase at all six speeds"),
        ruled_out=("gear mesh (40 per turn)", "current-loop resonance (fixed in Hz)"),
        evidence="24 per turn equals the slot count in the model card", action="Use the improved FMU",
    ),
    Finding(
        effect="friction_asymmetry", title="Friction asymmetry", answer="found", probability=0.93, gain=0.2,
        parameters={"level_asymmetry": 0.118}, ranges={"level_asymmetry": (0.095, 0.14)}, size="0.26 N·m",
        size_range="0.21 to 0.31", statement="Turning forward takes 0.26 N·m more than backward.", visible_from=0.08,
        where=Where(axis="speed", description="every speed", regions=((0.35, 1.57),)),
        evidence="it follows the direction of motion and is absent at standstill",
        ruled_out=("torque sensor zero (would stay at standstill)",), action="Check clamp brake and lip seal",
    ),
)  # fmt: skip
RIVALS = (
    Finding(
        effect="gravity_unbalance", title="Gravity unbalance", answer="ambiguous", probability=0.5, gain=0.05,
        parameters={"mgl": 0.1}, size="0.10 N·m", size_range="0.04 to 0.15", visible_from=0.06,
        statement="Either the load or the encoder ring is off centre. One slow turn with stops will tell.",
        told_apart_by="an off-centre load needs holding torque at standstill, an off-centre ring does not",
    ),
    Finding(
        effect="encoder_eccentricity", title="Encoder eccentricity", answer="ambiguous", probability=0.4, gain=0.04,
        parameters={"amplitude_rad": 3e-5}, size="0.002 °", size_range="0.001 to 0.003", visible_from=0.0012,
    ),
)  # fmt: skip


def other(effect: str, title: str, answer: Any, **more: Any) -> Finding:
    return Finding(effect=effect, title=title, answer=answer, probability=0.01, gain=0.0, **more)


STRIBECK = {"size": "0.05 N·m", "size_range": "-0.01 to 0.11", "statement": "Starting takes a little more than turning"}
WARMED = {"evidence": "the motor warmed only 0.3 K", "action": "record 20 min from cold"}
STOPPED = {"evidence": "longest stop 0.3 s", "action": "stop for 1, 10 and 100 s"}
REST = (
    other("delay", "Delay", "not_seen", visible_from=0.4, units={"delay_ms": "ms"}),
    other("clock_skew", "Clock skew", "not_seen", visible_from=3.0, units={"drift_ppm": "ppm"}),
    other("stribeck", "Stribeck", "not_proven", visible_from=0.04, **STRIBECK),
    other("thermal_viscosity", "Thermal drift", "not_testable", **WARMED),
    other("dwell_breakaway", "Dwell break-away", "not_testable", **STOPPED),
)
PROVENANCE: dict[str, Any] = {
    "version": "0.1.0",
    "command": "cosim diagnose run1.parquet run2.parquet --heldout run3.parquet --card mount.toml --out result",
    "date": "2026-11-18",
    "seed": 0,
    "card": {"name": "mount.toml", "sha256": "77a0" * 16},
    "recordings": [
        {"name": f"run{i}.parquet", "sha256": f"4be{i}" * 16, "role": role, "seconds": 60.0, "rate_hz": 1000.0}
        for i, role in ((1, "fitted"), (2, "fitted"), (3, "held out"))
    ],
}


@cache
def diagnosis(kind: str = "two", motion: Any = "rotary", mount: str = "C1 rotary table") -> Diagnosis:
    linear = motion == "linear"
    scale = 0.05 if linear else 1.0
    traces = tuple(trace(f"run{i}", i, i == 3, kind, scale) for i in (1, 2, 3))
    units = ("m", "m/s") if linear else ("rad", "rad/s")
    axes = (("position", units[0]), ("speed", units[1]), ("direction", "1"))
    rms = {"two": (0.37, 0.18), "none": (0.17, 0.17), "unknown": (0.39, 0.39)}[kind]
    findings = {"two": FOUND + RIVALS + REST, "none": REST[:2] + REST[3:], "unknown": REST}[kind]
    return Diagnosis(
        verdict={"two": ("cogging", "friction_asymmetry"), "none": (), "unknown": ("unknown",)}[kind],
        findings=findings, delivered=tuple(one.effect for one in findings if one.where),
        traces=traces, parts=parts(traces), mount=mount, motion=motion,
        heldout=HeldOut(
            name="run3", nominal_rms=0.52, before_rms=rms[0], after_rms=rms[1], floor_rms=FLOOR,
            confidence_interval=(0.15, 0.22) if kind == "two" else (-0.01, 0.01),
            sliding={"before_rms": 0.35, "after_rms": 0.17, "cutoff_hz": 30.0},
            position={"before": 1e-4, "after": 4e-5},
        ),
        regions=tuple(region(axis, unit, traces, False) for axis, unit in axes),
        regions_after=tuple(region(axis, unit, traces, True) for axis, unit in axes),
        ambiguous_with=(("gravity_unbalance", "encoder_eccentricity"),) if kind == "two" else (),
        next_experiment={
            "separates": ["gravity_unbalance", "encoder_eccentricity"], "scenario": "next_experiment.toml",
            "expected_difference": 0.08, "description": "Record one turn at 2°/s with a 3 s stop every 45°",
        } if kind == "two" else {},
        depends_on=("position", "direction of motion") if kind == "unknown" else (),
        data_quality=("3 gaps (0.2 s) left out", "offset of 12 ms removed"),
        friction_law={"base": "lugre", "proposed": "maxwell_slip", "gain": 0.08} if kind == "two" else {},
        base_parameters={"inertia": (0.8, 0.82, 0.801), "Fc": (1.0, 1.13, 1.10), "sigma2": (0.25, 0.21, 0.2)},
        provenance=PROVENANCE, seconds=12.3,
        improved={"card": "card.toml", "fmu": "mount_improved.fmu", "speed": [0.35, 1.57]} if kind == "two" else {},
    )  # fmt: skip


@cache
def report_of(kind: str = "two", motion: Any = "rotary") -> str:
    """Its report, made once: pictures take a second."""
    return render(diagnosis(kind, motion))


def text_of(html: str) -> str:
    """The page as it is read before anything is unfolded."""
    body = re.sub(r"<(style|script|noscript).*?</\1>", " ", html.split("<body>")[1], flags=re.S)
    inner = re.compile(
        r"<details(?![^>]*open)[^>]*><summary>((?:(?!</summary>).)*)</summary>(?:(?!<details).)*?</details>", re.S
    )
    while inner.search(body):
        body = inner.sub(r"\1", body)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", body))
