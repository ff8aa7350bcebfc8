"""One concealed case in a process of its own: recordings and card go to a folder, the truth comes back by pipe.

The process that runs the tool gets the folder and nothing else.
"""

from pathlib import Path
from typing import Any

from cosim.proof.deck import Hand
from cosim.proof.generator import make_case, write_given


def make(hand: Hand, seconds: float, folder: str) -> dict[str, Any]:
    """Write what the tool may see into `folder` and return the truth."""
    case = make_case(hand.seed, hand.effects, duration=seconds)
    write_given(case, Path(folder))
    return case.truth
