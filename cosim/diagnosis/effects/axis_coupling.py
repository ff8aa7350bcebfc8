"""A neighbouring axis whose motion was recorded acts on this one."""

from collections.abc import Iterable, Iterator, Sequence
from math import atan2, hypot, inf, pi
from typing import Any, ClassVar

import numpy as np

from cosim.data.neighbours import Neighbour
from cosim.diagnosis.answer.result import Where
from cosim.diagnosis.effects.base import HELD, UNSEEN, Evidence, Hypothesis, Reach
from cosim.diagnosis.effects.candidates import Candidate, Span
from cosim.diagnosis.effects.tuning import restarted
from cosim.estimation.fit import Fit
from cosim.estimation.neighbours import key
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.problem import Problem
from cosim.support.statistics import column_rms
from pyfmi_models.effects import Effect
from pyfmi_models.effects.axis_coupling import AxisCoupling, DampedCoupling, WeightCoupling
from pyfmi_models.mount import Mount

FOLLOWS = (1.0, 0.0, -1.0)
"""Whether a weight turns with this axis too, or with the neighbour alone; -1 where both count the other way round."""
LEAST_MORE = 5.0
"""Nats that a damping or a weight must have in addition to the inertia: odds of 150 to 1."""


class NeighbouringAxis(Hypothesis[AxisCoupling]):
    """An inertia that both axes accelerate, alone or with a damping or a weight beside it."""

    forms = (AxisCoupling, DampedCoupling, WeightCoupling)
    sizes: ClassVar[tuple[str, ...]] = ("inertia", "damping", "weight")
    rank: ClassVar[float] = 14.5
    needs_position: ClassVar[bool] = False
    view = "time"

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Each neighbour: its acceleration, with its speed, and the weight that turns with it."""
        for one in _free(span.prepared.neighbours, mount):
            yield from _moved_by(one, mount)

    def tuned(self, problem: Problem, found: Fit, start: AxisCoupling, evidence: Evidence) -> Fit:
        """The simplest form that explains it: a damping or a weight only where it adds evidence to the inertia."""
        one = next((one for one in problem.prepared.neighbours if one.name == start.neighbour), None)
        fits = {type(start): found}
        fitted: Any = found.mount.effects[-1]
        inertia = AxisCoupling(inertia=fitted.inertia, neighbour=start.neighbour)
        if AxisCoupling not in fits:
            fits[AxisCoupling] = restarted(problem, found, inertia)
        else:
            drag = DampedCoupling(inertia=inertia.inertia, damping=0.0, neighbour=start.neighbour)
            fits[DampedCoupling] = restarted(problem, found, drag)
            if one and _both_turn(one, found.mount):
                loads = [_weight_left(problem, found, inertia, follows) for follows in FOLLOWS]
                fits[WeightCoupling] = max((restarted(problem, found, load) for load in loads), key=evidence)
        worth = {form: evidence(fit) for form, fit in fits.items()}
        least = max(worth.values()) - LEAST_MORE
        return next(fits[form] for form in self.forms if worth.get(form, -inf) >= least)

    def concealed(self, mount: Mount, span: Span, tried: Sequence[Candidate]) -> Iterable[Candidate]:
        """An inertia coupling to each neighbour: what its size counts in is not what a weight counts in."""
        return [one for one in tried if type(one.instances[0]) is AxisCoupling]

    def where(self, effect: AxisCoupling, reach: Reach) -> Where:
        """Wherever the neighbour moves."""
        return Where(axis="everywhere", description=f"wherever {effect.called} moves", regions=())

    def why_not(self, mount: Mount, prepared: Prepared) -> str:
        """It needs columns of a neighbour that moves by itself."""
        if not prepared.neighbours_recorded:
            return "no column of a neighbour"
        free = _free(prepared.neighbours_recorded, mount)
        if free and not _free(prepared.neighbours, mount):
            return f"{_listed(free)} stands still, is this axis itself, or follows its motion"
        return UNSEEN if free else HELD

    def remark(self, effect: AxisCoupling, prepared: Prepared) -> str:
        """Neighbours that move in proportion to this one: no recording of both tells which of them acts."""
        alike = [one for one in prepared.neighbours_recorded if prepared.followed.get(one.name) == effect.neighbour]
        others = _listed([one for one in alike if one.name != effect.neighbour], " or ")
        return f"It may as well be {others}: {effect.called} moves in proportion to that." if others else ""


def _free(several: Sequence[Neighbour], mount: Mount) -> list[Neighbour]:
    """Neighbours with which a mount has no coupling yet; one that names none is that with the only neighbour."""
    taken = {one.source for one in mount.effects if one.id == AxisCoupling.id}
    return [one for one in several if not taken & {one.name, ""}]


def _moved_by(one: Neighbour, mount: Mount) -> Iterator[Candidate]:
    """What one neighbour may do."""

    def inertia(c: Array) -> Effect:
        return AxisCoupling(inertia=float(c[0]), neighbour=one.name)

    def damped(c: Array) -> Effect:
        return DampedCoupling(inertia=float(c[0]), damping=float(c[1]), neighbour=one.name)

    yield Candidate("axis_coupling", (AxisCoupling(neighbour=one.name),), ("inertia",), inertia)
    drag = DampedCoupling(damping=0.0, neighbour=one.name)
    yield Candidate("axis_coupling", (drag,), ("inertia", "damping"), damped)
    for follows in FOLLOWS if _both_turn(one, mount) else ():

        def weight(c: Array, follows: float = follows) -> Effect:
            size, phase = hypot(*c), atan2(c[1], c[0])
            return WeightCoupling(weight=size, phase=phase, follows=follows, neighbour=one.name)

        pair = tuple(
            WeightCoupling(weight=0.0, phase=phase, follows=follows, neighbour=one.name) for phase in (0.0, pi / 2)
        )
        yield Candidate("axis_coupling", pair, ("weight",), weight)


def _both_turn(one: Neighbour, mount: Mount) -> bool:
    """Whether a weight may hang on both: it needs two axes that turn, and the neighbour's position."""
    return mount.motion == "rotary" and one.turns and bool(one.position)


def _weight_left(problem: Problem, found: Fit, coupling: AxisCoupling, follows: float) -> Effect:
    """A weight on both axes as large as what an inertia leaves says."""
    prepared, name = problem.prepared, coupling.neighbour
    angle = follows * prepared.stacked("q") + prepared.of_neighbour(key(name, "position"))
    columns = np.column_stack([np.sin(angle), np.cos(angle), found.slopes]) * problem.weight[:, None]
    size = column_rms(columns) + 1e-300
    c = np.linalg.lstsq(columns / size, found.residual * problem.weight, rcond=1e-9)[0] / size
    load, phase = max(hypot(c[0], c[1]), 1e-9), atan2(c[1], c[0])
    return WeightCoupling(inertia=coupling.inertia, weight=load, phase=phase, follows=follows, neighbour=name)


def _listed(several: Sequence[Neighbour], between: str = ", ") -> str:
    return between.join(f"`{one.name}`" for one in several)
