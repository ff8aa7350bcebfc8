"""What the standards and docs/fmus.md say of calls, written down once more, and states damaged on purpose."""

import struct
from math import isfinite
from typing import Any

INSTANTIATED, INITIALIZATION, EVENT, CONTINUOUS, STEP, TERMINATED = 1, 2, 4, 8, 16, 32
READABLE = INITIALIZATION + EVENT + CONTINUOUS + STEP + TERMINATED
ORDER = {
    "SetupExperiment": INSTANTIATED, "EnterInitializationMode": INSTANTIATED, "ExitInitializationMode": INITIALIZATION,
    "Terminate": EVENT + CONTINUOUS + STEP, "DoStep": STEP, "EnterEventMode": EVENT + CONTINUOUS,
    "NewDiscreteStates": EVENT, "UpdateDiscreteStates": EVENT, "EnterContinuousTimeMode": EVENT,
    "CompletedIntegratorStep": CONTINUOUS, "SetTime": EVENT + CONTINUOUS, "SetContinuousStates": CONTINUOUS,
    "GetReal": READABLE, "GetFloat64": READABLE, "GetDirectionalDerivative": READABLE, "GetAdjointDerivative": READABLE,
    "GetDerivatives": READABLE, "GetContinuousStateDerivatives": READABLE, "GetEventIndicators": READABLE,
    "GetContinuousStates": READABLE, "GetNominalsOfContinuousStates": READABLE,
}  # fmt: skip
"""The modes in which the standards allow a function; others are allowed at any time."""
EXCHANGE = {name for name in ORDER if "ContinuousState" in name} | {
    "EnterEventMode", "NewDiscreteStates", "UpdateDiscreteStates", "EnterContinuousTimeMode", "CompletedIntegratorStep",
    "SetTime", "GetDerivatives", "GetEventIndicators", "GetNumberOfEventIndicators", "GetNumberOfContinuousStates",
}  # fmt: skip
"""Functions of model exchange only."""
LEADS = {"EnterInitializationMode": INITIALIZATION, "Terminate": TERMINATED, "Reset": INSTANTIATED,
         "EnterEventMode": EVENT, "EnterContinuousTimeMode": CONTINUOUS}  # fmt: skip
HEAD = struct.Struct("<Q4dq4i")
"""Of a serialized state: mark; start, stop, tolerance, solver step; ticks; interface, mode, two of no concern."""


def sealed(memory: bytes) -> bytes:
    """Append the hash that a serialized state ends with (FNV-1a of 64 bits)."""
    value = 0xCBF29CE484222325
    for byte in memory:
        value = (value ^ byte) * 0x100000001B3 % 2**64
    return memory + struct.pack("<Q", value)


def damaged(content: bytes, what: str, place: int = 0, number: float | int = 0) -> bytes:
    """A state that is whole, foreign, with one bit flipped, cut, longer, or with a forged word and the right hash."""
    if what == "foreign":
        return sealed(bytes(8) + content[8:-8])
    if what == "flipped":
        place %= len(content)
        return content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :]
    if what == "forged":
        word = 8 * (place % (len(content) // 8 - 1))
        forged = struct.pack("<Q" if isinstance(number, int) else "<d", number)
        return sealed(content[:word] + forged + content[word + 8 : -8])
    return content[: place % len(content)] if what == "cut" else content + bytes(place * (what == "longer"))


def may_be_set(facts: dict[str, Any], reference: int, value: float, phase: int) -> bool:
    """Whether the rules of docs/fmus.md let a variable have a value in a mode."""
    if reference >= len(facts["variables"]) or not isfinite(value):
        return False
    _, kind, _, low, high, fixed = facts["variables"][reference]
    start = INSTANTIATED + INITIALIZATION
    when = {"input": READABLE + INSTANTIATED - TERMINATED, "parameter": start if fixed else start + EVENT + STEP,
            "state": start, "output": start if facts["period"] else 0}.get(kind, 0)  # fmt: skip
    return bool(when & phase) and (kind != "parameter" or low <= value <= high)
