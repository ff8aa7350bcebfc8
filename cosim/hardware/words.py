"""The words of the loop: states, faults, requests, notes and limits, in the numbers that hardware.h gives them."""

STATES = (
    "not ready",
    "switch on disabled",
    "ready to switch on",
    "switched on",
    "operation enabled",
    "quick stop active",
    "fault reaction active",
    "fault",
)
"""States of CiA 402 by number."""
ENABLED, QUICK_STOP_STATE, FAULT = 4, 5, 7

FAULTS = {
    "power_up": "the loop has just started; a reset is needed, as after every fault",
    "estop": "an emergency stop was asked for",
    "frame_lost": "the drive has not answered for too many cycles",
    "encoder_stale": "the drive answers, but its encoder has given no new sample for too many cycles",
    "encoder_jump": "the encoder moved by what the speed of the axis does not explain",
    "overspeed": "the axis is faster than its limit",
    "following_error": "the axis is farther from its set point than its limit (or the set point is no number)",
    "not_a_number": "the controller's command is not a finite number",
    "torque_mismatch": "the drive gives another torque than was ordered for too many cycles",
    "drive_fault": "the drive says that it is in fault",
    "drive_state": "the drive left operation, or did not follow into a state in time",
    "heartbeat_lost": "the supervisor gave no sign of life in time",
    "deadline": "too many cycles were late within the window",
    "controller_failed": "the controller's step returned an error",
    "adapter_failed": "the adapter says that it has failed",
    "encoder_heads": "two read heads of the encoder have failed",
}
"""Faults in the order of their bits, numbered from 1 in docs/hardware.md."""

ASK_ENABLE, ASK_QUICK_STOP, ASK_ESTOP, ASK_RESET = 1, 2, 4, 8
ENTERED, STEPPED, LIMITED, SLEWED = 1, 2, 4, 8
LIMITS = ("torque", "slew", "speed", "following_error", "jump", "torque_mismatch")
LINK = ("unanswered", "late", "duplicated", "reordered", "corrupted", "foreign")
"""What a transport notices in a cycle, in the order of its bits."""
OF_FRAMES = ("late", "duplicated", "reordered", "corrupted")
"""Injections into the frames of a drive behind a network; the drive in this process has none."""
OF_HEADS = ("silent_head", "frozen_head", "stray_head")
"""Injections into one read head of the encoder."""
INJECTIONS = ("lost", "stale", "jump", "saturated", "dead", "tripped", *OF_FRAMES, *OF_HEADS)
REASONS = ("", "silent", "frozen", "astray")
"""Why a read head is left out, by number."""


def faults_of(bits: int) -> tuple[str, ...]:
    """Name the faults of a word of bits."""
    return tuple(name for place, name in enumerate(FAULTS) if bits >> place & 1)


def heads_of(reasons: int) -> dict[int, str]:
    """Name why read heads are left out, by head from 0."""
    found = {head: reasons >> 4 * head & 15 for head in range(4)}
    return {head: REASONS[reason] for head, reason in found.items() if reason}
