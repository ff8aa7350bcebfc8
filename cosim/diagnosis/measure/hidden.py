"""What is concealed to test a bound: of each effect some members all over its range, and the ways each may lie.

Which members a kind has says its hypothesis (`Hypothesis.concealed`). What comes with a phase is concealed in four of
them, what may have either sign in both, and a tone, which has a phase of its own in each recording, twice at random.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from cosim.diagnosis.effects import HYPOTHESES, hypothesis_of
from cosim.diagnosis.effects.candidates import Candidate, Span, columns_of
from cosim.diagnosis.search.admissibility import is_degenerate, needs_turns
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.problem import Problem
from cosim.support.statistics import column_rms, rms
from pyfmi_models.effects import Effect
from pyfmi_models.model import parameters_of
from pyfmi_models.mount import Mount

MOST_TORQUE = 10.0
"""Times the torque's RMS that no effect can be that is a torque."""


@dataclass(frozen=True)
class Member:
    """One member of a kind of effects."""

    instance: Effect
    columns: Array
    directions: tuple[Array, ...]
    """Weights of the columns that are a unit of the main number, one for each way in which it may be concealed."""
    place: float
    """The number by which members of the kind differ."""
    prior: Array
    """How large the columns' coefficients may be (one standard deviation)."""
    many: int
    """Members that the search tries."""
    none: float = 0.0
    """Main number at which there is no effect."""
    least: float = 0.0
    """Size below which it is not named whatever its evidence ..."""
    most: float = np.inf
    """... and above which it cannot be."""
    phases: int = 0
    has_name: bool = True
    """Whether it would be given its name where it is as it stands here."""

    @property
    def effect(self) -> str:
        """Its id."""
        return self.instance.id

    @property
    def easiest(self) -> int:
        """Whether less (-1) or more (1) of the number at which it sets in is easier to find; 0 where it has a size."""
        return hypothesis_of(self.instance).easiest


def members(problem: Problem, mount: Mount, span: Span, tried: Sequence[Candidate], values: Array) -> list[Member]:
    """Make the members of all effects that the search tries."""
    chosen = [
        member
        for one in HYPOTHESES
        for member in one.concealed(mount, span, [c for c in tried if isinstance(c.instances[0], one.forms)])
        if not needs_turns(member.instances[0], mount, problem.prepared)
    ]
    even = [one for one in chosen if not hypothesis_of(one.instances[0]).has_own_phase]
    columns = columns_of(mount, even, problem.prepared, values)
    torque = rms(problem.prepared.stacked("tau"))
    many = {name: sum(one.effect == name for one in tried) for name in {one.effect for one in chosen}}
    made = [_member(one, own, problem, mount, torque, many[one.effect]) for one, own in zip(even, columns, strict=True)]
    tones = [one for one in chosen if hypothesis_of(one.instances[0]).has_own_phase]
    return [*made, *_tones(problem.prepared, tones, torque, many)]


def _member(one: Candidate, columns: Array, problem: Problem, mount: Mount, torque: float, many: int) -> Member:
    instance, own = one.instances[0], hypothesis_of(one.instances[0])
    main = instance.main
    size = column_rms(columns)
    high = next(variable.high for variable in parameters_of(instance) if variable.name == main.parameter)
    return Member(
        instance=instance,
        columns=columns,
        directions=_directions(one, columns.shape[1]),
        place=float(getattr(instance, own.member or main.parameter)),
        prior=np.ones(columns.shape[1]) if one.finite else 0.5 * torque / size,
        many=many,
        none=own.none(mount),
        least=own.least(problem.sample_time),
        most=min(high, MOST_TORQUE * torque if main.unit == "N.m" else np.inf),
        has_name=not own.easiest or _has_name(problem, mount, instance),
    )


def _has_name(problem: Problem, mount: Mount, effect: Effect) -> bool:
    return hypothesis_of(effect).shows(effect, mount, problem.prepared) and not is_degenerate(problem, effect)


def _directions(one: Candidate, count: int) -> tuple[Array, ...]:
    """Weights of a unit: of waves in both phases and signs, of what only resists with one sign, of others with both."""
    instance, unit = one.instances[0], np.eye(count)
    own, main = hypothesis_of(instance), instance.main.parameter
    low = next(variable.low for variable in parameters_of(instance) if variable.name == main)
    if own.easiest:
        return (unit[0],)
    if len(one.instances) == 2:
        return (*unit, *-unit) if hasattr(instance, "phase") else tuple(unit)
    unit[0] /= abs(float(getattr(instance, main))) if one.finite and getattr(instance, main) else 1.0
    return (unit[0],) if low >= 0 else (unit[0], -unit[0])


def _tones(prepared: Prepared, tones: Sequence[Candidate], torque: float, many: dict[str, int]) -> Iterator[Member]:
    """Tones, each with two sets of phases."""
    draw, pieces = np.random.default_rng(0), len(prepared.pieces)
    for one in tones:
        instance = one.instances[0]
        hertz = float(getattr(instance, hypothesis_of(instance).member))
        ways = tuple(_with_phases(draw.uniform(0, 2 * pi, pieces)) for _ in range(2))
        prior = np.full(2 * pieces, 0.5 * torque)
        yield Member(instance, _tone(prepared, hertz), ways, hertz, prior, many[one.effect], phases=pieces)


def _tone(prepared: Prepared, hertz: float) -> Array:
    """Sine and cosine over time in each piece, filtered, (rows, 2 pieces)."""
    rows = [len(piece.kept) for piece in prepared.pieces]
    out = np.zeros((sum(rows), 2 * len(rows)))
    for number, (piece, first) in enumerate(zip(prepared.pieces, np.cumsum([0, *rows]), strict=False)):
        angle = 2 * pi * hertz * piece.t
        waves = piece.lowpass(np.column_stack([np.sin(angle), np.cos(angle)]))[piece.kept]
        out[first : first + rows[number], 2 * number : 2 * number + 2] = waves
    return out


def _with_phases(phases: Array) -> Array:
    return np.column_stack([np.cos(phases), np.sin(phases)]).ravel()
