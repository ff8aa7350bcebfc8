"""Sizes of effects with their standard errors, and whether recordings determine them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.tuning import ended_sizes
from cosim.estimation.blocks import Blocks, covariance
from cosim.estimation.fit import Fit, recorded_by
from cosim.estimation.prepare import Array
from cosim.estimation.problem import Problem
from cosim.support.statistics import Z95
from pyfmi_models.effects import Effect
from pyfmi_models.model import Recorded, Variable, parameters_of
from pyfmi_models.mount import Mount


@dataclass(frozen=True)
class Numbers:
    """Parameters of one effect, and what the recordings say of their precision."""

    values: dict[str, float]
    errors: dict[str, float]


def standard_errors(chosen: Fit, blocks: Blocks, weight: Array) -> dict[str, float]:
    """Block-robust standard errors of all fitted parameters (sandwich with blocks as clusters)."""
    spread = covariance(chosen.slopes * weight[:, None], chosen.residual * weight, blocks)
    return dict(zip(chosen.free, np.sqrt(np.maximum(np.diag(spread), 0)).tolist(), strict=True))


def numbers_of(effect: Effect, mount: Mount, errors: Mapping[str, float]) -> Numbers:
    """Parameters of an effect of a fitted mount with their standard errors, by the effect's own names."""
    prefix = next(name for name, part in mount.components().items() if part is effect)
    values = {variable.name: float(variable.start) for variable in parameters_of(effect)}
    return Numbers(values, {name: errors[f"{prefix}.{name}"] for name in values if f"{prefix}.{name}" in errors})


def is_told(effect: Effect, numbers: Numbers, mount: Mount, recorded: Recorded) -> bool:
    """Whether the recordings tell the size of an effect: its 95 % range holds neither "none" nor all that it may be.

    Of several sizes (a level and a viscosity, an offset and a drift) one is enough. At a bound, also at one of the fit,
    nothing is told.
    """
    own, known = hypothesis_of(effect), {variable.name: variable for variable in parameters_of(effect)}
    sizes = [name for name in own.sizes or (effect.main.parameter,) if name in numbers.errors]
    ended = ended_sizes(effect, sizes, recorded)
    return not sizes or any(
        name not in ended and _excludes(numbers, name, own.none(mount), known[name]) for name in sizes
    )


def tells(problem: Problem, chosen: Fit, effect: Effect) -> bool:
    """Whether the training recordings tell a size of an effect of a fitted structure."""
    numbers = _in_training(problem, chosen, effect)
    return is_told(effect, numbers, chosen.mount, recorded_by(problem.prepared.pieces))


def goes_its_way(problem: Problem, found: Fit, effect: Effect) -> bool:
    """Whether an effect of a fitted structure goes the way its name says, by more than its 95 % range."""
    names = hypothesis_of(effect).must_fall(effect)
    numbers = _in_training(problem, found, effect) if names else None
    return not numbers or any(numbers.values[name] < -Z95 * numbers.errors.get(name, np.inf) for name in names)


def _in_training(problem: Problem, found: Fit, effect: Effect) -> Numbers:
    """An effect's numbers with the errors that the training recordings leave."""
    return numbers_of(effect, found.mount, standard_errors(found, Blocks.of(problem.prepared), problem.weight))


def _excludes(numbers: Numbers, name: str, none: float, known: Variable) -> bool:
    value, half = numbers.values[name], Z95 * numbers.errors[name]
    whole = value - half <= known.low and value + half >= known.high
    return abs(value - none) > half and not whole and known.low < value < known.high
