"""What to check on a machine where an effect was detected, and what to repair: a TOML file an effect, beside this.

Three checks, the quickest first, each with at least two results and what each of them means; then the repair by kind of
machine. Report, documentation and `cosim show EFFECT` read it from here, so that a sentence is written once.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.resources import files
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cosim.diagnosis.answer.result import Diagnosis

__all__ = ["MACHINES", "Check", "Repairs", "for_machine", "machines_of", "repairs_of"]

MACHINES: Mapping[str, str] = {
    "rotary_table": "rotary table, telescope axis",
    "ball_screw": "ball screw, lead screw",
    "belt": "belt, rack, cable drive",
    "harmonic_drive": "robot joint with harmonic drive",
    "direct_drive": "direct drive",
    "hydraulic": "hydraulic cylinder",
}
"""Kinds of machines as `[mount] machine` of a card names them, and as a reader knows them."""
MOTIONS: Mapping[str, tuple[str, ...]] = {
    "rotary": ("rotary_table", "belt", "harmonic_drive", "direct_drive"),
    "linear": ("ball_screw", "belt", "direct_drive", "hydraulic"),
}
"""Kinds that turn, and kinds that move along."""


@dataclass(frozen=True)
class Check:
    """One thing to do at the machine, and what each of its results means, as (result, meaning)."""

    do: str
    results: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Repairs:
    """The checks of one effect in their order, and its repair by kind of machine (keys of `MACHINES`)."""

    checks: tuple[Check, ...]
    by_machine: Mapping[str, str]

    def of(self, motion: str, machine: str = "") -> dict[str, str]:
        """Return the repairs that fit an axis, by what a reader calls the machine.

        Args:
            motion: "rotary" or "linear".
            machine: a key of `MACHINES` where the card says it: then only that one.
        """
        kinds = machines_of(motion, machine)
        return {MACHINES[kind]: self.by_machine[kind] for kind in kinds if kind in self.by_machine}


def machines_of(motion: str, machine: str = "") -> tuple[str, ...]:
    """Return the kinds of machines that an axis may be: the one its card names, else all that move so."""
    return (machine,) if machine else MOTIONS[motion]


@lru_cache(maxsize=64)
def repairs_of(effect: str) -> Repairs | None:
    """Return what is known of an effect by its id; None where nothing is written, as of an effect of your own."""
    file = files("cosim.report.repairs") / f"{effect}.toml"
    if not effect.isidentifier() or not file.is_file():
        return None
    read = tomllib.loads(file.read_text("utf-8"))
    checks = tuple(
        Check(one["do"], tuple((result["seen"], result["means"]) for result in one["results"]))
        for one in read["checks"]
    )
    return Repairs(checks, read["repair"])


def for_machine(diagnosis: "Diagnosis", machine: str) -> "Diagnosis":
    """Return a diagnosis that says of each effect, detected or possible, what to do on one kind of machine.

    Args:
        diagnosis: with the effects' own actions, which fit any machine.
        machine: a key of `MACHINES`; "" leaves the actions as they are.
    """
    if not machine:
        return diagnosis
    told = []
    for one in diagnosis.findings:
        known = repairs_of(one.effect) if one.answer in ("found", "ambiguous") else None
        told.append(replace(one, action=known.by_machine.get(machine, one.action)) if known else one)
    return replace(diagnosis, findings=tuple(told))
