"""What one mount needs beyond another, as a model to stand in front of a plant that cannot be changed.

    tau_out = (applied(tau) - resisting') J / J' + resisting,      resisting = tau_f(v, q) + loads(t, q, v)

with the better mount's numbers primed. A plant that does J q'' = tau_out - resisting then does what the better one
does, J' q'' = applied(tau) - resisting'. Position and speed come from the plant: they are a step of the master old.
Effects of other places (couplings, sensor, clocks, an inertia that varies) cannot be had by a torque: see `left_out`.
"""

from dataclasses import replace
from typing import Any

import casadi as ca

from pyfmi_models.effects.base import Effect, Motion, MotionEffect
from pyfmi_models.model import Model, Scalar, Variable, symbols_of
from pyfmi_models.mount import Mount


def left_out(better: Mount) -> tuple[str, ...]:
    """Effects of a mount that no correction of the torque can give."""
    return tuple(effect.id for effect in better.effects if not effect.is_torque)


def correction(plant: Mount, better: Mount) -> Model:
    """Write the correction from one mount to a better one as a continuous model.

    Inputs: the command tau, q and v of the plant, and what effects of either mount read. Output: `corrected`, the
    torque for the plant. Parameters and states are called `before.*` and `after.*`.
    """
    kept = replace(better, effects=tuple(one for one in better.effects if one.is_torque))
    before, after = _Side("before", plant), _Side("after", kept)
    read = replace(better, effects=(*plant.effects, *kept.effects)).inputs()
    inputs = tuple(kept.in_axis_units(one) for one in (*_INPUTS, *read))
    t, u = ca.SX.sym("t"), ca.SX.sym("u", len(inputs))
    motion = kept.at(t, u[1], u[2], {one.name: u[len(_INPUTS) + k] for k, one in enumerate(read)})
    inertia, resisting, _, rates = before.needed(motion, u[0])
    better_inertia, better_resisting, applied, better_rates = after.needed(motion, u[0])
    torque = (applied - better_resisting) * inertia / better_inertia + resisting
    point = [t, ca.vertcat(before.x, after.x), u, ca.vertcat(before.p, after.p)]
    following = ca.vertcat(rates, better_rates)
    return Model(
        name=f"{plant.name}_correction",
        description=f"{plant.name}: torque that makes a plant do what a better model of it does",
        inputs=inputs,
        parameters=(*before.parameters, *after.parameters),
        states=(*before.states, *after.states),
        outputs=(replace(inputs[0], name="corrected", description="Torque for the plant, drives"),),
        equations=ca.Function("equations", point, [following, torque], ["t", "x", "u", "p"], ["next", "y"]),
    )


_INPUTS = (
    Variable(name="tau", unit="N.m", description="Commanded torque, drives"),
    Variable(name="q", unit="rad", description="Position of the plant"),
    Variable(name="v", unit="rad/s", description="Speed of the plant", nominal=0.01),
)


class _Side:
    """One of the two mounts in symbols: what it needs at a motion that the plant tells."""

    def __init__(self, name: str, mount: Mount) -> None:
        owners: dict[str, Scalar] = {"friction": mount.law, **dict(mount.of_kind(Effect))}
        listed = {owner: [_of(mount, name, owner, one) for one in part.states()] for owner, part in owners.items()}
        self.states = tuple(state for states in listed.values() for state in states)
        self.parameters = tuple(replace(one, name=f"{name}.{one.name}") for one in mount.parameters())
        self.own = {owner: ca.SX.sym(owner, len(states)) for owner, states in listed.items()}
        self.x = ca.vertcat(*self.own.values())
        self.p, symbols = symbols_of(self.parameters)
        self._mount = mount
        self._symbols = {full.removeprefix(f"{name}."): symbol for full, symbol in symbols.items()}

    def needed(self, motion: Motion, command: Scalar) -> tuple[Scalar, Scalar, Scalar, Any]:
        """Return inertia, resisting torque, the torque applied under a command, and the rates of all states."""
        this, own = self._mount.with_symbols(self._symbols, motion.v), self.own
        applied, rates = this.applied(command, own, motion)
        viscous, loads = this.viscous(motion, own), this.loads(motion, own)
        level = this.level(this.driven(motion, applied - loads - viscous, own), own)
        resisting = this.law.contact(own["friction"], motion.v, level) + viscous
        rates |= {name: one.rate(motion._replace(state=own[name])) for name, one in this.of_kind(MotionEffect)}
        rates |= {"friction": this.law.rate(own["friction"], motion.v, level)}
        return this.axis.inertia, resisting + loads, applied, ca.vertcat(*(rates[n] for n in own))


def _of(mount: Mount, side: str, owner: str, state: Variable) -> Variable:
    return mount.in_axis_units(replace(state, name=f"{side}.{owner}.{state.name}"))
