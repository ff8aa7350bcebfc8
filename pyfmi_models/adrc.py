"""The controller: extended state observer, PD law and friction compensation, as a sampled model.

    tau  = J (a_d + kp e + kd e') + w,      e = q_d - q,  e' = v_d - zeta2
    w    = tau_f_hat - J zeta3
    zeta = observer of (q, v, residual acceleration), fed with q and with the torque that really acted

Equations (7), (11) and (13) of the paper; zeta3 J is the *negative* residual torque. One tick of delay is part of the
design: the command computed at tick k acts from tick k+1, so over the interval that ends at tick k the command of
tick k-2 acted, and the observer is fed that one. References: Han, IEEE Trans. Ind. Electron. 56 (2009) 900; discrete
observer gains: Miklosovic, Radke, Gao, American Control Conference 2006, 3665.
"""

from dataclasses import dataclass, replace
from inspect import cleandoc
from typing import Any, Literal

import casadi as ca

from pyfmi_models.friction import FrictionLaw, LuGre
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

Source = Literal["observer", "reference"]


@dataclass(frozen=True, kw_only=True)
class Gains:
    """What a person tunes: gains of position and speed, bandwidth of the observer, and the inertia believed in.

        tau = J (a_d + kp e + kd e') - J zeta3 + tau_f,   e = q_d - q,   e' = v_d - zeta2,   |tau| <= torque_limit

    zeta2 is the observed speed, zeta3 the observed residual acceleration, tau_f the expected friction torque. The
    command computed at a tick acts from the next tick on; the observer is fed the command that really acted.
    Reference: Han, IEEE Trans. Ind. Electron. 56 (2009) 900.
    """

    inertia: Scalar = parameter("kg.m2", "Moment of inertia the controller believes in", low=1e-9)
    kp: Scalar = parameter("1/s2", "Position gain", low=0, nominal=100)
    kd: Scalar = parameter("1/s", "Speed gain", low=0, nominal=10)
    observer_bandwidth: Scalar = parameter("rad/s", "Observer bandwidth", low=1e-3, nominal=100)
    torque_limit: Scalar = parameter("N.m", "Largest command, either way", default=1e6, low=0)


@dataclass(frozen=True, kw_only=True)
class Compensation:
    """A friction model inside the controller, driven by the observed or by the reference speed."""

    law: FrictionLaw
    source: Source

    def advance(self, state: Any, before: Scalar, now: Scalar, period: Scalar) -> tuple[Any, Scalar]:
        """Friction state after one period and friction torque now; the speed went from `before` to `now`."""
        middle = (before + now) / 2
        state = self.law.advance(state, middle, self.law.level(middle), period)
        return state, self.law.contact(state, now, self.law.level(now)) + self.law.viscous(now)


def compensation_case(case: str, law: LuGre) -> Compensation | None:
    """Return the paper's case: C1 none; C2 observed, C3 reference speed; a dynamic (LuGre), b its static map."""
    table: dict[str, Compensation | None] = {
        "C1": None,
        "C2a": Compensation(law=law, source="observer"),
        "C2b": Compensation(law=law.steady(), source="observer"),
        "C3a": Compensation(law=law, source="reference"),
        "C3b": Compensation(law=law.steady(), source="reference"),
    }
    return table[case]


@dataclass(frozen=True, kw_only=True)
class Adrc:
    """Active disturbance rejection control of one axis, sampled every `period` seconds."""

    name: str
    gains: Gains
    period: float
    compensation: Compensation | None = None

    def model(self) -> Model:
        """Write the controller as a sampled `Model`: inputs q, q_d, v_d, a_d; output tau and the observer."""
        return _controller(self)


INPUTS = (
    Variable(name="q", unit="rad", description="Measured position"),
    Variable(name="q_d", unit="rad", description="Desired position"),
    Variable(name="v_d", unit="rad/s", description="Desired speed"),
    Variable(name="a_d", unit="rad/s2", description="Desired acceleration"),
)
MEMORY = (
    Variable(name="started", unit="1", description="0 before the first tick"),
    Variable(name="observer.q", unit="rad", description="zeta1, observed position"),
    Variable(name="observer.v", unit="rad/s", description="zeta2, observed speed"),
    Variable(name="observer.a", unit="rad/s2", description="zeta3, observed residual acceleration"),
    Variable(name="command.last", unit="N.m", description="Command of the last tick, acting from this tick on"),
    Variable(name="command.acted", unit="N.m", description="Command that acted before the last tick's"),
    Variable(name="compensation.last", unit="N.m", description="Friction estimate of the last tick"),
    Variable(name="compensation.speed", unit="rad/s", description="Speed the friction model saw at the last tick"),
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


def _observe(zeta: list[Any], push: Scalar, q: Scalar, bandwidth: Scalar, period: float) -> list[Any]:
    """One step of the extended state observer: exact prediction under constant `push`, then correction.

        zeta1 += h zeta2 + h^2/2 (zeta3 + push),      zeta2 += h (zeta3 + push)                    prediction
        zeta1 += (1 - b^3) r,   zeta2 += 3/2 (1 - b)^2 (1 + b)/h r,   zeta3 += (1 - b)^3/h^2 r     correction

    h is the period, r = q - zeta1 the surprise, b = exp(-bandwidth h) the place of all three poles; `push` [rad/s2] is
    the torque that acted less the expected friction, over the inertia. At the first tick zeta1 starts at q.
    Reference: Miklosovic, Radke, Gao, American Control Conference 2006, 3665.
    """
    h = period
    position, speed, residual = zeta
    position, speed = position + h * speed + h * h / 2 * (residual + push), speed + h * (residual + push)
    pole = ca.exp(-bandwidth * h)
    surprise = q - position
    return [
        position + (1 - pole**3) * surprise,
        speed + 1.5 * (1 - pole) ** 2 * (1 + pole) / h * surprise,
        residual + (1 - pole) ** 3 / h**2 * surprise,
    ]


def _compensate(law: Compensation | None, state: Any, before: Scalar, speeds: dict[str, Any], h: float) -> Any:
    if law is None:
        return state, ca.SX(0), ca.SX(0)
    speed = speeds[law.source]
    state, torque = law.advance(state, before, speed, h)
    return state, torque, speed


def _controller(adrc: Adrc) -> Model:
    law = adrc.compensation.law if adrc.compensation else None
    extra = tuple(replace(s, name=f"compensation.{s.name}") for s in law.states()) if law else ()
    states = (*MEMORY, *extra)
    parameters = (*parameters_of(adrc.gains), *(parameters_of(law, "compensation") if law else ()))
    t, x, u = ca.SX.sym("t"), ca.SX.sym("x", len(states)), ca.SX.sym("u", len(INPUTS))
    p, symbols = symbols_of(parameters)
    following, outputs = _tick(adrc, x, u, symbols)
    return Model(
        name=f"{adrc.name}_controller",
        description=f"{adrc.name}: active disturbance rejection controller, sampled",
        inputs=INPUTS,
        parameters=parameters,
        states=states,
        outputs=OUTPUTS,
        equations=ca.Function("equations", [t, x, u, p], [following, outputs], ["t", "x", "u", "p"], ["next", "y"]),
        period=adrc.period,
        chapters=_chapters(adrc),
    )


def _chapters(adrc: Adrc) -> tuple[Chapter, ...]:
    about = cleandoc(_observe.__doc__ or "")
    observer = Chapter(
        prefix="observer", name="Observer", title="Position, speed, residual", text=about, place="Observer"
    )
    law = chapter_of(adrc.gains, "", "Control law", title="Feed-forward, PD, rejection")
    used = adrc.compensation
    if used is None:
        return observer, law
    place = f"Friction from the {'observed' if used.source == 'observer' else 'desired'} speed"
    return observer, law, chapter_of(used.law, "compensation", place, law.place)


def _tick(adrc: Adrc, x: Any, u: Any, symbols: dict[str, Any]) -> tuple[Any, Any]:
    q, q_d, v_d, a_d = ca.vertsplit(u)
    started, z1, z2, z3, last, acted, friction_last, speed_last, *rest = ca.vertsplit(x)
    gains, h = with_symbols(adrc.gains, symbols, z2), adrc.period
    push = (acted - friction_last) / gains.inertia
    seen = _observe([z1, z2, z3], push, q, gains.observer_bandwidth, h)
    # Bumpless start: before the first tick the observer knows nothing, so it starts at the measured position.
    z1, z2, z3 = (ca.if_else(started > 0, now, first) for now, first in zip(seen, (q, 0, 0), strict=True))
    used = adrc.compensation
    if used is not None:
        direction = z2 if used.source == "observer" else v_d
        used = replace(used, law=with_symbols(used.law, symbols, direction, "compensation"))
    bristle, friction, speed = _compensate(used, ca.vertcat(*rest), speed_last, {"observer": z2, "reference": v_d}, h)
    wanted = gains.inertia * (a_d + gains.kp * (q_d - q) + gains.kd * (v_d - z2)) + friction - gains.inertia * z3
    tau = ca.fmax(-gains.torque_limit, ca.fmin(gains.torque_limit, wanted))
    following = ca.vertcat(1, z1, z2, z3, tau, last, friction, speed, bristle)
    return following, ca.vertcat(tau, friction, z1, z2, z3)
