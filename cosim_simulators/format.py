"""The contract of a simulator's file: which parts of a mount it can hold, and its text.

A file is written from a mount that has only parts which the simulator holds (`Held.mount`). What the card has beyond
that is measured as a torque along a motion (`measure.py`), with the same equations that make the FMU.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from pyfmi_models.effects import Effect
from pyfmi_models.mount import Mount

Holding = Callable[[Effect, Mount], "Written | None"]
"""What of an effect a simulator holds; None: nothing of it."""


@dataclass(frozen=True)
class Written:
    """An effect as a simulator holds it: perhaps with less (`effect`), and where in its file it is."""

    effect: Effect
    where: str
    lost: str = ""
    """What of the card's effect is not in it, in a few words."""


@dataclass(frozen=True)
class Format:
    """A simulator's file.

    `effects` maps an effect's class to what is held of it; `bristle` says that there are LuGre's bristles (exponent
    2), else friction is a Coulomb level and a viscous coefficient. `limit` is where the torque limit is written,
    `friction` where each law is that is held. `text` writes a file, given the mount that is held as a whole, the card's
    mount and a title.
    """

    key: str
    title: str
    suffix: str
    effects: Mapping[type[Effect], Holding]
    friction: Mapping[str, str]
    limit: str
    bristle: bool
    text: Callable[[Mount, Mount, str], str]
    whole: bool = False
    """Whether the file has the equations of the FMU, so that nothing is lost; then it is written elsewhere."""


def whole(where: str) -> Holding:
    """The effect as it is, written at `where`."""
    return lambda effect, mount: Written(effect, where)


def on_rotary(where: str) -> Holding:
    """The effect as it is on a rotary axis; nothing of it on a linear one, where angles mean something else."""
    return lambda effect, mount: Written(effect, where) if mount.motion == "rotary" else None


def _elsewhere(mount: Mount, card: Mount, title: str) -> str:
    raise TypeError("a file with the equations of the FMU is written by the export of models")


FLANGE = Format("modelica_flange", "Modelica with flanges", ".mo", {}, {}, "equations", True, _elsewhere, whole=True)
C = Format("c", "C", "_c", {}, {}, "equations", True, _elsewhere, whole=True)
