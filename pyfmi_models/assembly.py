"""The parts of an axis: what acts on it, place by place.

    J q'' = applied(tau) - tau_f(v, bristle, q) - loads(t, q, v) - disturbance

`tau` is the commanded torque, limited to +-torque_limit; drive effects make `applied` of it; friction effects change
contact, level and viscous torque of the friction law; load effects resist beside it; couplings split the inertia, a
transmission in front of the axis, others behind it; sensor effects make the reading of the position. `plant.py` puts
the equations together, `mount.py` is the whole.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import pi
from typing import Any, ClassVar, Literal, Self, TypeVar

import casadi as ca

from pyfmi_models.effects.base import (
    NOTHING,
    Balance,
    ClockEffect,
    Coupling,
    DriveEffect,
    Effect,
    FrictionEffect,
    InertiaEffect,
    LoadEffect,
    Motion,
    MotionEffect,
    PayloadEffect,
    SensorEffect,
    Transmission,
)
from pyfmi_models.friction import FrictionLaw
from pyfmi_models.model import Model, Part, Scalar, Variable, parameter, parameters_of, with_symbols

MotionKind = Literal["rotary", "linear"]
LINEAR_UNITS = {
    "N.m": "N",
    "rad": "m",
    "rad/s": "m/s",
    "rad/s2": "m/s2",
    "kg.m2": "kg",
    "N.m/rad": "N/m",
    "N.m.s/rad": "N.s/m",
    "N.m.s2/rad2": "N.s2/m2",
    "1/rad2": "1/m2",
    "K/rad": "K/m",
    "% per rad rubbed": "% per m rubbed",
}
Kind = TypeVar("Kind", bound=Effect)
Seen = TypeVar("Seen", bound=MotionEffect)


@dataclass(frozen=True, kw_only=True)
class Axis(Part):
    """Inertia and torque limit of the axis: Newton's law.

        J q'' = applied(tau) - tau_f - loads - disturbance,   |tau| <= torque_limit

    The disturbance and all loads resist: positive ones slow a positive speed down.
    """

    place: ClassVar[str] = "Mechanics"
    inertia: Scalar = parameter("kg.m2", "Moment of inertia", low=1e-9)
    torque_limit: Scalar = parameter("N.m", "Largest torque of the drive, either way", default=1e6, low=0, fitted=False)


@dataclass(frozen=True, kw_only=True)
class Assembly:
    """One axis: its inertia, one friction law and any effects, in the order in which they act.

    Methods that take `states` want the states of each effect by the prefix of its parameters; effects that are not in
    it are at their start.
    """

    name: str
    axis: Axis
    friction: FrictionLaw
    effects: tuple[Effect, ...] = ()
    motion: MotionKind = "rotary"

    def components(self) -> dict[str, Scalar]:
        """Return the parts that carry parameters, by the prefix of their names; a repeated effect counts up."""
        parts: dict[str, Scalar] = {"axis": self.axis, "friction": self.friction}
        counts: dict[str, int] = {}
        for effect in self.effects:
            count = counts[effect.id] = counts.get(effect.id, 0) + 1
            parts[effect.id + (str(count) if count > 1 else "")] = effect
        return parts

    def parameters(self) -> tuple[Variable, ...]:
        """List all parameters, named `prefix.name`, with their present values."""
        found = [v for prefix, part in self.components().items() for v in parameters_of(part, prefix)]
        return tuple(self.in_axis_units(variable) for variable in found)

    def inputs(self) -> tuple[Variable, ...]:
        """List the inputs that effects read, each once."""
        return tuple({one.name: one for read in self._read.values() for one in read.values()}.values())

    def recorded_as(self) -> dict[str, str]:
        """Inputs that a recording holds under another name, by their own."""
        known = ((self._read[name], effect.recorded_as()) for name, effect in self.of_kind(Effect))
        return {read[own].name: column for read, columns in known for own, column in columns.items()}

    @cached_property
    def _read(self) -> dict[str, dict[str, Variable]]:
        """Inputs by the names that each effect has for them, by its prefix; those of a further source count up."""
        sources: dict[str, list[str]] = {}
        for effect in self.effects:
            known = sources.setdefault(effect.id, [])
            known += [effect.source] if effect.source not in known else []
        return {
            name: {one.name: _numbered(one, effect.source, sources[effect.id]) for one in effect.inputs()}
            for name, effect in self.of_kind(Effect)
        }

    def in_axis_units(self, variable: Variable) -> Variable:
        """Turn rotary units into those of a linear axis where that is what this is; phases and bandwidths stay."""
        if self.motion == "rotary" or variable.name.endswith(("phase", "bandwidth")):
            return variable
        return replace(variable, unit=LINEAR_UNITS.get(variable.unit, variable.unit))

    def model_in_axis_units(self, model: Model) -> Model:
        """Turn the units of a model written for a rotary axis."""
        inputs, parameters, states, outputs = (
            tuple(map(self.in_axis_units, group))
            for group in (model.inputs, model.parameters, model.states, model.outputs)
        )
        return replace(model, inputs=inputs, parameters=parameters, states=states, outputs=outputs)

    def with_symbols(self, symbols: dict[str, Scalar], v: Scalar) -> Self:
        """Return this mount with symbols in place of its numbers; pairs follow the direction of v."""
        parts = {name: with_symbols(part, symbols, v, name) for name, part in self.components().items()}
        axis, friction, *effects = parts.values()
        return replace(self, axis=axis, friction=friction, effects=tuple(effects))

    def of_kind(self, kind: type[Kind]) -> Iterator[tuple[str, Kind]]:
        """Yield the effects that act in one place, in order, with their prefixes."""
        return ((name, part) for name, part in self.components().items() if isinstance(part, kind))

    def trailing(self) -> Iterator[tuple[str, Coupling]]:
        """Yield the couplings behind the axis, in order, with their prefixes: all that are no transmission."""
        return ((name, one) for name, one in self.of_kind(Coupling) if not isinstance(one, Transmission))

    def at(self, t: Scalar, q: Scalar, v: Scalar, inputs: Mapping[str, Scalar] = NOTHING) -> Motion:
        """Describe the motion; a linear axis turns its angle once per metre; inputs not given are at their start."""
        starts = {variable.name: variable.start for variable in self.inputs()}
        return Motion(t, q, v, q if self.motion == "rotary" else 2 * pi * q, {**starts, **inputs})

    def seeing(
        self, kind: type[Seen], motion: Motion, states: Mapping[str, Any] = NOTHING
    ) -> Iterator[tuple[Seen, Motion]]:
        """Yield the effects of a kind, each with the motion as it sees it: its own states beside."""
        for name, effect in self.of_kind(kind):
            start = [variable.start for variable in effect.states()]
            own = {known: motion.inputs[one.name] for known, one in self._read[name].items() if one.name != known}
            yield effect, motion._replace(state=states.get(name, start), inputs={**motion.inputs, **own})

    def applied(self, command: Scalar, states: Mapping[str, Any], motion: Motion) -> tuple[Scalar, dict[str, Scalar]]:
        """Torque path: limit, then the drive effects in series. Return the applied torque and the rates of states."""
        rates, torque = {}, ca.fmax(-self.axis.torque_limit, ca.fmin(self.axis.torque_limit, command))
        for name, effect in self.of_kind(DriveEffect):
            drive = effect.given(motion)
            rates[name] = drive.rate(states[name], torque)
            torque = drive.applied(states[name], torque)
        return torque, rates

    @property
    def law(self) -> FrictionLaw:
        """The friction law after effects that replace its contact."""
        law = self.friction
        for _, effect in self.of_kind(FrictionEffect):
            law = effect.law(law)
        return law

    def level(self, motion: Motion, states: Mapping[str, Any] = NOTHING) -> Scalar:
        """Friction level [N m] after all friction effects; never below zero."""
        level, motion = self.law.level(motion.v), motion._replace(payload=self.payload(motion, states))
        for effect, seen in self.seeing(FrictionEffect, motion, states):
            level = effect.level(level, seen)
        return level

    def driven(self, motion: Motion, push: Scalar, states: Mapping[str, Any] = NOTHING) -> Motion:
        """The motion under a torque [N m] that is left for friction's contact and inertia, where a level feels it.

        The contact is taken to slide: so what accelerates the axis follows from the balance, without a loop.
        """
        return self._balanced(motion, push, ca.sign(motion.v), states)

    def accelerated(self, motion: Motion, inertial: Scalar, states: Mapping[str, Any] = NOTHING) -> Motion:
        """The same of a recorded motion, which needs a torque [N m] for its inertia."""
        return self._balanced(motion, inertial, 0.0, states)

    def _balanced(self, motion: Motion, push: Scalar, taken: Scalar, states: Mapping[str, Any]) -> Motion:
        if not any(effect.feels_inertia for _, effect in self.of_kind(FrictionEffect)):
            return motion
        others = self.viscous(motion, states) + self.loads(motion, states) - self.payload(motion, states)
        return motion._replace(balance=Balance(push, taken, others))

    def viscous(self, motion: Motion, states: Mapping[str, Any] = NOTHING) -> Scalar:
        """Viscous torque [N m] after all friction effects."""
        viscous = self.law.viscous(motion.v)
        for effect, seen in self.seeing(FrictionEffect, motion, states):
            viscous = effect.viscous(viscous, seen)
        return viscous

    def loads(self, motion: Motion, states: Mapping[str, Any] = NOTHING) -> Scalar:
        """Sum of the load effects [N m], resisting."""
        return sum((e.load(seen) for e, seen in self.seeing(LoadEffect, motion, states)), start=0 * motion.q)

    def payload(self, motion: Motion, states: Mapping[str, Any] = NOTHING) -> Scalar:
        """Torque of the weights on the axis [N m]."""
        return sum((e.load(seen) for e, seen in self.seeing(PayloadEffect, motion, states)), start=0 * motion.q)

    def inertia(self, inertia: Scalar, motion: Motion, states: Mapping[str, Any] = NOTHING) -> Scalar:
        """Inertia of the near side after the effects that change it with position [kg m2]."""
        for effect, seen in self.seeing(InertiaEffect, motion, states):
            inertia = effect.inertia(inertia, seen)
        return inertia

    def followed(self) -> dict[str, str]:
        """Inputs that the inertia follows, each with the input that is its rate."""
        return {name: rate for _, effect in self.of_kind(InertiaEffect) for name, rate in effect.followed().items()}

    def reading(self, motion: Motion, states: Mapping[str, Any] = NOTHING) -> Scalar:
        """Sensor path: what the encoder reads [rad or m]."""
        reading = motion.q
        for effect, seen in self.seeing(SensorEffect, motion, states):
            reading = effect.reading(reading, seen)
        return reading

    def ahead(self, motion: Motion, states: Mapping[str, Any] = NOTHING) -> Scalar:
        """Seconds by which a recording's readings run ahead of its torques."""
        return sum((e.ahead(seen) for e, seen in self.seeing(ClockEffect, motion, states)), start=0 * motion.t)


def _numbered(one: Variable, source: str, sources: Sequence[str]) -> Variable:
    """An input of one of several sources; of the first it has its own name."""
    if len(sources) == 1:
        return one
    number, of = sources.index(source) + 1, f", `{source}`" if source else ""
    return replace(one, name=one.name + (str(number) if number > 1 else ""), description=one.description + of)
