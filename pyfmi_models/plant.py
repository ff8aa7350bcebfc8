"""The plant: a mount as a continuous `Model`, from torque path over mechanics to sensor path.

Bodies stand in a row: the axis, on which friction, loads and encoder act, and behind each coupling one more. The drive
acts on the axis too, or where there are transmissions on the first of the motors in front of it. All positions but that
of the axis are kept as twists, which start at zero wherever the axis starts.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import casadi as ca

from pyfmi_models.assembly import Assembly
from pyfmi_models.effects.base import ClockEffect, Effect, Motion, MotionEffect, SensorEffect, Transmission
from pyfmi_models.friction.base import FrictionLaw
from pyfmi_models.model import Chapter, Model, Scalar, Variable, chapter_of, symbols_of

States = dict[str, tuple[Variable, ...]]
Body = tuple[Scalar, Scalar]
"""Inertia and the torque on it."""


def plant(mount: Assembly) -> Model:
    """Write a mount as a model; `q_true`, `q_load`, `q_motor`, `q_recorded` are outputs where they differ from `q`."""
    point, following, shown = written(mount)
    results = [following, ca.vertcat(*shown.values())]
    return Model(
        name=f"{mount.name}_plant",
        description=f"{mount.name}: one axis with {_parts(mount)}",
        inputs=_inputs(mount),
        parameters=mount.parameters(),
        states=tuple(variable for part in _states(mount).values() for variable in part),
        outputs=tuple(mount.in_axis_units(_OUTPUTS[name]) for name in shown),
        equations=ca.Function("equations", point, results, ["t", "x", "u", "p"], ["next", "y"]),
        chapters=_chapters(mount),
    )


def _parts(mount: Assembly) -> str:
    """What an axis has, in words: its friction, then its effects."""
    friction = "no" if mount.friction.key == "none" else mount.friction.key
    return ", ".join([f"{friction} friction", *dict.fromkeys(_effect_label(one, mount) for one in mount.effects)])


def _effect_label(effect: Effect, mount: Assembly) -> str:
    """Name an effect, and the range that it was learned in."""
    return f"{effect.id.replace('_', ' ')} {effect.learned_in(mount.motion == 'linear')}".rstrip()


_PLACES = {"Torque path": "", "Mechanics": "", "Friction": "Mechanics", "Loads": "Mechanics", "Sensor path": ""}
"""Where parts act, in the order in which torque becomes a reading, each with the place that it works onto."""


def _chapters(mount: Assembly) -> tuple[Chapter, ...]:
    found = [chapter_of(part, prefix, part.place, _PLACES[part.place]) for prefix, part in mount.components().items()]
    return tuple(sorted(found, key=lambda chapter: list(_PLACES).index(chapter.place)))


def written(mount: Assembly) -> tuple[list[Any], Any, dict[str, Scalar]]:
    """Write the equations: the symbols t, x, u, p, the rates of all states, and the outputs by name."""
    states, inputs = _states(mount), _inputs(mount)
    t, x, u = ca.SX.sym("t"), ca.SX.sym("x", sum(map(len, states.values()))), ca.SX.sym("u", len(inputs))
    p, symbols = symbols_of(mount.parameters())
    given = {variable.name: u[k] for k, variable in enumerate(inputs)}
    own = _shared_out(x, states)
    q, v = own["axis"][0], own["axis"][1]

    this = mount.with_symbols(symbols, v)
    motion = this.at(t, q, v, given)
    applied, rates = this.applied(given["tau"], own, motion)
    motors, inertia, push = _motors(this, applied, own)
    viscous, push = this.viscous(motion, own), push - given["disturbance"] - this.loads(motion, own)
    level = this.level(this.driven(motion, push - viscous, own), own)
    friction = this.law.contact(own["friction"], v, level) + viscous
    push = push - friction
    acceleration, twisting = _accelerations(this, motion, [*motors, *_behind(this, motion, inertia, push, own)], own)

    rates |= {name: effect.rate(motion._replace(state=own[name])) for name, effect in this.of_kind(MotionEffect)}
    rates |= {"axis": ca.vertcat(v, acceleration), "friction": this.law.rate(own["friction"], v, level), **twisting}
    shown = {"q": this.reading(motion, own), "v": v, "friction": friction, "applied": applied}
    shown |= _further(this, motion, acceleration, own)
    return [t, x, u, p], ca.vertcat(*(rates[name] for name in states)), shown


def _accelerations(
    this: Assembly, motion: Motion, bodies: list[Body], own: Mapping[str, Any]
) -> tuple[Scalar, dict[str, Scalar]]:
    """Newton for each body in the row: acceleration of the axis, and the rates of the couplings' states."""
    names = [name for name, _ in (*this.of_kind(Transmission), *this.trailing())]
    axis = sum(1 for _ in this.of_kind(Transmission))
    inertia, push = bodies[axis]
    near = this.inertia(inertia, motion, own)
    bodies[axis] = (near, push - _change(this, near, motion) * motion.v)
    found = [torque / inertia for inertia, torque in bodies]
    rates = {name: [own[name][1], found[k] - found[k + 1]] for k, name in enumerate(names)}
    speed = motion.v
    for name, coupling in this.trailing():
        speed = speed - own[name][1]
        rates[name] += coupling.further_rates(speed, own[name])
    return found[axis], {name: ca.vertcat(*rate) for name, rate in rates.items()}


def _motors(this: Assembly, push: Scalar, own: Mapping[str, Any]) -> tuple[list[Body], Scalar, Scalar]:
    """Bodies in front of the axis, each with inertia and torque; the inertia left for the axis, the torque on it."""
    inertia, bodies = this.axis.inertia, []
    for name, coupling in this.of_kind(Transmission):
        far = inertia * coupling.share()
        passed = coupling.torque(own[name][0], own[name][1], far)
        bodies.append((inertia - far, push - passed))
        inertia, push = far, passed
    return bodies, inertia, push


def _behind(this: Assembly, motion: Motion, inertia: Scalar, push: Scalar, own: Mapping[str, Any]) -> list[Body]:
    """The axis and the bodies behind it, each with inertia and torque."""
    speed, bodies = motion.v, []
    for name, coupling in this.trailing():
        twist, rate = own[name][0], own[name][1]
        far = inertia * coupling.share()
        passed = coupling.torque(twist, rate, far)
        bodies.append((inertia - far, push - passed))
        speed = speed - rate
        inertia, push = far, passed - coupling.drag(speed, own[name])
    return [*bodies, (inertia, push)]


def _change(this: Assembly, inertia: Scalar, motion: Motion) -> Scalar:
    """Lagrange: half the rate of the inertia along the axis' own motion, all of it along what else moves [kg m2/s]."""
    given = motion.inputs
    foreign = (ca.jacobian(inertia, given[name]) * given[rate] for name, rate in this.followed().items())
    return ca.jacobian(inertia, motion.q) * motion.v / 2 + sum(foreign)


def _further(this: Assembly, motion: Motion, acceleration: Scalar, own: Mapping[str, Any]) -> dict[str, Scalar]:
    """Positions that are not the reading, where effects part them."""
    found = {}
    if any(this.of_kind(SensorEffect)):
        found["q_true"] = motion.q
    if any(this.trailing()):
        found["q_load"] = motion.q - sum(own[name][0] for name, _ in this.trailing())
    if any(this.of_kind(Transmission)):
        found["q_motor"] = motion.q + sum(own[name][0] for name, _ in this.of_kind(Transmission))
    if any(this.of_kind(ClockEffect)):
        ahead = this.ahead(motion, own)
        later = motion.q + ahead * motion.v + ahead**2 / 2 * acceleration
        found["q_recorded"] = this.reading(this.at(motion.t, later, motion.v, motion.inputs), own)
    return found


def _states(mount: Assembly) -> States:
    """States by owner: the axis, the friction law, then the effects in their order."""
    axis = (
        Variable(name="position", unit="rad", description="Position of the axis"),
        Variable(name="speed", unit="rad/s", description="Speed of the axis", nominal=0.01),
    )
    owners: dict[str, FrictionLaw | Effect] = {"friction": mount.law, **dict(mount.of_kind(Effect))}
    named = {name: tuple(replace(s, name=f"{name}.{s.name}") for s in part.states()) for name, part in owners.items()}
    found = {"axis": axis, **named}
    return {name: tuple(mount.in_axis_units(state) for state in states) for name, states in found.items()}


def _inputs(mount: Assembly) -> tuple[Variable, ...]:
    tau = Variable(name="tau", unit="N.m", description="Commanded torque, drives")
    disturbance = Variable(name="disturbance", unit="N.m", description="External torque, resists")
    return tuple(mount.in_axis_units(variable) for variable in (tau, disturbance, *mount.inputs()))


_OUTPUTS = {
    variable.name: variable
    for variable in (
        Variable(name="q", unit="rad", description="Position"),
        Variable(name="v", unit="rad/s", description="Speed"),
        Variable(name="friction", unit="N.m", description="Friction torque, resists"),
        Variable(name="applied", unit="N.m", description="Torque applied to the axis by the drive"),
        Variable(name="q_true", unit="rad", description="Position of the axis, without the errors of the encoder"),
        Variable(name="q_load", unit="rad", description="Position of the far side of the drive"),
        Variable(name="q_motor", unit="rad", description="Position of the motor, in front of the drive's spring"),
        Variable(name="q_recorded", unit="rad", description="Reading as recorded beside this moment's torque"),
    )
}


def _shared_out(x: Any, states: States) -> dict[str, Scalar]:
    """Parts of the column of all states, by owner."""
    ends, parts = 0, {}
    for name, variables in states.items():
        parts[name] = x[ends : ends + len(variables)]
        ends += len(variables)
    return parts
