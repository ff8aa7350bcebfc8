"""What the file of a proposed effect looks like: how it reads a quantity, where a formula acts, and the text around it.

`proposal.py` fills it in.
"""

from dataclasses import dataclass

from pyfmi_models.effects.learned_base import SEEN_WITHIN

KNOWN = {
    "position": "motion.q",
    "speed": "motion.v",
    "turn": "ca.atan2(ca.sin(motion.angle), ca.cos(motion.angle))",
    "payload": "ca.fabs(motion.payload)",
    "command": "command",
    "acceleration": f"(motion.v - motion.state[0]) / {SEEN_WITHIN}",
    "way": "motion.state[0]",
}
"""Quantities as an effect finds them; all others are inputs."""
RATES = {"acceleration": KNOWN["acceleration"], "way": "ca.fabs(motion.v)"}
"""Rate of the state that follows a quantity."""


@dataclass(frozen=True)
class Place:
    """Where a formula acts: base class, what it needs of the contract, method with its arguments, what it returns."""

    base: str
    needed: tuple[str, ...]
    method: str
    returned: str
    then: str = ""
    """What follows: a method that needs what this one knows."""


AT_ONCE = """
    def applied(self, state: object, command: Scalar) -> Scalar:
        \"\"\"The command, less by what is needed more.\"\"\"
        return command / ca.fmax(1.0 + self.now, 0.1)
"""
"""Of a drive whose gain depends on the motion: the formula of the moment is kept for this."""
PLACES = {
    "torque": Place("LoadEffect", ("Main", "Motion"), "load(self, motion: Motion) -> Scalar", "f"),
    "friction": Place(
        "FrictionEffect",
        ("Main", "Motion"),
        "level(self, level: Scalar, motion: Motion) -> Scalar",
        "level * ca.fmax(1.0 + f, 0.0)",
    ),
    "viscous": Place(
        "FrictionEffect",
        ("Main", "Motion"),
        "viscous(self, viscous: Scalar, motion: Motion) -> Scalar",
        "viscous + motion.v * ca.fmax(f, -ca.fabs(viscous) / (ca.fabs(motion.v) + 1e-9))",
    ),
    "gain": Place(
        "DriveEffect", ("Main", "Motion"), "given(self, motion: Motion) -> Self", "replace(self, now=f)", AT_ONCE
    ),
    "drive": Place("DriveEffect", ("Main",), "applied(self, state: object, command: Scalar) -> Scalar", "command - f"),
}
PLACES["friction after a reversal"] = PLACES["friction"]
"""Of each kind of learned term that has a value."""

FILE = '''"""Proposed by `cosim diagnose` {version} from recordings; nobody has reviewed it yet.

{statement}

To use it: say what it is and where it comes from, rename file, class and id, and put the file into
pyfmi_models/effects/ (docs/adding_physics.md). A card then holds it with

    [[effects]]
    effect = "{id}"
"""

from dataclasses import {dataclasses}
from typing import {typing}

import casadi as ca

from pyfmi_models.effects.base import {imports}
from pyfmi_models.model import {model_imports}

{ranges}


@dataclass(frozen=True, kw_only=True)
class {name}({base}):
    """{equation}

    Fitted to recordings; each quantity is held at the ends of the range that was seen.
    """

    id: ClassVar[str] = "{id}"
    title: ClassVar[str] = "{title}"
    equation: ClassVar[str] = "{equation}"
    main: ClassVar[Main] = Main("{main}", unit="{main_unit}")
    told_apart_by: ClassVar[str] = "it is fitted to recordings: say what else would look like it"
    action: ClassVar[str] = "Say what makes it, and what to do about it."
{parameters}
{inputs}
    def {method}:
        """The equation above."""
{body}
        return {returned}
{then}
    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        return f"{{self.title}}: {{self.equation}}."
'''


__all__ = ["FILE", "KNOWN", "PLACES", "RATES", "Place"]
