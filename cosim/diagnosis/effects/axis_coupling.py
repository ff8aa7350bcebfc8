"""A neighbouring axis whose motion was recorded acts on this one."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations, product
from math import atan2, hypot, inf
from typing import Any, ClassVar

import numpy as np

from cosim.data.neighbours import Neighbour
from cosim.diagnosis.answer.result import Where
from cosim.diagnosis.effects.base import HELD, UNSEEN, Evidence, Hypothesis, Reach
from cosim.diagnosis.effects.candidates import Candidate, Span, sized, wave
from cosim.diagnosis.effects.tuning import restarted
from cosim.estimation.fit import Fit
from cosim.estimation.neighbours import key
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.problem import Problem
from cosim.support.statistics import column_rms
from pyfmi_models.effects import Effect
from pyfmi_models.effects.axis_coupling import (
    AND,
    PRODUCTS,
    AxisCoupling,
    ChainCoupling,
    DampedCoupling,
    Neighbouring,
    SpaceCoupling,
    WeightCoupling,
)
from pyfmi_models.effects.base import Motion
from pyfmi_models.mount import Mount

FOLLOWS = (1.0, 0.0, -1.0)
"""Whether a weight turns with this axis too, or with the neighbour alone; -1 where both count the other way round."""
TURNS = tuple(product(FOLLOWS, (1.0, -1.0)))
"""The same of a weight behind three axes, and which way the second neighbour counts."""
LEAST_MORE = 5.0
"""Nats that a form of more numbers must have in addition: odds of 150 to 1."""
Form = type[Neighbouring]


class NeighbouringAxis(Hypothesis[Neighbouring]):
    """An inertia that both axes accelerate, alone or with a damping or a weight; a weight that hangs on three axes."""

    forms = (AxisCoupling, DampedCoupling, WeightCoupling, ChainCoupling, SpaceCoupling)
    sizes: ClassVar[tuple[str, ...]] = ("inertia", "damping", "weight", *PRODUCTS)
    rank: ClassVar[float] = 14.5
    needs_position: ClassVar[bool] = False
    view = "time"

    def may_come(self, mount: Mount) -> bool:
        """Beside that of another neighbour too."""
        return True

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Each neighbour: its acceleration, with its speed, and the weight that turns with it; weights behind two."""
        for one in _free(span.prepared.neighbours, mount):
            yield sized(AxisCoupling(neighbour=one.name))
            yield sized(DampedCoupling(damping=0.0, neighbour=one.name), names=("inertia", "damping"))
            for follows in FOLLOWS if _both_turn(one, mount) else ():
                yield wave(WeightCoupling(weight=0.0, follows=follows, neighbour=one.name))
        for pair in _pairs(span.prepared.neighbours, mount):
            for turns in TURNS:
                yield wave(_chain(pair, turns, 0.0, 0.0))
            yield sized(SpaceCoupling(neighbour=pair), names=PRODUCTS)

    def tuned(self, problem: Problem, found: Fit, start: Neighbouring, evidence: Evidence) -> Fit:
        """The simplest form that explains it: a damping or a weight only where it adds evidence to the inertia."""
        if len(start.neighbours) > 1:
            return _spared(problem, found, evidence)
        fits = self._single(problem, found, start, evidence)
        worth = {form: evidence(fit) for form, fit in fits.items()}
        least = max(worth.values()) - LEAST_MORE
        return next(fits[form] for form in self.forms if worth.get(form, -inf) >= least)

    def _single(self, problem: Problem, found: Fit, start: Neighbouring, evidence: Evidence) -> dict[Form, Fit]:
        one = next((one for one in problem.prepared.neighbours if one.name == start.neighbour), None)
        fits: dict[Form, Fit] = {type(start): found}
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
        return fits

    def concealed(self, mount: Mount, span: Span, tried: Sequence[Candidate]) -> Iterable[Candidate]:
        """An inertia coupling to each neighbour: what its size counts in is not what a weight counts in."""
        return [one for one in tried if type(one.instances[0]) is AxisCoupling]

    def where(self, effect: Neighbouring, reach: Reach) -> Where:
        """Wherever the neighbour moves, or both move."""
        moves = "move" if len(effect.neighbours) > 1 else "moves"
        return Where(axis="everywhere", description=f"wherever {effect.called} {moves}", regions=())

    def why_not(self, mount: Mount, prepared: Prepared) -> str:
        """It needs columns of a neighbour that moves by itself."""
        if not prepared.neighbours_recorded:
            return "no column of a neighbour"
        free = _free(prepared.neighbours_recorded, mount)
        if free and not _free(prepared.neighbours, mount):
            return f"{_listed(free)} stands still, is this axis itself, or follows its motion"
        return UNSEEN if free else HELD

    def remark(self, effect: Neighbouring, prepared: Prepared) -> str:
        """Neighbours that move in proportion to this one: no recording of both tells which of them acts."""
        said = []
        for name in effect.neighbours:
            alike = [one for one in prepared.neighbours_recorded if prepared.followed.get(one.name) == name]
            others = _listed([one for one in alike if one.name != name], " or ")
            said += [f"It may as well be {others}: `{name}` moves in proportion to that."] if others else []
        return " ".join(said)


def _free(several: Sequence[Neighbour], mount: Mount) -> list[Neighbour]:
    """Neighbours with which a mount has no coupling yet; one that names none is that with the only neighbour."""
    taken = {one.source for one in mount.effects if one.id == AxisCoupling.id}
    return [one for one in several if not taken & {one.name, ""}]


def _pairs(several: Sequence[Neighbour], mount: Mount) -> list[str]:
    """Two neighbours on which a weight may hang beside this axis, and with which the mount has none yet."""
    taken = {one.source for one in mount.effects if one.id == AxisCoupling.id}
    turning = [one.name for one in several if _both_turn(one, mount)]
    return [name for name in map(AND.join, combinations(turning, 2)) if not taken & {name, ""}]


def _chain(pair: str, turns: tuple[float, float], weight: float, phase: float) -> ChainCoupling:
    own, other = turns
    return ChainCoupling(weight=weight, phase=phase, follows=own, follows_second=other, neighbour=pair)


def _both_turn(one: Neighbour, mount: Mount) -> bool:
    """Whether a weight may hang on both: it needs two axes that turn, and the neighbour's position."""
    return mount.motion == "rotary" and one.turns and bool(one.position)


def _spared(problem: Problem, found: Fit, evidence: Evidence) -> Fit:
    """A fit whose last effect hangs on two neighbours, or with what hangs on fewer or in fewer numbers.

    More needs evidence where both count few ways of being wrong: an inertia that changes with the angles, which neither
    holds, has the products of sine and cosine, too, and a neighbour that moves little takes up what others leave.
    """
    wave = _simpler(problem, found)
    if wave is None:
        return found
    fit = restarted(problem, found, wave)
    if evidence(found, True) > evidence(fit, True) + LEAST_MORE:
        return found
    return _spared(problem, fit, evidence) if AND in wave.neighbour else fit


def _simpler(problem: Problem, found: Fit) -> Neighbouring | None:
    """The weight on one neighbour, or behind parallel axes, that explains most in the place of what hangs on two."""
    last: Any = found.mount.effects[-1]
    first, second = last.neighbours
    ways = [(own, {first: 1.0, second: other}) for own, other in TURNS if type(last) is SpaceCoupling]
    taken = {one.source for one in found.mount.effects}
    ways += [(own, {name: 1.0}) for own in FOLLOWS for name in (first, second) if name not in taken]
    if not ways:
        return None
    left, known = _without_last(problem, found, last)
    waves = [(_wave_of(problem, left, known, *way), *way) for way in ways]
    (load, phase, _), own, others = min(waves, key=lambda one: one[0][2])
    if len(others) > 1:
        return _chain(last.neighbour, (own, others[second]), load, phase)
    return WeightCoupling(weight=load, phase=phase, follows=own, neighbour=next(iter(others)))


def _without_last(problem: Problem, found: Fit, last: Neighbouring) -> tuple[Array, Array]:
    """What a fit leaves with the torque of its last effect, which hangs on two neighbours, and the other slopes."""
    prepared = problem.prepared
    q, v = prepared.stacked("q"), prepared.stacked("v")
    places = (prepared.of_neighbour(key(name, "position")) for name in last.neighbours)
    inputs = {one.name: place for one, place in zip(last.inputs(), places, strict=True)}
    torque: Array = np.asarray(last.load(Motion(0.0, q, v, q, inputs)), float).ravel()
    own = f"{list(found.mount.components())[-1]}."
    return found.residual + torque, found.slopes[:, [not name.startswith(own) for name in found.free]]


def _weight_left(problem: Problem, found: Fit, coupling: AxisCoupling, follows: float) -> Effect:
    """A weight on both axes as large as what an inertia leaves says."""
    name = coupling.neighbour
    load, phase, _ = _wave_of(problem, found.residual, found.slopes, follows, {name: 1.0})
    return WeightCoupling(inertia=coupling.inertia, weight=load, phase=phase, follows=follows, neighbour=name)


def _wave_of(
    problem: Problem, left: Array, known: Array, follows: float, others: Mapping[str, float]
) -> tuple[float, float, float]:
    """Weight, phase and error of what is left over an angle: so many turns of this axis and of each neighbour."""
    prepared = problem.prepared
    theirs = [turns * prepared.of_neighbour(key(name, "position")) for name, turns in others.items()]
    angle = np.sum([follows * prepared.stacked("q"), *theirs], axis=0)
    columns = np.column_stack([np.sin(angle), np.cos(angle), known]) * problem.weight[:, None]
    size = column_rms(columns) + 1e-300
    c = np.linalg.lstsq(columns / size, left * problem.weight, rcond=1e-9)[0] / size
    return max(hypot(c[0], c[1]), 1e-9), atan2(c[1], c[0]), float(np.linalg.norm(left * problem.weight - columns @ c))


def _listed(several: Sequence[Neighbour], between: str = ", ") -> str:
    return between.join(f"`{one.name}`" for one in several)
