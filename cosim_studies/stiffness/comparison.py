"""Errors and stability of every method, in every motion."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees, inf
from pathlib import Path

import numpy as np

from cosim.support.errors import InputError
from cosim_studies.stiffness.archive import Solver, bristle_model, co_simulation
from cosim_studies.stiffness.methods import EXPLICIT, METHODS, Floats, exact, iterate, stability_limit, torque
from cosim_studies.stiffness.motion import REGIMES, STEP, Regime
from pyfmi_models.card import Card
from pyfmi_models.export import export_fmu
from pyfmi_models.friction import LuGre

DIVERGED = 10.0
"""A method whose z leaves this many times the largest true |z| is called unstable."""
FMU = "FMU"
IN_THE_LOOP: Mapping[str, Solver] = {FMU: co_simulation}


@dataclass(frozen=True, kw_only=True)
class Row:
    """One method in one regime; errors are the largest over the whole motion, infinite where it diverges."""

    step: float
    regime: str
    method: str
    z_error: float
    """Error of z relative to the largest |z|."""
    torque_error: float
    """Error of the friction torque [N m]."""
    stable: bool


@dataclass(frozen=True, kw_only=True)
class Limit:
    """Steady speed above which an explicit method is unstable, in the direction where it is lower."""

    step: float
    method: str
    speed: float
    """[rad/s]"""

    @property
    def degrees(self) -> float:
        """[deg/s]."""
        return degrees(self.speed)


def compare(
    card: Card, step: float = STEP, regimes: Sequence[Regime] = REGIMES, solvers: Mapping[str, Solver] = IN_THE_LOOP
) -> list[Row]:
    """Run all methods in all regimes on the friction law of a card; `solvers` are the ways to run its FMU.

    Raises:
        InputError: the card's friction has no bristles.
        ModelError: the law cannot be exported.
    """
    law, rows = law_of(card), []
    with tempfile.TemporaryDirectory() as folder:
        path = export_fmu(bristle_model(law), Path(folder) / "bristle.fmu")
        for regime in regimes:
            found = {name: solve(path, regime, step) for name, solve in solvers.items()}
            rows += rows_of(law, regime, step, found | by_formula(law, regime, step))
    return rows


def by_formula(law: LuGre, regime: Regime, step: float) -> dict[str, Floats]:
    """Bristle torque [N m] at the end of each step by the methods that need no FMU."""
    starts = step * np.arange(regime.ticks(step), dtype=np.float64)
    return {name: iterate(one(law, regime, step), starts) for name, one in METHODS.items()}


def rows_of(law: LuGre, regime: Regime, step: float, found: Mapping[str, Floats]) -> list[Row]:
    """Hold the bristle torques of several methods against the truth."""
    truth, v = exact(law, regime, step), regime.speed(step * np.arange(1, regime.ticks(step) + 1, dtype=np.float64))
    scale, true_torque, rows = float(np.abs(truth).max()), torque(law, truth, v), []
    for method, z in found.items():
        stable = bool(np.all(np.isfinite(z)) and np.abs(z).max() <= DIVERGED * scale)
        errors = ((z - truth) / scale, torque(law, z, v) - true_torque)
        worst = [float(np.abs(error).max()) if stable else inf for error in errors]
        rows.append(
            Row(step=step, regime=regime.name, method=method, z_error=worst[0], torque_error=worst[1], stable=stable)
        )
    return rows


def limits(card: Card, steps: Sequence[float]) -> list[Limit]:
    """Return the stability limits of the explicit methods; the other methods have none."""
    law = law_of(card)
    return [
        Limit(step=step, method=method, speed=min(stability_limit(law, bound, step, side) for side in (1, -1)))
        for step in steps
        for method, bound in EXPLICIT.items()
    ]


def law_of(card: Card) -> LuGre:
    """Return the card's LuGre law, or raise `InputError`."""
    if not isinstance(card.friction, LuGre):
        message = f'{card.path}: [friction] model is "{card.friction.key}"; only "lugre" has a stiff state to compare.'
        raise InputError(message, culprit=card.path, value=card.friction.key, choices=("lugre",))
    return card.friction
