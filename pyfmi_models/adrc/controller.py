"""The controller: extended state observer, PD law and torque estimates, as a sampled model.

    tau  = J (a_d + kp e + kd e') + w,      e = q_d - q,  e' = v_d - speed
    w    = tau_f_hat - J zeta3
    zeta = observer of (q, v, residual acceleration), fed with q and with the torque that really acted

Equations (7), (11) and (13) of the paper; zeta3 J is the *negative* residual torque. One tick of delay is part of the
design: the command computed at tick k acts from tick k+1, so over the interval that ends at tick k the command of
tick k-2 acted, and the observer is fed that one. Reference: Han, IEEE Trans. Ind. Electron. 56 (2009) 900.
"""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from pyfmi_models.adrc.estimate import Estimate, Seen, cut, within
from pyfmi_models.adrc.observer import Observer
from pyfmi_models.adrc.velocity import Velocity
from pyfmi_models.model import (
    Chapter,
    Model,
    Scalar,
    Variable,
    chapter_of,
    parameter,
    parameters_of,
    symbols_of,
    with_symbols,
)


@dataclass(frozen=True, kw_only=True)
class Gains:
    """What a person tunes: gains of position and speed, bandwidth of the observer, and the inertia believed in.

        tau = J (a_d + kp e + kd e') - J zeta3 + tau_f,   e = q_d - q,   e' = v_d - speed,   |tau| <= torque_limit

    `speed` is the observed speed zeta2 where no other source is named, zeta3 the observed residual acceleration, tau_f
    the expected torque. The command computed at a tick acts from the next tick on; the observer is fed the command that
    really acted. Reference: Han, IEEE Trans. Ind. Electron. 56 (2009) 900.
    """

    inertia: Scalar = parameter("kg.m2", "Moment of inertia the controller believes in", low=1e-9)
    kp: Scalar = parameter("1/s2", "Position gain", low=0, nominal=100)
    kd: Scalar = parameter("1/s", "Speed gain", low=0, nominal=10)
    observer_bandwidth: Scalar = parameter("rad/s", "Observer bandwidth", low=1e-3, nominal=100)
    torque_limit: Scalar = parameter("N.m", "Largest command, either way", default=1e6, low=0)


@dataclass(frozen=True, kw_only=True)
class Adrc:
    """Active disturbance rejection control of one axis, sampled every `period` seconds."""

    name: str
    gains: Gains
    period: float
    observer: Observer = field(default_factory=Observer)
    velocity: Velocity = field(default_factory=Velocity)
    estimates: tuple[Estimate, ...] = ()

    def states(self) -> tuple[tuple[Variable, ...], ...]:
        """List the states part by part: memory, observer, velocity, each estimate."""
        return (MEMORY, self.observer.states(), self.velocity.states(), *(one.states() for one in self.estimates))

    def parameters(self) -> tuple[Variable, ...]:
        """List the tunable numbers; estimates by the same law share them."""
        found = (*parameters_of(self.gains), *(v for one in self.estimates for v in one.parameters()))
        return tuple({variable.name: variable for variable in found}.values())

    def model(self) -> Model:
        """Write the controller as a sampled `Model`: inputs q, q_d, v_d, a_d; output tau and the observer."""
        states, parameters = [state for part in self.states() for state in part], self.parameters()
        t, x, u = ca.SX.sym("t"), ca.SX.sym("x", len(states)), ca.SX.sym("u", len(INPUTS))
        p, symbols = symbols_of(parameters)
        following, outputs = _tick(self, x, u, symbols)
        return Model(
            name=f"{self.name}_controller",
            description=f"{self.name}: active disturbance rejection controller, sampled",
            inputs=INPUTS,
            parameters=parameters,
            states=tuple(states),
            outputs=OUTPUTS,
            equations=ca.Function("equations", [t, x, u, p], [following, outputs], ["t", "x", "u", "p"], ["next", "y"]),
            period=self.period,
            chapters=self._chapters(),
        )

    def _chapters(self) -> tuple[Chapter, ...]:
        observer = chapter_of(self.observer, "observer", "Observer", title="Position, speed, residual")
        law = chapter_of(self.gains, "", "Control law", title="Feed-forward, PD, rejection")
        speed = chapter_of(self.velocity, "velocity", "Speed", law.place)
        own = [speed] if self.velocity.states() else []
        return (observer, law, *own, *(one.chapter(law.place) for one in self.estimates))


INPUTS = (
    Variable(name="q", unit="rad", description="Measured position"),
    Variable(name="q_d", unit="rad", description="Desired position"),
    Variable(name="v_d", unit="rad/s", description="Desired speed"),
    Variable(name="a_d", unit="rad/s2", description="Desired acceleration"),
)
MEMORY = (
    Variable(name="started", unit="1", description="0 before the first tick"),
    Variable(name="command.last", unit="N.m", description="Command of the last tick, acting from this tick on"),
    Variable(name="command.acted", unit="N.m", description="Command that acted before the last tick's"),
    Variable(name="compensation.last", unit="N.m", description="Torque expected at the last tick"),
)
OUTPUTS = (
    Variable(name="tau", unit="N.m", description="Commanded torque"),
    Variable(name="friction_estimate", unit="N.m", description="Friction torque the controller expects"),
    Variable(name="zeta1", unit="rad", description="Observed position"),
    Variable(name="zeta2", unit="rad/s", description="Observed speed"),
    Variable(
        name="zeta3", unit="rad/s2", description="Observed residual acceleration; -J zeta3 is the residual torque"
    ),
)


def _tick(adrc: Adrc, x: Any, u: Any, symbols: dict[str, Scalar]) -> tuple[Any, Any]:
    q, q_d, v_d, a_d = ca.vertsplit(u)
    memory, zeta, noted, *notes = cut(ca.vertsplit(x), *map(len, adrc.states()))
    started, last, acted, expected = memory
    gains, h = with_symbols(adrc.gains, symbols, v_d), adrc.period
    seen = adrc.observer.update(zeta, (acted - expected) / gains.inertia, q, gains.observer_bandwidth, h)
    # Bumpless start: before the first tick the observer knows nothing, so it starts at the measured position.
    rest = [q, *[0] * (len(zeta) - 1)]
    zeta = [ca.if_else(started > 0, now, first) for now, first in zip(seen, rest, strict=True)]
    noted, speed = adrc.velocity.measure(noted, q, zeta[1], h)
    speed = ca.if_else(started > 0, speed, zeta[1])
    notes, friction = _estimate(adrc, symbols, notes, Seen(zeta[1], v_d, -gains.inertia * zeta[2]))
    wanted = gains.inertia * (a_d + gains.kp * (q_d - q) + gains.kd * (v_d - speed)) + friction
    tau = within(gains.torque_limit, wanted - gains.inertia * zeta[2])
    following = [1, tau, last, friction, *zeta, *noted, *(one for part in notes for one in part)]
    return ca.vertcat(*following), ca.vertcat(tau, friction, *zeta[:3])


def _estimate(adrc: Adrc, symbols: dict[str, Scalar], states: list[Any], seen: Seen) -> tuple[list[Any], Scalar]:
    """Advance all estimates; return their states and the sum of their torques."""
    parts = zip(adrc.estimates, states, strict=True)
    done = [one.advance(symbols, state, seen, adrc.period) for one, state in parts]
    return [state for state, _ in done], sum((torque for _, torque in done), start=ca.SX(0))
