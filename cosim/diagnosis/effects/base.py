"""The contract of a hypothesis: an effect as a question to recordings, and all that a diagnosis must know to ask it.

The physics is in `pyfmi_models/effects`: equation, parameters with units and bounds, what the effect is called. Here
stands, one file an effect, what only a diagnosis asks: what is worth trying, how its numbers are fitted, whether they
are what the name says, where it acts, how small it may be and still be seen, and why recordings cannot test it.

Hypotheses are stateless; a new one is a new file in this folder, and nothing else is edited.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from math import pi
from typing import Any, ClassVar, Generic, Literal, NamedTuple, TypeVar

import numpy as np

from cosim.diagnosis.answer.result import Where
from cosim.diagnosis.effects.candidates import Candidate, Span
from cosim.diagnosis.effects.tuning import in_cycles, revived
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Prepared
from cosim.estimation.problem import Problem
from pyfmi_models.effects import Effect
from pyfmi_models.mount import Mount

Form = TypeVar("Form", bound=Effect)
Evidence = Callable[..., float]
"""Nats of a fit; with True behind it, where a few ways of being wrong count and no rows, as between two names."""
View = Literal[
    "position",
    "one pitch",
    "slow and fast",
    "keep turning",
    "since reversal",
    "rest before a start",
    "time",
    "spectrum",
    "phase",
    "clock",
    "load",
]
"""Views of recordings that a report can draw, each before and after."""
EVERYWHERE = Where(axis="everywhere", description="everywhere", regions=())
QUICK_CHANGES = Where(axis="frequency", description="wherever the torque changes quickly", regions=())


class Reach(NamedTuple):
    """What the recordings visited: lowest and highest position [rad, m], highest speed."""

    low: float
    high: float
    top: float


class Seen(NamedTuple):
    """From which size on an effect would have been found, for which members of its kind, in which band [Hz]."""

    size: float
    low: float
    high: float
    cutoff: float


class Hypothesis(Generic[Form]):
    """One effect, in one of its forms or in several, that recordings are asked for."""

    forms: ClassVar[tuple[type[Effect], ...]]
    """Classes of effects that this hypothesis proposes."""
    rank: ClassVar[float] = 1e3
    """Place among all hypotheses: friction, loads, drive and clock, mechanics, sensor; a new one comes last."""
    needs_position: ClassVar[bool] = True
    share_of: ClassVar[str] = ""
    """Number of the base of which its size is a share: where that is not determined, no size of it can be told."""
    imitated_by: ClassVar[str] = ""
    """Nuisance that is this effect in another form: beside it the effect would be explained away."""
    tables: ClassVar[tuple[str, ...]] = ()
    """Terms that may be learned which are this effect in another form: where one is better, the name is still right."""
    finds_its_way: ClassVar[bool] = False
    """Whether a refit gets from any member of the grid to the best one; then only one is refitted."""
    must_stand_out: ClassVar[bool] = False
    """Whether it must remove more energy than the noise of the reading holds, and be asked for by the set point."""
    is_fine: ClassVar[bool] = False
    """Whether it is a wave finer than the shapes of any term that may be learned: no such term can be its rival."""
    is_timing: ClassVar[bool] = False
    """Whether it is told by changes of the torque alone."""
    has_own_phase: ClassVar[bool] = False
    """Whether its phase is another in each recording."""
    view: ClassVar[View] = "position"
    acts: ClassVar[Where] = EVERYWHERE
    """Where it acts, if that is the same whatever its numbers are."""
    easiest: ClassVar[int] = 0
    """Where the main number says where the effect sets in: whether less (-1) or more (1) of it is easier to find."""
    member: ClassVar[str] = ""
    """The parameter by which what is concealed differs: cycles, a frequency, a width."""
    sizes: ClassVar[tuple[str, ...]] = ()
    """Parameters of which one must differ from none, where that is not the main number alone."""
    same_as: ClassVar[str] = ""
    """Effect with the very same equation: what was found of that one may be this one, and no recording tells which.
    Such a hypothesis has no candidates of its own."""
    may_end: ClassVar[tuple[str, ...]] = ()
    """Parameters whose least value is a machine's too: a drive that gives nothing beyond its knee."""
    caveat: ClassVar[str] = ""
    """What must be said beside the evidence."""

    def may_come(self, mount: Mount) -> bool:
        """Whether a mount may have the effect beside what it has: candidates are asked for only then."""
        return not (self.is_settled(mount) or self._needs_friction(mount))

    def candidates(self, mount: Mount, span: Span) -> Iterable[Candidate]:
        """What is worth trying; nothing where it cannot be seen."""
        raise TypeError(f"{type(self).__name__} has no candidates")

    def twins(self, effect: Form) -> list[Effect]:
        """Effects alike at first order, to be tried whatever a linear score says of them."""
        return []

    def tuned(self, problem: Problem, found: Fit, start: Form, evidence: Evidence) -> Fit:
        """Fit what the grid knows only roughly of the effect that was added last, from `start`.

        Of fits from several starts the one with most evidence is taken: the least residual may be about very few rows.
        `evidence` of a fit is in nats above the structure without the effect.
        """
        found = revived(problem, found, start) if start.place == "Friction" else found
        return in_cycles(problem, found) if getattr(found.mount.effects[-1], "cycles_per_rev", 0.0) > 0 else found

    def renamed(self, effect: Effect, mount: Mount) -> Form | None:
        """An effect that was found of `same_as` by this name; None where the axis cannot have it."""
        return None

    def multiple(self, ripple: Form, k: int) -> Candidate | None:
        """Candidate for k times the cycles of a ripple; None where the effect is none."""
        return None

    def is_degenerate(self, problem: Problem, effect: Form) -> bool:
        """Whether a fitted effect is really something else: a time-stamp convention, a level, an unbalance, a drift."""
        return False

    def is_plausible(self, effect: Form, mount: Mount) -> bool:
        """Whether a fitted effect, in the fitted mount that holds it, is what its name says."""
        return True

    def must_fall(self, effect: Form) -> tuple[str, ...]:
        """Parameters of which one must surely be below none: what the name says goes one way. Empty: no matter."""
        return ()

    def shows(self, effect: Form, mount: Mount, prepared: Prepared) -> bool:
        """Whether the recorded motion shows what tells the fitted effect from another law of friction."""
        return True

    def way_back(self, effect: Form, mount: Mount) -> float:
        """How far motion must turn back to show the fitted effect [rad, m]."""
        return 0.0

    def where(self, effect: Form, reach: Reach) -> Where:
        """Where a fitted effect acts, within what was visited."""
        return self.acts

    def further(self, waves: Sequence[Form]) -> str:
        """A sentence on the further waves of a ripple: each with its cycles and size, largest first."""
        told = [wave for wave in waves if hasattr(wave, "cycles_per_rev")]
        told.sort(key=lambda wave: -abs(_size(wave)))
        said = ", ".join(f"{wave.cycles_per_rev:.4g} ({_size(wave):.2g})" for wave in told)
        return f" Further waves, cycles (size): {said}." if said else ""

    def remark(self, effect: Form, prepared: Prepared) -> str:
        """A sentence on what these recordings cannot tell from an effect that was found."""
        return ""

    def card_note(self, first: str) -> str:
        """What the improved card must say beside the effect; `first` names the first recording."""
        return ""

    def none(self, mount: Mount) -> float:
        """The main number at which there is no effect."""
        return 0.0

    def least(self, sample_time: float) -> float:
        """The main number below which the effect is not named, whatever its evidence."""
        return 0.0

    def concealed(self, mount: Mount, span: Span, tried: Sequence[Candidate]) -> Iterable[Candidate]:
        """Members of the kind all over its range; they are concealed to test how small the effect may be."""
        return tried

    def looked(self, seen: Seen, mount: Mount) -> str:
        """For what a bound holds, if not for all of the effect, and what cannot be tested."""
        return ""

    def is_settled(self, mount: Mount) -> bool:
        """Whether no recording can test the effect: the model has it already, or the axis cannot have it."""
        return any(isinstance(effect, self.forms) for effect in mount.effects)

    def _needs_friction(self, mount: Mount) -> bool:
        """Whether it changes a friction that the mount does not have."""
        return mount.friction.key == "none" and any(form.place == "Friction" for form in self.forms)

    def why_not(self, mount: Mount, prepared: Prepared) -> str:
        """Why these recordings cannot test the effect: one reason. What to record is the effect's own to say."""
        if self.is_settled(mount):
            return HELD
        if self._needs_friction(mount):
            return NO_FRICTION
        return NO_POSITION if self.needs_position and not prepared.has_position else UNSEEN


def _size(wave: Effect) -> float:
    main = wave.leading()
    return float(main.factor * getattr(wave, main.parameter))


HELD = "the model has it already"
NO_FRICTION = "the card says that there is no friction"
NO_POSITION = "no position was recorded"
NOT_DETERMINED = "these recordings do not determine what it is a share of, the"
UNSEEN = "these recordings do not excite it"
RESTLESS = "a friction law that says nothing about rest cannot tell it from"
"""Reasons why an effect cannot be tested; the last one goes on with the effect that was found."""


def visited(reach: Reach) -> Where:
    """All positions that were visited."""
    return Where(axis="position", description="everywhere that was visited", regions=((reach.low, reach.high),))


def turn(mount: Mount) -> float:
    """What cycles count in: a turn [rad] of a rotary axis, a metre of a linear one."""
    return 1.0 if mount.motion == "linear" else 2 * pi


def with_numbers(one: Candidate, **numbers: float) -> Candidate:
    """A candidate with other nonlinear numbers."""
    change: Any = replace
    return replace(one, instances=tuple(change(instance, **numbers) for instance in one.instances))


def of_that_size(one: Candidate, **numbers: float) -> Candidate:
    """A candidate whose column is all that the effect changes with these numbers, not its derivative at none of it."""
    return replace(with_numbers(one, **numbers), linear=())


LEAST_CYCLES = 1.5
"""A ripple with fewer cycles a turn is an unbalance."""
WAVES, LEAST_STROKE, PASSED = 4, 1.5, 0.8
"""Numbers of cycles that are concealed, from so many over the visited positions to what the filter passes of them at
the median speed: this share of the cutoff."""


class Cyclic(Hypothesis[Form]):
    """An effect with so many cycles a turn (a metre), each number of them a member of its kind."""

    member: ClassVar[str] = "cycles_per_rev"
    is_fine: ClassVar[bool] = True
    shown: ClassVar[tuple[float, float]] = (LEAST_CYCLES, math.inf)
    """Cycles a turn from which and up to which one is concealed."""

    def concealed(self, mount: Mount, span: Span, tried: Sequence[Candidate]) -> Iterable[Candidate]:
        """All that a stroke holds and the band passes."""
        speed, (lowest, highest) = np.abs(span.v), self.shown
        moving = speed[speed > 0.02 * span.top]
        passed = PASSED * span.cutoff * turn(mount) / max(float(np.median(moving)) if len(moving) else 0.0, 1e-300)
        low = max(LEAST_STROKE * turn(mount) / max(span.reach, 1e-300), lowest if mount.motion == "rotary" else 0.0)
        high = min(passed, highest)
        cycles = np.geomspace(low, high, WAVES).tolist() if high > low else []
        return [with_numbers(first, cycles_per_rev=one) for first in tried[:1] for one in cycles]

    def looked(self, seen: Seen, mount: Mount) -> str:
        """Between which cycles a bound holds."""
        per = "a metre" if mount.motion == "linear" else "a turn"
        low, high = (f"{one:.3g}" if one < 1000 else f"{one:.0f}" for one in (seen.low, seen.high))
        return f"at {low if low == high else f'{low} to {high}'} cycles {per}; not testable above"


class Rippled(Cyclic[Form]):
    """One that may have further waves, whole multiples of its cycles among them."""

    view = "one pitch"

    def wave(self, cycles: float) -> Candidate:
        """A candidate with so many cycles."""
        raise TypeError(f"{type(self).__name__} has no wave")

    def multiple(self, ripple: Form, k: int) -> Candidate | None:
        """So many times the cycles."""
        cycles = float(getattr(ripple, self.member))
        return self.wave(k * cycles) if cycles > 0 else None

    def where(self, effect: Form, reach: Reach) -> Where:
        """At all positions that were visited."""
        return visited(reach)

    def is_settled(self, mount: Mount) -> bool:
        """Never: there may be further waves."""
        return False
