"""The loop that steps everything: compiled where its library is there, in Python otherwise, with the same bits."""

import ctypes
import sys
from functools import cache
from pathlib import Path

from cosim.master.loop.compiled import CompiledLoop, load
from cosim.master.loop.interpreted import InterpretedLoop
from cosim.system.plan import Plan

__all__ = ["CompiledLoop", "InterpretedLoop", "library", "make_loop", "slow_because"]

SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


@cache
def library() -> ctypes.CDLL | None:
    """Load the compiled loop; None where it was not built or does not fit this machine."""
    path = Path(__file__).with_name(f"_loop{SUFFIX}")
    try:
        return load(str(path)) if path.exists() else None
    except OSError:
        return None


def slow_because(plan: Plan) -> str:
    """Say why a plan runs in Python."""
    slow = [part.component.name for part in plan.parts if part.component.functions is None]
    if slow:
        return f"{slow[0]} can only be stepped by Python"
    return "It was asked for" if library() else "The compiled loop is missing here (reinstall the package to build it)"


def make_loop(plan: Plan, compiled: bool = True) -> CompiledLoop | InterpretedLoop:
    """Return the fastest loop that can execute the plan; `compiled` False asks for the one in Python."""
    native = all(part.component.functions is not None for part in plan.parts)
    found = library() if compiled and native else None
    return CompiledLoop(plan, found) if found is not None else InterpretedLoop(plan)
