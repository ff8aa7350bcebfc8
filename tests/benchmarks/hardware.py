"""The controller on a virtual drive: time, faults, and what is left when a process is killed.

python tests/benchmarks/hardware.py --out results/hardware     (--only and the lengths make it shorter)

The scenario `sidereal` at 10 kHz against `cosim hardware virtual-drive` over UDP on this machine.

- timing: a session in real time with a supervisor that drains and plots, replayed; then rounds of a bare clock, a
  session without UDP, one with a quiet supervisor and one that drains and plots, one after the other, so that all meet
  the same other work.
- faults: each fault at seeded times, in lockstep: cycles to detection, state, torque.
- clean: a run without faults, in lockstep, faster than real time: nothing may trip.
- kills: `kill -9` of loop, Python and drive, in real time: is the torque gone, and is the black box whole?
"""

import argparse
import json
import os
import platform
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import cosim
from cosim.cli_cache import with_fmus
from cosim.errors import HardwareError
from cosim.hardware.blackbox import read_black_box, recording_of
from cosim.hardware.loops import Forked, bare_clock
from cosim.hardware.machine import Machine, changed, read_machine
from cosim.hardware.replay import replay
from cosim.hardware.session import Session
from cosim.hardware.simulated import Plant
from cosim.hardware.udp import UdpDrive
from cosim.hardware.virtual import VirtualDrive
from cosim.hardware.wired import wire_up
from cosim.hardware.words import FAULTS, LINK
from cosim.scenario import Scenario, read_scenario

COMMAND = "python tests/benchmarks/hardware.py --out results/hardware"
STEP = 1e-4
SEED = 20
PATIENT = read_machine("virtual")
STRICT = read_machine("simulated")
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--only", nargs="*", default=["timing", "faults", "clean", "kills"])
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="of the session in real time, and of the rounds in all"
    )
    parser.add_argument("--minutes", type=float, default=10.0, help="of the clean run")
    parser.add_argument("--trials", type=int, default=100, help="kills of each process")
    parser.add_argument("--times", type=int, default=10, help="seeded times of each fault")
    options = parser.parse_args()
    measures = {
        "timing": lambda: timing(options.seconds),
        "faults": lambda: faults(options.times),
        "clean": lambda: clean(options.minutes),
        "kills": lambda: kills(options.trials),
    }
    found: dict[str, Any] = {"version": f"mount-cosim {cosim.__version__}", "seed": SEED, "machine": machine()}
    with tempfile.TemporaryDirectory() as folder:
        tempfile.tempdir = folder  # processes that are killed leave theirs behind
        for name in options.only:
            found[name] = measures[name]()
            print(f"{name}: {json.dumps(found[name])}", file=sys.stderr, flush=True)
    tempfile.tempdir = None
    found["load_at_the_end"] = os.getloadavg()
    print(page(found))
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "hardware.json").write_text(json.dumps(found, indent=2) + "\n", "utf-8")
        (options.out / "README.md").write_text(page(found), "utf-8")


def machine() -> str:
    """Say what this ran on."""
    return (
        f"Python {platform.python_version()}, Linux {platform.release()}, {os.cpu_count()} cores, {platform.machine()}"
    )


def sidereal(seconds: float) -> Scenario:
    return with_fmus(replace(read_scenario("sidereal"), ticks=round(seconds / STEP)))


@contextmanager
def drive(given: Machine, *, lockstep: bool, port: int = 0) -> Iterator[VirtualDrive]:
    """A virtual drive in a thread of this process; its C holds no lock of Python."""
    with ExitStack() as stack:
        wired = wire_up(sidereal(1.0), stack)
        plant = Plant(wired.plant, wired.torque, wired.position)
        yield stack.enter_context(VirtualDrive(plant, given, STEP, wired.quantum, port=port, lockstep=lockstep))


@contextmanager
def drive_process() -> Iterator[str]:
    """A virtual drive in a process of its own; yields where it listens."""
    command = [
        sys.executable,
        "-m",
        "cosim",
        "hardware",
        "virtual-drive",
        "sidereal",
        "--machine",
        "virtual",
        "--port",
        "0",
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    assert process.stderr is not None
    try:
        said = next(line for line in process.stderr if " listens at " in line)
        yield said.split(" at ")[1].split(",")[0]
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate()


def over(url: str, given: Machine = PATIENT) -> Machine:
    return changed(given, "benchmark", adapter=url)


# --- timing


def timing(seconds: float) -> dict[str, Any]:
    """Compare a session in real time with a bare clock."""
    load = os.getloadavg()
    with tempfile.TemporaryDirectory() as folder, drive_process() as url:
        box = Path(folder) / "box"
        whole = watched(url, box, seconds, busy=True)
        whole |= kept(box)
        rounds = [one_round(url, box, seconds / 6, turn) for turn in range(6)]
    shares = {name: [one[name] for one in rounds] for name in rounds[0]}
    mean = {name: float(np.mean(values)) for name, values in shares.items()}
    return {
        "whole": whole,
        "late_share": mean,
        "rounds": shares,
        "ratio_to_bare": mean["draining and plotting"] / mean["bare clock"] if mean["bare clock"] else None,
        "supervision_adds": mean["draining and plotting"] - mean["quiet supervisor"],
        "session_adds": mean["draining and plotting"] - mean["bare clock"],
        "load": load,
    }


def one_round(url: str, box: Path, seconds: float, turn: int) -> dict[str, float]:
    """Return the share of late cycles of each kind of loop, in an order that changes from round to round."""
    kinds: dict[str, Callable[[], float]] = {
        "bare clock": lambda: bare(seconds),
        "drive in the loop's process": lambda: watched("simulated", box, seconds, busy=False)["late_share"],
        "quiet supervisor": lambda: watched(url, box, seconds, busy=False)["late_share"],
        "draining and plotting": lambda: watched(url, box, seconds, busy=True)["late_share"],
    }
    names = list(kinds)[turn % 4 :] + list(kinds)[: turn % 4]
    found = {name: kinds[name]() for name in names}
    return {name: found[name] for name in kinds}


def bare(seconds: float) -> float:
    edges, late, _ = bare_clock(STEP, PATIENT.clock.spin_us, seconds)
    return late / edges


def watched(url: str, box: Path, seconds: float, busy: bool) -> dict[str, Any]:
    """Run a session for some seconds; where it trips it is enabled again, and that is counted."""
    trips: Counter[str] = Counter()
    supervisor, pictures = Supervisor(), 0
    with Session(sidereal(seconds + 5), over(url), box, force=True) as session:
        while session.statistics["cycles"] + session.statistics["late_cycles"] < seconds / STEP:
            if not session.status.running:
                trips.update(session.status.faults)
                with suppress(HardwareError):
                    session.enable()
            session.advance(1000)
            if busy:
                supervisor.take(session)
                pictures += 1
        statistics = session.statistics
        session.disable()
        supervisor.take(session)
    edges = statistics["cycles"] + statistics["late_cycles"]
    trips.pop("power_up", None)
    result = {"edges": edges, "late_share": statistics["late_cycles"] / edges, "trips": dict(trips), **statistics}
    return result | (
        {"drained": supervisor.drained, "missing": supervisor.missing, "pictures": pictures} if busy else {}
    )


class Supervisor:
    """Drains the black box and draws the last 2 s of torque and error, ten times a second."""

    def __init__(self) -> None:
        from matplotlib.figure import Figure

        self.drained = self.missing = self._last = 0
        self._recent: deque[np.ndarray] = deque(maxlen=20)
        self._panels = Figure(figsize=(8, 4)).subplots(2, 1)

    def take(self, session: Session) -> None:
        records = session.drain()
        if len(records):
            self.missing += int(records["sequence"][-1]) - self._last - len(records)
            self._last = int(records["sequence"][-1])
            self.drained += len(records)
            self._recent.append(records[::10].copy())
            self._draw(np.concatenate(self._recent))

    def _draw(self, records: np.ndarray) -> None:
        position = records["sample"]["feedback"]["counts"].astype(np.uint32).view(np.int32)
        for panel, column in zip(self._panels, (records["torque"], position), strict=True):
            panel.clear()
            panel.plot(records["sample"]["tick"] * STEP, column, lw=0.8)
        self._panels[0].figure.canvas.draw()


def kept(box: Path) -> dict[str, Any]:
    """Say how the black box of a session is, and whether its orders come again, bit for bit."""
    found = read_black_box(box)
    numbers = found.records["sequence"].astype(np.int64)
    again = replay(recording_of(found, "box"))
    return {
        "records": len(numbers),
        "torn": found.torn,
        "gaps": int(np.count_nonzero(np.diff(numbers) != 1)) + int(numbers[0] != 1),
        "replayed_bit_for_bit": again.identical,
        "controller_steps": again.stepped,
    }


# --- faults


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


def lively(seconds: float = 1.0) -> Scenario:
    """Return a scenario in which something happens within half a second."""
    scenario = sidereal(seconds)
    sine = {"frequency": 1.0, "max_velocity": 2e-3, "smooth_start": 0.1}
    (name, signal), *_ = scenario.signals.items()
    return replace(scenario, signals={name: signal.model_copy(update=sine)})


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


# --- clean


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


# --- kills


def kills(trials: int) -> dict[str, Any]:
    """Kill each process so many times; what was left."""
    given = changed(PATIENT, "benchmark", reactions=PATIENT.reactions.model_dump() | {"heartbeat_ms": 200.0})
    found: dict[str, list[dict[str, Any]]] = {"loop": [], "Python": [], "drive": []}
    with tempfile.TemporaryDirectory() as folder:
        box = Path(folder) / "box"
        for _ in range(trials):
            for name, kill in (("loop", kill_loop), ("Python", kill_python), ("drive", kill_drive)):
                found[name].append(in_operation(kill, box, given))
    return {
        "watchdog_ms": given.watchdog_ms,
        "heartbeat_ms": given.reactions.heartbeat_ms,
        "lost_cycles": given.reactions.lost_cycles,
        **{name: summary(ones) for name, ones in found.items()},
    }


def summary(ones: list[dict[str, Any]]) -> dict[str, Any]:
    zero = [one["ms_to_zero"] for one in ones]
    return {
        "trials": len(ones),
        "torque_zero": sum(one["torque"] == 0 for one in ones),
        "whole_boxes": sum(one["torn"] == 0 and one["gaps"] == 0 for one in ones),
        "replayed": sum(one["replayed_bit_for_bit"] for one in ones),
        "ms_to_zero": {"median": float(np.median(zero)), "worst": max(zero)},
        "torque_taken": [min(one["taken"] for one in ones), max(one["taken"] for one in ones)],
    }


def operating(session: Session) -> None:
    """Bring a session into operation and let it follow for 0.1 s, to some torque."""
    for _ in range(200):
        with suppress(HardwareError):
            session.enable()
            if abs(session.track(1000).torque) > 1.0:
                return
    raise SystemExit("this computer is never in time for 0.1 s of operation")


def in_operation(kill: Callable[[Path, Machine], dict[str, Any]], box: Path, given: Machine) -> dict[str, Any]:
    """Kill until there was a torque to take away: this computer may have been late, and tripped, the moment before."""
    while not (found := kill(box, given))["taken"]:
        pass
    return found


def kill_loop(box: Path, given: Machine) -> dict[str, Any]:
    with (
        drive(given, lockstep=False) as there,
        Session(lively(5.0), over(there.url, given), box, force=True) as session,
    ):
        assert isinstance(session.loop, Forked)
        operating(session)
        trips, killed = there.virtual.trips, time.monotonic_ns()
        os.kill(session.loop.process, signal.SIGKILL)
        wait_for(lambda: there.drive.held == 0)
        torque, taken = abs(there.drive.held), abs(there.virtual.taken) if there.virtual.trips > trips else 0.0
        wait_for(lambda: not session.loop.alive)
    return kept(box) | {"torque": torque, "taken": taken, "ms_to_zero": (there.virtual.let_go - killed) / 1e6}


def kill_python(box: Path, given: Machine) -> dict[str, Any]:
    """Kill a supervisor; its loop must see that itself and leave."""
    with drive(given, lockstep=False) as there:
        child, loop = forked(lambda write: supervise(there, box, given, write))
        taken, killed = abs(there.drive.held), time.monotonic_ns()
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        wait_for(lambda: there.drive.held == 0)
        zero = time.monotonic_ns()
        wait_for(lambda: not Path(f"/proc/{loop}").exists())
        torque = abs(there.drive.held)
    return kept(box) | {"torque": torque, "taken": taken, "ms_to_zero": (zero - killed) / 1e6}


def supervise(there: VirtualDrive, box: Path, given: Machine, write: int) -> None:
    """Bring a session into operation, say so by the number of its loop's process, and keep it there."""
    with Session(lively(30.0), over(there.url, given), box, force=True) as session:
        assert isinstance(session.loop, Forked)
        operating(session)
        os.write(write, f"{session.loop.process}\n".encode())
        while True:
            session.advance(1000)


def serve(given: Machine, write: int) -> None:
    """Be a drive, and say at which port."""
    with drive(given, lockstep=False) as there:
        os.write(write, f"{there.port}\n".encode())
        while True:
            time.sleep(1)


def forked(work: Callable[[int], None]) -> tuple[int, int]:
    """Start a process that writes one number; return its own and that."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        work(write)
    number = int(os.read(read, 64))
    os.close(read)
    os.close(write)
    return child, number


def kill_drive(box: Path, given: Machine) -> dict[str, Any]:
    """Kill a drive; the loop must order zero, and the next drive at that port starts without torque."""
    child, port = forked(lambda write: serve(given, write))
    with Session(lively(5.0), over(f"udp://127.0.0.1:{port}", given), box, force=True) as session:
        operating(session)
        taken = abs(session.status.torque)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        wait_for(lambda: not session.advance(1).running)
        ordered = abs(session.advance(4).torque)
    with drive(given, lockstep=False, port=port) as again:
        held = abs(again.drive.held)
    return kept(box) | {"torque": max(ordered, held), "taken": taken, "ms_to_zero": 1e3 * silence(box)}


def silence(box: Path) -> float:
    """Return the time from the last answer of a drive to the first order of zero after it [s]."""
    records = read_black_box(box).records
    tick, answered = records["sample"]["tick"], np.flatnonzero(records["sample"]["read"] == 0)[-1]
    zero = answered + np.flatnonzero(records["torque"][answered:] == 0)[0]
    return float(tick[zero] - tick[answered]) * STEP


def wait_for(condition: Callable[[], bool], seconds: float = 10.0) -> None:
    last = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > last:
            raise SystemExit("what should follow a kill did not follow within 10 s")
        time.sleep(2e-4)


# --- the page


def page(found: dict[str, Any]) -> str:
    """Return the README of the result."""
    sections: dict[str, Callable[[dict[str, Any]], list[str]]] = {
        "timing": timing_lines,
        "faults": fault_lines,
        "clean": clean_lines,
        "kills": kill_lines,
    }
    lines = [
        "# The controller on a virtual drive",
        "",
        f"    {COMMAND}",
        "",
        f"{found['version']}, seed {found['seed']}. {found['machine']}. The scenario `sidereal`, 10 kHz, UDP on one",
        "machine with other work: lateness is its own, so it stands beside a bare clock's, and nothing is a guarantee.",
        f"Load average when all was done: {found['load_at_the_end'][0]:.1f}.",
    ]
    for name, write in sections.items():
        lines += ["", *write(found[name])] if name in found else []
    return "\n".join(lines) + "\n"


def timing_lines(found: dict[str, Any]) -> list[str]:
    whole, share = found["whole"], found["late_share"]
    link = whole["link"]
    trips = ", ".join(f"{name} {count}" for name, count in whole["trips"].items()) or "none"
    replayed = "came out again bit for bit" if whole["replayed_bit_for_bit"] else "DID NOT COME OUT AGAIN"
    ratio = f"{found['ratio_to_bare']:.2f}" if found["ratio_to_bare"] else "no ratio: the bare clock was never late"
    return [
        f"## {whole['edges'] * STEP:.0f} s in real time, the supervisor draining and plotting",
        "",
        f"Load average at the start {found['load'][0]:.1f}; SCHED_FIFO: {'granted' if whole['fifo'] else 'refused'}.",
        "",
        f"- Edges {whole['edges']:,}; late {whole['late_share']:.3%}; "
        f"worst wake-up {whole['worst_wake_up_us']:.0f} us. Trips (enabled again each time): {trips}.",
        "  A trip is a stall of this machine that is longer than a reaction allows: 64 edges in 10 ms (`deadline`),",
        "  20 ms without an order (`drive_fault`, `drive_state`), 100 cycles without an answer (`frame_lost`).",
        f"- Replay: the orders of {whole['controller_steps']:,} steps of the controller {replayed}.",
        f"- Black box: {whole['records']:,} records, {whole['torn']} torn, {whole['gaps']} gaps; drained while it ran: "
        f"{whole['drained']:,}, {whole['missing']} missing; {whole['pictures']} pictures.",
        f"- Frames: {link['sent']:,} orders, {link['good']:,} answered in time, {link['late']:,} late, "
        f"{link['lost']:,} lost, "
        f"{link['duplicated']} duplicated, {link['reordered']} reordered, {link['corrupted']} corrupted.",
        "",
        f"Then six rounds of {whole['edges'] * STEP / 6:.0f} s each, one after the other; share of late cycles:",
        "",
        "| loop | mean (least to most) |",
        "|---|---|",
        *(
            f"| {name} | {share[name]:.3%} ({min(ones):.3%} to {max(ones):.3%}) |"
            for name, ones in found["rounds"].items()
        ),
        "",
        f"Late cycles against the bare clock: ratio {ratio}, a difference of {found['session_adds']:+.3%}. "
        f"Draining and plotting add {found['supervision_adds']:+.3%} to a quiet supervisor (asked: at most 2 %).",
        "What a session over UDP has and a bare clock has not: in each cycle an order and an answer through the kernel",
        "and two switches between processes. The controller takes 0.1 us of a cycle.",
    ]


def fault_lines(found: dict[str, Any]) -> list[str]:
    return [
        "## Faults, each at seeded times, in lockstep",
        "",
        "Reactions of the machine `simulated`; a sine of 1 Hz and 2 mrad/s. Cycles count from the first bad one, that",
        "included. The torque is the largest one ordered from the cycle of detection on. Bad frames with good ones",
        "between them are survived: the axis follows on.",
        "",
        "| injected | what must be seen | detected | in cycles | then | torque after it |",
        "|---|---|---|---|---|---|",
        *(
            f"| {one['injected']} | `{one['expected']}` | {one['detected']:.0%} of {one['trials']} "
            f"| {span(one['cycles'])} | {', '.join(one['states'])} "
            f"| {format(one['torque_after'], 'g') if one['expected'] in FAULTS else 'goes on'} |"
            for one in found["rows"]
        ),
        "",
        f"Detected: {found['detected']:.0%} in the worst row. A controller that gives no number or fails, a drive that",
        "leaves operation and an adapter that says so itself are provoked in `tests/test_hardware.py`. A heartbeat is",
        "lost 500 ms after the last one; missed edges are known when the last of the 64 is over.",
    ]


def span(cycles: list[int]) -> str:
    return f"{cycles[0]}" if cycles[0] == cycles[1] else f"{cycles[0]} to {cycles[1]}"


def clean_lines(found: dict[str, Any]) -> list[str]:
    ended = "followed to its end" if found["to_the_end"] else "LEFT BEFORE ITS END"
    wrong = {name: count for name, count in found["link"].items() if name not in ("sent", "good") and count}
    return [
        f"## {found['minutes']:g} min without a fault",
        "",
        f"In lockstep over UDP, faster than real time ({found['seconds']:.0f} s): {found['cycles']:,} cycles, {ended};",
        f"false trips: {', '.join(found['trips']) or 'none'}; frames noticed as bad: {wrong or 'none'}.",
    ]


def kill_lines(found: dict[str, Any]) -> list[str]:
    text = {
        "loop": f"the drive's watchdog, {found['watchdog_ms']:g} ms",
        "Python": f"the loop's missing heartbeat, {found['heartbeat_ms']:g} ms",
        "drive": f"the loop orders zero after {found['lost_cycles'] + 1} unanswered cycles",
    }
    return [
        "## kill -9 in operation, in real time",
        "",
        "Time from the kill to torque zero at the drive (of a killed drive: from its last answer to order zero). What",
        "is above the time of the watchdog is this machine's, which wakes a process late.",
        "",
        "| killed | what acts | torque zero | black box whole | replays | ms to zero, median | worst | torque before |",
        "|---|---|---|---|---|---|---|---|",
        *(
            f"| {name} | {what} | {one['torque_zero']} of {one['trials']} | {one['whole_boxes']} | {one['replayed']} "
            f"| {one['ms_to_zero']['median']:.1f} | {one['ms_to_zero']['worst']:.1f} "
            f"| {one['torque_taken'][0]:.2g} to {one['torque_taken'][1]:.2g} |"
            for name, what in text.items()
            for one in [found[name]]
        ),
    ]


if __name__ == "__main__":
    main()
