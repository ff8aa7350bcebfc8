"""The plant: torque path -> mechanics -> encoder.

    J q'' = applied(tau) - tau_f(v, bristle, q) - loads(t, q, v) - disturbance

`tau` is the commanded torque, limited to +-torque_limit; drive effects make `applied` of it; friction effects change
level and viscous torque of the friction law; load effects resist beside it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import pi
from typing import Any, Literal

import casadi as ca

from pyfmi_models.effects import DriveEffect, Effect, FrictionEffect, LoadEffect, Motion
from pyfmi_models.friction import FrictionLaw
from pyfmi_models.model import Model, Scalar, Variable, parameter, parameters_of, symbols_of, with_symbols

MotionKind = Literal["rotary", "linear"]
LINEAR_UNITS = {
    "N.m": "N",
    "rad": "m",
    "rad/s": "m/s",
    "rad/s2": "m/s2",
    "kg.m2": "kg",
    "N.m/rad": "N/m",
    "N.m.s/rad": "N.s/m",
}


@dataclass(frozen=True, kw_only=True)
class Axis:
    """Inertia and torque limit of the axis."""

    inertia: Scalar = parameter("kg.m2", "Moment of inertia", low=1e-9)
    torque_limit: Scalar = parameter("N.m", "Largest torque of the drive, either way", default=1e6, low=0)


@dataclass(frozen=True, kw_only=True)
class Mount:
    """One axis: its inertia, one friction law and any effects, in the order in which they act."""

    name: str
    axis: Axis
    friction: FrictionLaw
    effects: tuple[Effect, ...] = ()
    motion: MotionKind = "rotary"

    def components(self) -> dict[str, Any]:
        """Return the parts that carry parameters, by the prefix of their names; a repeated effect counts up."""
        parts: dict[str, Any] = {"axis": self.axis, "friction": self.friction}
        for effect in self.effects:
            count = sum(name.rstrip("0123456789") == effect.id for name in parts)
            parts[effect.id + (str(count + 1) if count else "")] = effect
        return parts

    def parameters(self) -> tuple[Variable, ...]:
        """List all parameters, named `prefix.name`, with their present values."""
        found = [v for prefix, part in self.components().items() for v in parameters_of(part, prefix)]
        return tuple(self.in_axis_units(variable) for variable in found)

    def in_axis_units(self, variable: Variable) -> Variable:
        """Turn rotary units into those of a linear axis where that is what this is; phases stay angles."""
        if self.motion == "rotary" or variable.name.endswith("phase"):
            return variable
        return replace(variable, unit=LINEAR_UNITS.get(variable.unit, variable.unit))

    def with_symbols(self, symbols: dict[str, Any], v: Scalar) -> "Mount":
        """Return this mount with symbols in place of its numbers; pairs follow the direction of v."""
        parts = {name: with_symbols(part, symbols, v, name) for name, part in self.components().items()}
        axis, friction, *effects = parts.values()
        return replace(self, axis=axis, friction=friction, effects=tuple(effects))

    def at(self, t: Scalar, q: Scalar, v: Scalar) -> Motion:
        """Describe the motion; a linear axis turns its angle once per metre."""
        return Motion(t, q, v, q if self.motion == "rotary" else 2 * pi * q)

    def level(self, motion: Motion) -> Scalar:
        """Friction level [N m] after all friction effects; never below zero."""
        level = self.friction.level(motion.v)
        for effect in self.of_kind(FrictionEffect):
            level = effect.level(level, motion)
        return level

    def viscous(self, motion: Motion) -> Scalar:
        """Viscous torque [N m] after all friction effects."""
        viscous = self.friction.viscous(motion.v)
        for effect in self.of_kind(FrictionEffect):
            viscous = effect.viscous(viscous, motion)
        return viscous

    def loads(self, motion: Motion) -> Scalar:
        """Sum of the load effects [N m], resisting."""
        return sum((effect.load(motion) for effect in self.of_kind(LoadEffect)), start=0 * motion.q)

    def of_kind(self, kind: type[Any]) -> Sequence[Any]:
        """Return the effects that act in one place, in order."""
        return [effect for effect in self.effects if isinstance(effect, kind)]

    def model(self) -> Model:
        """Write the plant as a `Model`: input tau, outputs q and v (and the torques), continuous."""
        return _plant(self)


def _states(mount: Mount) -> list[Variable]:
    axis = [
        Variable(name="position", unit="rad", description="Position of the axis"),
        Variable(name="speed", unit="rad/s", description="Speed of the axis", nominal=0.01),
    ]
    friction = [replace(s, name=f"friction.{s.name}") for s in mount.friction.states()]
    named = [(name, part) for name, part in mount.components().items() if isinstance(part, DriveEffect)]
    drive = [replace(s, name=f"{name}.{s.name}") for name, part in named for s in part.states()]
    return [mount.in_axis_units(state) for state in (*axis, *friction, *drive)]


def _inputs(mount: Mount) -> list[Variable]:
    tau = Variable(name="tau", unit="N.m", description="Commanded torque, drives")
    disturbance = Variable(name="disturbance", unit="N.m", description="External torque, resists")
    return [mount.in_axis_units(variable) for variable in (tau, disturbance)]


def _outputs(mount: Mount) -> list[Variable]:
    found = [
        Variable(name="q", unit="rad", description="Position"),
        Variable(name="v", unit="rad/s", description="Speed"),
        Variable(name="friction", unit="N.m", description="Friction torque, resists"),
        Variable(name="applied", unit="N.m", description="Torque applied to the axis by the drive"),
    ]
    return [mount.in_axis_units(variable) for variable in found]


def _drive(mount: Mount, command: Scalar, take: Callable[[int], Any]) -> tuple[Scalar, list[Any]]:
    """Send the command through the drive effects; `take(n)` hands out the next n states."""
    rates = []
    for effect in mount.of_kind(DriveEffect):
        state = take(len(effect.states()))
        rates.append(effect.rate(state, command))
        command = effect.applied(state, command)
    return command, rates


def _plant(mount: Mount) -> Model:
    states, inputs, parameters = _states(mount), _inputs(mount), mount.parameters()
    t, x, u = ca.SX.sym("t"), ca.SX.sym("x", len(states)), ca.SX.sym("u", len(inputs))
    p, symbols = symbols_of(parameters)
    q, v = x[0], x[1]
    this = mount.with_symbols(symbols, v)
    motion, bristle = this.at(t, q, v), x[2 : 2 + len(mount.friction.states())]
    rest = iter(range(2 + bristle.numel(), len(states)))
    limit = this.axis.torque_limit
    command = ca.fmax(-limit, ca.fmin(limit, u[0]))
    applied, drive_rates = _drive(this, command, lambda n: x[[next(rest) for _ in range(n)]])
    level = this.level(motion)
    friction = this.friction.contact(bristle, v, level) + this.viscous(motion)
    acceleration = (applied - friction - this.loads(motion) - u[1]) / this.axis.inertia
    rates = ca.vertcat(v, acceleration, this.friction.rate(bristle, v, level), *drive_rates)
    outputs = ca.vertcat(q, v, friction, applied)
    return Model(
        name=f"{mount.name}_plant",
        description=f"{mount.name}: one axis with {mount.friction.key} friction",
        inputs=tuple(inputs),
        parameters=parameters,
        states=tuple(states),
        outputs=tuple(_outputs(mount)),
        equations=ca.Function("equations", [t, x, u, p], [rates, outputs], ["t", "x", "u", "p"], ["next", "y"]),
    )
