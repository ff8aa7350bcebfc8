"""A torque step that friction holds: bristle stiffness and damping from a move before break-away.

Two ways, side by side:

    linear   J q'' + (sigma1 + sigma2) q' + sigma0 q = tau      equation (16) of the paper; valid far below break-away
    direct   the LuGre plant itself, simulated, with the break-away level free

The first drops -sigma0 |v| z / g(v): the nearer the step comes to break-away, the softer and the more damped it makes
the bristles.
"""

from dataclasses import dataclass, replace
from math import ceil

import casadi as ca
import numpy as np

from cosim.data.own_rate import at_own_rate
from cosim.data.recording import Recording
from cosim.estimation.identify.estimate import Array, Estimate
from cosim.estimation.identify.machine import Machine
from cosim.estimation.identify.output_error import fit_outputs, output_model
from cosim.support.errors import InputError
from pyfmi_models.card import Card
from pyfmi_models.friction import LuGre
from pyfmi_models.model import Model, Pair, Variable, fields_of

FLAT = 1.0
"""Stribeck speed of a card that has none [rad/s]: far above presliding, so that Fs alone is the level there."""

QUIET = 1e-3
"""The torque has come when it exceeds this share of its greatest."""


@dataclass(frozen=True)
class Presliding:
    """Both estimates of one recording, and the largest torque in it [N m]."""

    linear: Estimate
    direct: Estimate
    torque: float


def presliding(card: Card, recording: Recording) -> Presliding:
    """Identify from one torque step from rest; the card gives the inertia and the sliding friction, and starts.

    Raises:
        InputError: the card's friction is not LuGre, or the recording does not start at rest.
    """
    if not isinstance(card.friction, LuGre):
        rule = f'needs [friction] model = "lugre"; it is "{card.friction.key}"'
        raise InputError(f"{card.path}: a presliding step {rule}.")
    step = _from_zero(recording)
    fits = [fit_outputs(machine, [step])[0] for machine in machines(card, step).values()]
    return Presliding(fits[0], fits[1], float(np.abs(step["tau"]).max()))


def machines(card: Card, step: Recording) -> dict[str, Machine]:
    """The two models of a step: linear and direct."""
    card = _one_sided(card, float(np.mean(step["tau"])))
    tick = step.sample_time / (2 * ceil(step.sample_time / 2e-4))
    direct = ("friction.sigma0", "friction.sigma1", "friction.Fs")
    return {
        "linear": Machine(linear_model(card), None, ("sigma0", "sigma1"), tick),
        "direct": Machine(card.plant().model(), None, direct, tick),
    }


def simulated(card: Card, recording: Recording, found: Presliding) -> dict[str, Array]:
    """Position after the step by each model with its estimate, at the rows of the recording but the last."""
    step = _from_zero(recording)
    new, rows = at_own_rate(step), {}
    for name, machine in machines(card, step).items():
        measured = new["q"][: len(new) - 1]
        rest = output_model(machine, [step])(getattr(found, name).values).residual[:, 0]
        position = measured[: len(rest)] - rest[: len(measured)]
        rows[name] = np.interp(step.t[:-1], new.t[: len(position)], position)
    return rows


def _from_zero(recording: Recording) -> Recording:
    """The recording with its position counted from that before the torque came, noise averaged out."""
    tau = np.abs(recording["tau"])
    before = max(1, int(np.argmax(tau > QUIET * tau.max())))
    return replace(recording, table={**recording.table, "q": recording["q"] - recording["q"][:before].mean()})


def _one_sided(card: Card, torque: float) -> Card:
    """The card with the numbers of the direction that the torque points to; no Stribeck term becomes a level one."""
    law = card.friction
    side = "positive" if torque >= 0 else "negative"
    numbers = {
        name: getattr(value, side) if isinstance(value := getattr(law, name), Pair) else value
        for name in fields_of(law)
    }
    numbers.setdefault("Fs", numbers["Fc"])
    numbers.setdefault("Vs", FLAT)
    return replace(card, friction=type(law)(**numbers))


def linear_model(card: Card) -> Model:
    """Equation (16) as a plant."""
    law = card.friction
    numbers = {"J": card.mount.inertia, "sigma0": law.sigma0, "sigma1": law.sigma1, "sigma2": law.sigma2}  # type: ignore[attr-defined]
    units = {"J": "kg.m2", "sigma0": "N.m/rad", "sigma1": "N.m.s/rad", "sigma2": "N.m.s/rad"}
    t, x, u, p = (ca.SX.sym(name, size) for name, size in (("t", 1), ("x", 2), ("u", 1), ("p", 4)))
    rates = ca.vertcat(x[1], (u - (p[2] + p[3]) * x[1] - p[1] * x[0]) / p[0])
    variables = {
        name: Variable(name=name, unit=unit, description=name, start=numbers[name]) for name, unit in units.items()
    }
    return Model(
        name="presliding",
        description="Spring and damper: presliding, linearised",
        inputs=(Variable(name="tau", unit="N.m", description="Torque"),),
        parameters=tuple(variables.values()),
        states=tuple(Variable(name=n, unit=u_, description=n) for n, u_ in (("position", "rad"), ("speed", "rad/s"))),
        outputs=(Variable(name="q", unit="rad", description="Position"),),
        equations=ca.Function("equations", [t, x, u, p], [rates, x[0]]),
    )
