"""The README of the benchmark of the hardware."""

from collections.abc import Callable
from typing import Any

from hardware_drives import STEP

from cosim.hardware.words import FAULTS

COMMAND = "python bench/hardware.py --out results/hardware"


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
        "leaves operation and an adapter that says so itself are provoked in `test_axis_safety.py`. A",
        "heartbeat is lost 500 ms after the last one; missed edges are known when the last of the 64 is over.",
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
