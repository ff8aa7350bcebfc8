"""Numbers of a delivered card that the recordings did not determine: which, what the card holds, and what would."""

from collections.abc import Mapping
from dataclasses import dataclass

from cosim.estimation.determined import Limited
from cosim.estimation.problem import Problem
from cosim.plots.quantities import joined, number, raised
from cosim.support.plain import JsonObject
from pyfmi_models.model import Variable

NAMES = {
    "inertia": ("inertia", "motion that speeds up and slows down"),
    "Fc": ("Coulomb friction", "constant speeds, fast and slow"),
    "sigma2": ("viscous friction", "constant speeds, fast and slow"),
    "Fs": ("break-away level", "slow motion and reversals"),
    "Vs": ("Stribeck speed", "slow motion and reversals"),
    "delta": ("Stribeck exponent", "slow motion and reversals"),
    "sigma0": ("stiffness before break-away", "small reversals"),
    "sigma1": ("damping before break-away", "small reversals"),
}
"""What the last part of a parameter's name means, and which motion shows it."""


@dataclass(frozen=True)
class NotDetermined:
    """One number: its variable as the card has it, the value that is delivered, and on which side it is limited."""

    variable: Variable
    value: float
    limit: Limited | None = None
    is_simulated: bool = True
    """Whether all numbers could be fitted at once; without a simulated loop `identify` has only its other ways."""

    def as_json(self) -> JsonObject:
        """The entry as JSON holds it: `limit` is "highest", "lowest", or null where nothing is known."""
        limit = ("highest" if self.limit.is_highest else "lowest") if self.limit else None
        return {"value": self.value, "unit": self.variable.unit, "limit": limit, "statement": self.statement}

    @property
    def statement(self) -> str:
        """One sentence: what is not determined, what the card holds, which motion would show it."""
        name = self.variable.name
        words, motion = next((NAMES[part] for part in name.split(".") if part in NAMES), ("number", ""))
        record = f" Recordings of {motion} would determine it." if motion else ""
        value, given = (
            joined(number(one, 3), raised(self.variable.unit.removeprefix("1")))
            for one in (self.value, self.variable.start)
        )
        if not self.is_simulated:
            by = f"Without a simulated loop no way here determines the {words} ({name}): the card's {value} is kept"
            return f"{by}; cosim diagnose refits it from the torque."
        if not self.limit:
            return f"These recordings do not determine the {words} ({name}): the card's {value} is kept.{record}"
        most = "most" if self.limit.is_highest else "least"
        known = f"only show that the {words} ({name}) is at {most} {value}"
        return f"These recordings {known}; the card had {given}, and now holds that limit.{record}"


def not_determined(problem: Problem, limits: Mapping[str, Limited]) -> tuple[NotDetermined, ...]:
    """All numbers that a diagnosis delivers without having found them: those held, and those at a limit."""
    known = {variable.name: variable for variable in problem.mount.parameters()}
    held = (NotDetermined(known[name], known[name].start) for name in problem.held)
    return (*held, *(NotDetermined(known[name], one.value, one) for name, one in limits.items()))
