"""Faults in lockstep: cycles to detection, state, torque; and a run without faults, where nothing may trip."""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from hardware_drives import STEP, STRICT, drive, lively, over, sidereal

from cosim.hardware.blackbox import read_black_box, recording_of
from cosim.hardware.machine import Machine, changed
from cosim.hardware.session import Session
from cosim.hardware.udp import UdpDrive
from cosim.hardware.words import FAULTS, LINK

SEED = 20
INJECTED: dict[str, tuple[dict[str, Any], str]] = {
    "lost": ({}, "frame_lost"),
    "late": ({"size": 1}, "frame_lost"),
    "corrupted": ({}, "frame_lost"),
    "duplicated": ({"lasts": 0.02}, "duplicated"),
    "reordered": ({"lasts": 0.02}, "reordered"),
    "dead": ({}, "frame_lost"),
    "stale": ({}, "encoder_stale"),
    "jump": ({"size": 1e-5, "lasts": STEP}, "encoder_jump"),
    "saturated": ({"size": 0.05}, "torque_mismatch"),
    "tripped": ({"lasts": STEP}, "drive_fault"),
}
"""What is injected, and the fault or (of frames that are survived) the notice that must follow."""
PROVOKED: dict[str, tuple[Callable[[Session], Any], str]] = {
    "emergency stop": (lambda one: one.estop(), "estop"),
    "no heartbeat": (lambda one: one.run_alone(6000), "heartbeat_lost"),
    "64 edges missed": (lambda one: one.lose(64), "deadline"),
    "following error above a tightened limit": (lambda one: one.tighten("following_error", 1e-12), "following_error"),
    "speed above a tightened limit": (lambda one: one.tighten("speed", 1e-9), "overspeed"),
}


def faults(times: int) -> dict[str, Any]:
    """Inject and provoke each fault at seeded times; a row each."""
    random = np.random.default_rng(SEED)
    rows = []
    for kind, (more, expected) in INJECTED.items():
        trials = [injected(kind, more, expected, at) for at in random.uniform(0.05, 0.35, times)]
        rows.append(row(f"{kind}", expected, trials))
    for name, (provoke, expected) in PROVOKED.items():
        trials = [provoked(provoke, expected, at) for at in random.uniform(0.05, 0.35, times)]
        rows.append(row(name, expected, trials))
    return {"rows": rows, "detected": min(one["detected"] for one in rows)}


def row(name: str, expected: str, trials: list[dict[str, Any]]) -> dict[str, Any]:
    seen = [one["cycles"] for one in trials if one["cycles"] is not None]
    return {
        "injected": name,
        "expected": expected,
        "trials": len(trials),
        "detected": len(seen) / len(trials),
        "cycles": [min(seen, default=None), max(seen, default=None)],
        "states": sorted({one["state"] for one in trials}),
        "torque_after": max(one["torque"] for one in trials),
    }


def injected(kind: str, more: dict[str, Any], expected: str, at: float) -> dict[str, Any]:
    at = round(at / STEP) * STEP
    given = changed(STRICT, "benchmark", inject=[{"kind": kind, "at": at} | more])

    def run(session: Session) -> int:
        session.enable()
        session.track()
        session.advance(4)
        return round(at / STEP)

    return trial(given, run, expected)


def provoked(provoke: Callable[[Session], Any], expected: str, at: float) -> dict[str, Any]:
    def run(session: Session) -> int:
        session.enable()
        session.track(round(at / STEP))
        begun = session.status.tick
        provoke(session)
        session.advance(100)
        return begun

    return trial(STRICT, run, expected)


def trial(given: Machine, run: Callable[[Session], int], expected: str) -> dict[str, Any]:
    """Return cycles to detection (None: not seen, or before there was anything to see), state and torque after it."""
    with tempfile.TemporaryDirectory() as folder, drive(given, lockstep=True) as there:
        box = Path(folder) / "box"
        session = Session(lively(), over(there.url, given), box, fast=True)
        assert isinstance(session.transport, UdpDrive)
        session.transport.udp.patience = 10_000_000  # an answer that does not come is waited for 10 ms
        with session:
            begun = run(session)
            state = session.status.state
        found = recording_of(read_black_box(box), "box")
    column, names = ("machine.faults", tuple(FAULTS)) if expected in FAULTS else ("machine.link", LINK)
    if expected == "torque_mismatch":  # the drive is saturated where more is ordered
        acting = np.concatenate(([0.0], found["machine.order"][:-1]))
        wrong = np.abs(found["machine.torque"] - acting) > given.limits.torque_mismatch
        begun = int(found["machine.tick"][wrong & (found["machine.tick"] >= begun)][0])
    seen = found[column].astype(int) >> names.index(expected) & 1 > 0
    first = int(np.flatnonzero(seen)[0]) if seen.any() else None
    early = first is not None and found["machine.tick"][first] < begun
    after = found["machine.order"][first:] if expected in FAULTS and first is not None else np.zeros(1)
    cycles = None if first is None or early else int(found["machine.tick"][first]) - begun + 1
    return {"cycles": cycles, "state": state, "torque": float(np.abs(after).max())}


def clean(minutes: float) -> dict[str, Any]:
    """Run without faults; nothing may trip."""
    begun = time.perf_counter()
    with (
        tempfile.TemporaryDirectory() as folder,
        drive(STRICT, lockstep=True) as there,
        Session(sidereal(60 * minutes), over(there.url, STRICT), Path(folder) / "box", fast=True) as session,
    ):
        session.enable()
        ended = session.track()
        statistics = session.statistics
        session.disable()
    seconds = time.perf_counter() - begun
    link = {name: count for name, count in statistics["link"].items() if name != "worst_round_trip_us"}
    return {
        "minutes": minutes,
        "cycles": statistics["cycles"],
        "trips": list(ended.faults),
        "to_the_end": ended.running,
        "link": link,
        "seconds": seconds,
    }
