"""What is doubtful about recordings beside a card, as data: it stands in `sanity` of diagnosis.json."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from cosim.estimation.determined import NotDetermined
from cosim.support.plain import JsonObject

Kind = Literal[
    "torque_sign",
    "time_unit",
    "position_scale",
    "speed_scale",
    "torque_scale",
    "gear_ratio",
    "clocks",
    "other_machine",
    "base_far_from_card",
    "not_determined",
    "single_readings",
    "encoder_step",
    "half_sample",
    "end_stop",
    "change_at_a_time",
    "no_set_point",
    "little_motion",
    "own_torque",
    "own_set_point",
]


@dataclass(frozen=True, kw_only=True)
class Alternative:
    """One explanation of what is doubtful, and how likely it is beside the others (0..1)."""

    what: str
    likelihood: float


@dataclass(frozen=True, kw_only=True)
class Sanity:
    """One doubt about the recordings, or about the card beside them."""

    finding: Kind
    statement: str
    """One or two plain sentences: what is odd, and what to check."""
    alternatives: tuple[Alternative, ...] = ()
    """Explanations, likeliest first."""
    blocks_naming: bool = False
    """Whether no effect may be named beside this: what was fitted would be an error of the recording."""

    def as_json(self) -> JsonObject:
        """The entry as diagnosis.json holds it."""
        return {
            "finding": self.finding,
            "statement": self.statement,
            "alternatives": [{"what": one.what, "likelihood": one.likelihood} for one in self.alternatives],
            "blocks_naming": self.blocks_naming,
        }


def not_determined_doubts(entries: Sequence[NotDetermined]) -> tuple[Sanity, ...]:
    """What the recordings do not determine, as doubts."""
    return tuple(Sanity(finding="not_determined", statement=one.statement) for one in entries)
