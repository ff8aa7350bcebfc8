"""The plant's own equations, turned round: from a reading and its derivatives to the torque of that moment.

Expressions are compiled once for a structure; its numbers are parameters.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from cosim.estimation.prepare import Array, Piece
from cosim.estimation.rowwise import Rowwise, Stepwise, Tape, recurrence
from cosim.estimation.tape_cache import stored
from cosim.estimation.tonal_disturbance import without_tones
from pyfmi_models.effects import DriveEffect, MotionEffect, SensorEffect
from pyfmi_models.effects.base import Motion
from pyfmi_models.effects.presliding import LEAST_LEVEL
from pyfmi_models.model import Scalar, structure_of, symbols_of
from pyfmi_models.mount import Mount

READING = ("t", "q", "v", "a")
NEWTON = 3
LEAST_SLOPE = 1e-2
"""A drive that gives less than this share of what more is asked for is undone as if it gave this share."""


class Slopes(NamedTuple):
    """Derivatives of a state, (live, rows + 1), by those free parameters that change it at all."""

    live: list[int]
    values: Array


class _Affine(NamedTuple):
    """A step that is linear in its own state, and its derivatives by these: the states before, the free parameters."""

    rows: Rowwise
    by: list[int]


class Equations:
    """Expressions of a mount in which the parameters `free` may vary; `key` tells their structure from others."""

    def __init__(self, mount: Mount, free: tuple[str, ...], key: tuple[Any, ...]) -> None:
        self._mount, self._free, self._key = mount, free, key
        inputs, recorded = mount.inputs(), mount.recorded_as()
        self._inputs = tuple(variable.name for variable in inputs)
        self._starts = tuple((recorded.get(one.name, one.name), float(one.start)) for one in inputs)
        owners = [(name, part.states()) for name, part in mount.of_kind(MotionEffect) if part.states()]
        self._owners = [*owners, ("friction", mount.law.states())]
        self.count = sum(len(states) for _, states in self._owners)

    def given(self, piece: Piece) -> tuple[Array, tuple[Array, ...]]:
        """What each row gives, and each step: time, reading, its derivatives, and the inputs of effects."""
        return piece.given(self._starts)

    @cached_property
    def _symbols(self) -> dict[str, Scalar]:
        p, symbols = symbols_of(self._mount.parameters())
        found: dict[str, Scalar] = {name: ca.SX.sym(name) for name in (*READING, "dt", *self._inputs)}
        found |= {"p": p, "state": ca.SX.sym("state", self.count), "symbols": symbols}
        found["end"] = ca.SX.sym("end", len(READING) + len(self._inputs))
        return found | {"free": ca.vertcat(*[symbols[name] for name in self._free])}

    @cached_property
    def _column(self) -> Any:
        return ca.vertcat(*(self._symbols[name] for name in (*READING, *self._inputs)))

    @cached_property
    def _known(self) -> tuple[Any, ...]:
        """Mount with symbols, motion, states by owner; in terms of the true motion.

        Tonal disturbances are left out: the time of a recording does not tell their phase (`tonal_disturbance.py`).
        """
        s = self._symbols
        this = without_tones(self._mount.with_symbols(s["symbols"], s["v"]))
        motion = this.at(s["t"], s["q"], s["v"], {name: s[name] for name in self._inputs})
        own, first = {}, 0
        for name, states in self._owners:
            own[name] = s["state"][first : first + len(states)]
            first += len(states)
        return this, this.accelerated(motion, self._inertial(this, motion, own), own), own

    def _inertial(self, this: Mount, motion: Motion, own: Mapping[str, Any]) -> Any:
        """What accelerates the axis, by the near side's inertia [N m]."""
        near = this.inertia(this.axis.inertia, motion, own)
        return near * self._symbols["a"] + ca.jacobian(near, motion.q) * motion.v**2 / 2

    def _true(self, expression: Any) -> Any:
        """Put the true motion in: position, speed and acceleration behind the reading's."""
        if not any(self._mount.of_kind(SensorEffect)):
            return expression
        s, (this, motion, own) = self._symbols, self._known
        reading = s["q"]
        error = ca.Function("error", [s["q"], s["t"], s["p"]], [this.reading(motion, own) - s["q"]])
        q = reading - error(reading - error(reading, s["t"], s["p"]), s["t"], s["p"])
        slope = ca.jacobian(q, reading)
        speed, acceleration = slope * s["v"], slope * s["a"] + ca.jacobian(slope, reading) * s["v"] ** 2
        return ca.substitute(expression, ca.vertcat(s["q"], s["v"], s["a"]), ca.vertcat(q, speed, acceleration))

    @cached_property
    def torque(self) -> Rowwise:
        """Torque and its derivatives by free parameters, from the columns, the states and all their `Slopes`."""
        return self._rowwise("torque", self._torque)

    def _rowwise(self, name: str, make: Callable[[], Tape]) -> Rowwise:
        ((tape, _),) = self._stored(name, lambda: [(make(), [])])
        return Rowwise(tape)

    def _stored(self, name: str, make: Callable[[], list[tuple[Tape, list[int]]]]) -> list[tuple[Tape, list[int]]]:
        return stored((self._key, name), [type(part) for part in self._mount.components().values()], make)

    def _torque(self) -> Tape:
        s, (this, motion, own) = self._symbols, self._known
        level, torque = this.level(motion, own), self._inertial(this, motion, own)
        torque += this.law.contact(own["friction"], motion.v, level) + this.viscous(motion, own)
        torque = self._true(_command(this, torque + this.loads(motion, own), motion))
        by_state, by_free = ca.jacobian(torque, s["state"]), ca.jacobian(torque, s["free"])
        slopes = ca.SX.sym("slopes", sum(map(len, self._live)))
        through, first = ca.SX(self.count, len(self._free)), 0
        for k, live in enumerate(self._live):
            if live:
                through[k, live] = slopes[first : first + len(live)]
            first += len(live)
        rows = ca.vertcat(torque, (by_free + by_state @ through).T)
        return Tape.of(ca.vertcat(self._column, s["state"], slopes), s["p"], rows)

    @cached_property
    def _live(self) -> list[list[int]]:
        """Free parameters that change each state at all."""
        if not self._affine:
            return [list(range(len(self._free)))] * self.count
        live = list[list[int]]()
        for k, one in enumerate(self._affine):
            own = ([j - k] if j >= k else live[j] for j in one.by)
            live.append(sorted(set().union(*own)))
        return live

    @cached_property
    def _following(self) -> Any:
        s, (this, motion, own) = self._symbols, self._known
        remembering = [(own[name], part) for name, part in this.of_kind(MotionEffect) if name in own]
        parts = [_advanced(part, motion._replace(state=state), s["dt"]) for state, part in remembering]
        effects = self._true(ca.vertcat(ca.SX(0, 1), *parts))
        if not this.law.states():
            return effects
        # Rows lie so far apart that the level changes in a step. Where sliding leaves the state behind it, sigma1
        # times the speed magnifies what it lacks.
        law, bristles, speed = this.law, own["friction"], self._true(motion.v)
        middle, end = self._levels(effects)
        bent = ca.fabs(ca.sum1(law.rate(ca.DM.zeros(bristles.numel()), speed, middle))) * s["dt"]
        late = _late(bent / ca.fmax(middle, LEAST_LEVEL))
        return ca.vertcat(effects, law.advance(bristles, speed, middle + (end - middle) * late, s["dt"]))

    def _levels(self, effects: Any) -> tuple[Any, Any]:
        """Friction level in the middle of a step, and at its end, where the effects have these states."""
        s, (this, motion, own) = self._symbols, self._known
        level = self._true(this.level(motion, own))
        later = ca.vertcat(self._column, s["state"]), ca.vertcat(s["end"], effects, own["friction"])
        return level, ca.substitute(level, *later)

    @cached_property
    def _step_column(self) -> Any:
        """Columns in the middle of a step and at its end, and dt."""
        return ca.vertcat(self._column, self._symbols["end"], self._symbols["dt"])

    def states(self, steps: Sequence[Array], full: Array) -> tuple[Array, list[Slopes]]:
        """States along the rows from zero on, (states, rows + 1), and the derivatives of each by the free parameters.

        Effects go by their rates, friction by the law's closed form. A step that is linear in its own state is a
        recurrence, solved for all rows at once; others are walked. `steps` are the columns of each step.
        """
        return self._at_once(steps, full) if self._affine else self._walked(steps, full)

    def _at_once(self, steps: Sequence[Array], full: Array) -> tuple[Array, list[Slopes]]:
        states, slopes = np.zeros((self.count, len(steps[0]) + 1)), list[Slopes]()
        for k, one in enumerate(self._affine):
            out = one.rows([*steps, *states[:, :-1]], full)
            states[k] = recurrence(out[0], out[1:2])[0]
            change, added = out[2:].reshape(2, len(one.by), len(steps[0]))
            change *= states[k, :-1]
            change += added
            if all(j >= k for j in one.by):
                slopes.append(Slopes(self._live[k], recurrence(out[0], change)))
            else:
                slopes.append(_carried(out[0], {j - k: row for j, row in zip(one.by, change, strict=True)}, slopes))
        return states, slopes

    @cached_property
    def _affine(self) -> list["_Affine"]:
        """For each state what its step keeps of it, what it adds, and how both change; [] where one is not linear."""
        return [_Affine(Rowwise(tape), by) for tape, by in self._stored("affine", self._affine_tapes)]

    def _affine_tapes(self) -> list[tuple[Tape, list[int]]]:
        state = self._symbols["state"]
        kept = [ca.jacobian(self._following[k], state[k]) for k in range(self.count)]
        if any(ca.depends_on(one, state[k]) for k, one in enumerate(kept)):
            return []
        added = [ca.substitute(self._following[k], state[k], 0.0) for k in range(self.count)]
        return [self._changing(k, *both) for k, both in enumerate(zip(kept, added, strict=True))]

    def _changing(self, k: int, kept: Any, added: Any) -> tuple[Tape, list[int]]:
        """Both parts of a step, and their derivatives by those states before and free parameters that change them."""
        s = self._symbols
        by = ca.vertcat(ca.SX(0, 1), *(s["state"][j] for j in range(k)), s["free"])
        slopes = [ca.jacobian(one, by) for one in (kept, added)]
        own = [j for j in range(by.numel()) if any(one[j].nnz() for one in slopes)]
        rows = ca.vertcat(kept, added, *(one[j] for one in slopes for j in own))
        return Tape.of(ca.vertcat(self._step_column, s["state"]), s["p"], rows), own

    def _walked(self, steps: Sequence[Array], full: Array) -> tuple[Array, list[Slopes]]:
        """A state's step may depend on itself and on those before it, so their derivatives are carried one by one."""
        states, rows = self._step(np.vstack(steps), full), len(steps[0])
        out = self._step_slopes([*steps, *states[:, :-1]], full)
        between = out[: self.count**2].reshape(self.count, self.count, rows)
        by_free = out[self.count**2 :].reshape(self.count, len(self._free), rows)
        slopes = list[Slopes]()
        for k in range(self.count):
            by = {j - k: between[k, j] for j in range(k)} | dict(enumerate(by_free[k]))
            slopes.append(_carried(between[k, k], by, slopes))
        return states, slopes

    @cached_property
    def _step(self) -> Stepwise:
        s = self._symbols
        return Stepwise(s["state"], self._step_column, s["p"], self._following)

    @cached_property
    def _step_slopes(self) -> Rowwise:
        """Derivatives of each state's step by all states and by the free parameters, from columns, dt and states."""
        return self._rowwise("step slopes", self._step_slopes_tape)

    def _step_slopes_tape(self) -> Tape:
        s = self._symbols
        by_state = ca.vec(ca.jacobian(self._following, s["state"]).T)
        by_free = ca.vec(ca.jacobian(self._following, s["free"]).T)
        return Tape.of(ca.vertcat(self._step_column, s["state"]), s["p"], ca.vertcat(by_state, by_free))

    def motion(self, piece: Piece, full: Array) -> tuple[Array, Array]:
        """True speed and acceleration at all rows of a piece."""
        if not any(self._mount.of_kind(SensorEffect)):
            return piece.v, piece.a
        v, a = self._motion(self.given(piece)[0], full)
        return v, a

    @cached_property
    def _motion(self) -> Rowwise:
        s = self._symbols
        return self._rowwise("motion", lambda: Tape.of(self._column, s["p"], self._true(ca.vertcat(s["v"], s["a"]))))


def _carried(kept: Array, change: Mapping[int, Array], before: Sequence[Slopes]) -> Slopes:
    """Derivatives of a state by free parameters, of which a step keeps a part and adds a change.

    The change is by the free parameters, from 0 on, and by the states before, from -1 down to the first.
    """
    through = [(row, before[j]) for j, row in change.items() if j < 0]
    live = sorted({j for j in change if j >= 0}.union(*(one.live for _, one in through)))
    drift = np.zeros((len(live), len(kept)))
    for row, one in through:
        drift[np.searchsorted(live, one.live)] += row * one.values[:, :-1]
    for j, row in change.items():
        if j >= 0:
            drift[live.index(j)] += row
    return Slopes(live, recurrence(kept, drift))


def _command(this: Mount, needed: Any, motion: Motion) -> Any:
    """Command [N m] for which drives that follow at once give what is needed: Newton's method, from what is needed.

    Past a knee the first step is exact where the drive is linear again; the others serve the bend.
    """
    for _, drive in reversed([(name, one) for name, one in this.of_kind(DriveEffect) if not one.states()]):
        command = ca.SX.sym("command")
        rest = drive.given(motion).applied((), command) - needed
        slope = ca.fmax(ca.jacobian(rest, command), LEAST_SLOPE)
        step = ca.Function("step", [command], [command - rest / slope], {"allow_free": True})
        target = needed
        for _ in range(NEWTON):
            target = step(target)
        needed = target
    return needed


def _advanced(effect: MotionEffect, motion: Any, dt: Any) -> Any:
    """States of an effect after dt at constant motion, for a rate that is linear in each state: exact."""
    rate = effect.rate(motion)
    pull = ca.diag(ca.jacobian(rate, motion.state))
    drive, x = ca.substitute(rate, motion.state, ca.DM.zeros(motion.state.numel())), pull * dt
    growth = ca.if_else(ca.fabs(x) < 1e-6, 1 + x / 2, (ca.exp(x) - 1) / (x + 1e-300))
    return ca.exp(x) * motion.state + dt * drive * growth


def _late(x: Any) -> Any:
    """Where between the middle (0) and the end (1) of a step lies the level that counts, if it is reached x times.

    A state that follows a level, z' = (level - z) x/dt, while that goes straight from g - d to g + d, ends where it
    does under the constant level g + w d, w = coth(x/2) - 2/x.
    """
    safe = ca.fmax(x, 1e-2)
    return ca.if_else(x < safe, x / 6, 1 / ca.tanh(safe / 2) - 2 / safe)


MOST_KNOWN = 512
"""Structures that are kept, the last ones: one diagnosis tries some hundred."""
_KNOWN: dict[tuple[Any, ...], Equations] = {}
"""Equations by structure: building them costs more than evaluating them."""


def equations_of(mount: Mount, names: tuple[str, ...], free: tuple[str, ...]) -> Equations:
    """Return the equations of a structure, built once."""
    parts = [(type(part), *structure_of(part).values()) for part in mount.components().values()]
    key = (mount.motion, names, free, *parts)
    found = _KNOWN.pop(key, None) or Equations(mount, free, key)
    _KNOWN[key] = found
    if len(_KNOWN) > MOST_KNOWN:
        del _KNOWN[next(iter(_KNOWN))]
    return found
