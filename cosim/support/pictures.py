"""Pictures of what lies below the room that draws: found by name when they are first asked for, as pandas does.

Recordings and runs know nothing of matplotlib, and what drives a machine must not load it; their `.plot()` asks here.
"""

from importlib import import_module
from typing import Any

DRAWING = "cosim.plots.figures"
"""The module that has a function of each name."""


def picture(name: str, *of: Any) -> Any:
    """Return the matplotlib figure that `cosim.plots.figures` draws under a name."""
    return getattr(import_module(DRAWING), name)(*of)
