"""The rounds: diagnose all recordings together, and while something is open, run the motion that tells most.

Each motion is run twice, once to be fitted and once, from the other end, for the proof: an effect that no held-out
recording shows cannot be proven. Steps that the journal holds are not done again.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Literal

import numpy as np

from cosim.data.recording import Recording
from cosim.diagnosis.answer.result import Diagnosis
from cosim.diagnosis.diagnose import Outcome
from cosim.diagnosis.diagnose import diagnose as find
from cosim.estimation.fit import Fit
from cosim.estimation.problem import Problem
from cosim.support.errors import InputError
from cosim_investigation.design import (
    SMALLER,
    Plan,
    Rated,
    allowed,
    beside_random,
    best,
    pieces_of,
    plans,
    shown_by_motion,
    torque_predicted,
)
from cosim_investigation.families import FAMILIES, multisine, tone
from cosim_investigation.limits import Limits, frequency_of
from cosim_investigation.log import Log
from cosim_investigation.machine import Machine
from cosim_investigation.motions import Motion, Room, room_of
from cosim_investigation.questions import Duel, Question, duels, is_settled, problem_of, questions
from cosim_investigation.story import Answered, End, Moved, Story
from pyfmi_models.card import Card
from pyfmi_models.effects import CATALOGUE

ROUNDING = 1e-6
"""Seconds by which sums of times may differ."""
SHORTEST = 8.0
"""Seconds that a motion must last, or it is not worth starting: the diagnosis leaves 3.5 s of a recording out."""
ROLES: tuple[Literal["train", "heldout"], ...] = ("train", "heldout")


@dataclass(frozen=True)
class Settings:
    """Seconds of motion that may be spent, and of one motion; the seed of its phases; designed or at random."""

    budget: float = 300.0
    seconds: float = 15.0
    seed: int = 1
    design: Literal["log-odds", "random"] = "log-odds"


@dataclass
class Investigation:
    """What is moved, what is believed, what may not be left, and where it is kept."""

    machine: Machine
    card: Card
    limits: Limits
    log: Log
    settings: Settings = field(default_factory=Settings)
    on_progress: Callable[[str], None] = lambda _: None
    on_step: Callable[[Moved | Answered], None] = lambda _: None
    recordings: dict[str, list[Recording]] = field(default_factory=lambda: {"train": [], "heldout": []})
    steps: list[Moved | Answered] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)
    unmoved: tuple[Question, ...] = ()
    """Questions that no motion decides."""
    outcome: Outcome | None = None
    """The last diagnosis."""

    def begin(self, own: Motion | None, train: Sequence[Recording] = (), heldout: Sequence[Recording] = ()) -> None:
        """Take recordings that are there; else run the scenario's own motion (or a tone) to fit, others for proof."""
        if train:
            self.recordings = {"train": [*train], "heldout": [*heldout]}
            return
        lasts = max(min(self.settings.seconds, own.seconds if own else self.settings.seconds), SHORTEST)
        room = self._room(lasts, False)
        if own and (left := self._would_leave(own, False)):
            raise InputError(f"The first motion, {own.title}, would leave a limit: {left}", culprit=left)
        motions = own or self._first(tone, room), self._first(multisine, room)
        needed = sum(motion.seconds for motion in motions)
        if self.settings.budget < needed - ROUNDING:
            text = f"--budget {self.settings.budget:g}s: the first two motions last {needed:g} s"
            text += f", {own.seconds:g} s of them {own.title}" if own else ""
            rule = "give more, or recordings to go on from"
            raise InputError(f"{text}; {rule}.", culprit="--budget", value=self.settings.budget)
        for role, motion in zip(ROLES, motions, strict=True):
            number = len(self.steps)
            known = self.log.moved(number)
            left = self.add(known, self.log.read(known), False) if known else self.run(motion, number, role)
            if left:
                raise InputError(self._refusal(motion, left, motion is own), culprit=left)

    def _first(self, family: Callable[[Room], Motion], room: Room) -> Motion:
        """The largest motion of a family that leaves no limit by what the card says (InputError: there is none)."""
        for share, way in SMALLER:
            motion = family(room.slower(share).nearer(way))
            left = self._would_leave(motion, True)
            if not left:
                return motion
        raise InputError(f"Even a small first motion, {motion.title}, would leave a limit: {left}", culprit=left)

    def _would_leave(self, motion: Motion, is_designed: bool) -> str:
        """The limit that a motion would leave, by itself or with the torque that the card says, and what allows it."""
        limits, dt = self.limits, min(0.002, motion.seconds / 64)
        q, v, a = motion.sampled(np.arange(0.0, motion.seconds, dt))
        q = q + self.machine.home
        torque = np.abs(torque_predicted(motion, self.machine.home, self.card.plant()))
        tones = "" if is_designed else limits.left_by_tones(v, a, dt)
        left = limits.left_by(q, v, a) or tones or limits.torque_left(torque)
        if not left:
            return ""
        most = {"speed": np.abs(v).max(), "acceleration": np.abs(a).max(), "torque": torque.max()}
        most |= {} if is_designed else {"frequency": frequency_of(v, a, dt)}
        allowing = limits.allowing(q, most)
        return f"{left}; --limits {allowing} would allow it." if allowing else f"{left}; give another set point."

    def _refusal(self, motion: Motion, left: str, is_own: bool) -> str:
        """Say that a first recording has left a limit, and of the scenario's own motion which option lets it run."""
        recording = [*self.recordings["train"], *self.recordings["heldout"]][-1]
        rule = f"--limits {self.limits.that_allow(recording)} would allow it" if is_own else "give other --limits"
        return f"The first recording has left a limit on {motion.title}: {left}; {rule}."

    def go_on(self) -> Story:
        """Round after round, until one answer is left or nothing more can be done."""
        while True:
            ended, open_ = self._round()
            if ended:
                break
        refused = tuple(f"{family}: {limit}" for family, limit in self.refused.items())
        return Story(
            tuple(self.steps), ended, tuple(_otherwise((*open_, *self.unmoved))), refused, self.limits.as_json()
        )

    def add(self, step: Moved, recording: Recording, is_new: bool) -> str:
        """Take in a recording; returns the limit that it left."""
        if is_new:
            step = replace(step, left=self.limits.left_in(recording))
            self.log.append(step)
        self.recordings[step.role].append(recording)
        self._report(step)
        return step.left

    def _round(self) -> tuple[End | None, Sequence[Question]]:
        """Diagnose, design, move; the end, if this was it, and the questions that are open then."""
        if any(isinstance(one, Moved) and one.left for one in self.steps):
            return "limit left", () if self.outcome else self._diagnosed(len(self.steps))
        number = len(self.steps)
        known = self.log.answered(number)
        if known and all(self.log.moved(number + k) for k in (1, 2)):
            self._report(known)
            return self._moved([None, None]), ()
        open_ = self._diagnosed(number)
        if not open_:
            return "answered", ()
        lasts = min(self.settings.seconds, (self.settings.budget - self._spent()) / 2)
        if lasts < SHORTEST:
            return "budget spent", open_
        chosen = self._designed(open_, lasts)
        if chosen:
            return self._moved(chosen), ()
        is_all = {one.kind for one in open_} == {"unconfirmed"}
        return ("answered", ()) if is_all else ("no motion tells", open_)

    def _diagnosed(self, number: int) -> Sequence[Question]:
        """Diagnose all recordings together; what is left open."""
        begun = perf_counter()
        self.outcome = find(self.recordings["train"], self.recordings["heldout"], self.card, self.on_progress)
        asked = self._movable(questions(self.outcome.diagnosis))
        known = self.log.answered(number)
        step = known or Answered.of(number, self.outcome.diagnosis, asked, perf_counter() - begun)
        if not known:
            self.log.append(step)
        self._report(step)
        return asked

    def _movable(self, asked: Sequence[Question]) -> Sequence[Question]:
        """Questions that some motion may decide; others, and those asked in vain, are kept to be told at the end."""
        assert self.outcome is not None
        if self._is_confirmed(self.outcome.diagnosis):
            asked = [one for one in asked if one.kind != "unconfirmed"]
        told = {text for one in self.steps if isinstance(one, Answered) for text in one.open}
        names = {n for one in asked if one.kind == "not testable" and one.statement not in told for n in one.effects}
        shown = self._shown(names) if names else set()
        self.unmoved = tuple(one for one in asked if one.kind == "not testable" and not set(one.effects) <= shown)
        return [one for one in asked if one not in self.unmoved]

    def _shown(self, names: set[str]) -> set[str]:
        """Of effects that no recording could show so far, those that some motion inside the limits shows."""
        assert self.outcome is not None
        problem = problem_of(self.recordings["train"], self.card)
        ours = problem.fit(self.outcome.card.plant(), 1)
        pieces = pieces_of(self._room(self.settings.seconds, False), ours, problem, self.limits, self.machine.home)
        return shown_by_motion(names, ours, pieces, ours.rms) if pieces else set()

    def _is_confirmed(self, found: Diagnosis) -> bool:
        """Whether an answer needs no further round: the same as before it, or the first and all that is missing.

        "Nothing" is never confirmed by rounds, but by new ground that is used up.
        """
        before = [one.verdict for one in self.steps if isinstance(one, Answered)]
        return bool(found.verdict) and (before[-1] == found.verdict if before else is_settled(found))

    def _designed(self, asked: Sequence[Question], lasts: float) -> list[Plan | None] | None:
        """The motion that tells most and the same from the other end; None where none tells anything."""
        assert self.outcome is not None
        self.on_progress("designing the next motion")
        rooms = [self._room(lasts, turned) for turned in (False, True)]
        problem = problem_of(self.recordings["train"], self.card)
        if self.settings.design == "random":
            return [Plan(multisine(room), (), 0.0) for room in rooms]
        pairs = duels(self.outcome, problem, asked)
        ours = pairs[0].ours if pairs else problem.fit(self.outcome.card.plant(), 1)
        untested = {name for one in asked if one.kind == "not testable" for name in one.effects}
        rated = plans(rooms[0], problem, ours, pairs, self.limits, self.machine.home, untested)
        self.refused |= {one.motion.family: one.limit for one in rated.refused}
        plan = self._best(rated, pairs)
        plan = plan and beside_random(plan, rated.plans)
        return [plan, self._turned(plan, rooms[1], problem, ours)] if plan else None

    def _best(self, rated: Rated, pairs: Sequence[Duel]) -> Plan | None:
        """The motion that tells most between structures; where none promises enough, new ground may tell more."""
        done = [one.family for one in self.steps if isinstance(one, Moved)]
        return (best(rated.plans, True) if pairs else None) or best(rated.plans, False, done)

    def _turned(self, plan: Plan, room: Room, problem: Problem, ours: Fit) -> Plan:
        """The same family from the other end; the same motion where that would leave a limit."""
        family = next(one for one in FAMILIES if one(room).family == plan.motion.family)
        motion, _, limit = allowed(family, room, ours, problem.prepared, self.limits, self.machine.home)
        return plan if limit else replace(plan, motion=motion)

    def _moved(self, chosen: Sequence[Plan | None]) -> End | None:
        for role, plan in zip(ROLES, chosen, strict=True):
            number = len(self.steps)
            known = self.log.moved(number)
            if known:
                left = self.add(known, self.log.read(known), False)
            else:
                assert plan is not None
                left = self.run(plan.motion, number, role, plan)
            if left:
                break
        return None

    def run(self, motion: Motion, number: int, role: Literal["train", "heldout"], plan: Plan | None = None) -> str:
        """Run a motion, of a plan or the first ones, and keep its recording; the limit that it left.

        Raises:
            InputError: it would pass the budget.
        """
        if self._spent() + motion.seconds > self.settings.budget + ROUNDING:
            text = f"{motion.title} of {motion.seconds:g} s would pass the budget of {self.settings.budget:g} s."
            raise InputError(text[0].upper() + text[1:], culprit="--budget", value=self.settings.budget)
        path = self.log.path(number, motion.family)
        self.on_progress(f"moving: {motion.title}")
        recording = self.machine.record(motion, number, path)
        file = path.relative_to(self.log.folder).as_posix()
        step = Moved(number, file, role, motion.family, motion.title, motion.seconds)
        return self.add(_promised(step, plan) if plan else step, recording, True)

    def _room(self, lasts: float, turned: bool) -> Room:
        seed = self.settings.seed + 1000 * len(self.steps) + turned
        return room_of(self.limits, self.machine.home, lasts, seed, turned)

    def _spent(self) -> float:
        return sum(one.seconds for one in self.steps if isinstance(one, Moved))

    def _report(self, step: Moved | Answered) -> None:
        self.steps.append(step)
        self.on_step(step)


def _promised(step: Moved, plan: Plan) -> Moved:
    """The step with what its motion promised, and tones at random in its place."""
    nats, ground = plan.at_random or (None, None)
    return replace(step, nats=plan.worth, ground=plan.ground, random_nats=nats, random_ground=ground)


def _otherwise(asked: Sequence[Question]) -> list[str]:
    """What else than a motion would tell what is open, a sentence each."""
    found = [f"{one.statement}: {one.otherwise}." for one in asked if one.otherwise]
    for one in asked:
        told = {CATALOGUE[name][0].told_apart_by for name in one.effects if one.kind == "set" and name in CATALOGUE}
        ways = {CATALOGUE[name][0].to_record for name in one.effects if one.kind == "set" and name in CATALOGUE}
        found += [f"{one.statement}: {' / '.join(sorted(ways))}; {' / '.join(sorted(told))}."] if told else []
    return found


__all__ = ["Investigation", "Settings"]
