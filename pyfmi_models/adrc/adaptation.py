"""On-line identification inside the controller: friction level, bristle stiffness and bias, tick by tick."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from pyfmi_models.adrc.compensation import PREFIX as LAW
from pyfmi_models.adrc.compensation import Source
from pyfmi_models.adrc.estimate import Estimate, Seen, cut, within
from pyfmi_models.friction import LuGre
from pyfmi_models.model import (
    Chapter,
    Pair,
    Scalar,
    Variable,
    chapter_of,
    parameter,
    parameters_of,
    with_symbols,
)

PREFIX = "adaptation"
POLES = 3
"""Poles of the observer between a torque and its residual; the regressors pass as many."""
CHANCE_TIME = 0.3
"""Time within which a residual by chance forgets itself [s]: ticks nearer than this are one observation."""
UPPER = tuple((i, j) for i in range(3) for j in range(i, 3))
"""Entries of the covariance that are kept: it is symmetric."""


@dataclass(frozen=True, kw_only=True)
class Adaptation(Estimate):
    """LuGre friction whose level, stiffness and bias are estimated while it compensates.

        torque = F(v; level Fc, level Fs, stiffness sigma0) + bias
        theta  = (level, stiffness, bias) += P phi / s residual,    s = R + phi' P phi,    where |v| > slowest
        P      = (P - P phi phi' P / s) (1 + period / memory),    no larger than at the start

    phi holds the derivatives of the torque by theta, from the sensitivity of the bristle equation, behind as many poles
    at the observer's bandwidth as the residual -J zeta3. R = noise^2 2 x 0.3 s / period. Recursive least squares with
    forgetting. It is frozen near rest, does not forget what nothing excites, and theta is bounded: factors by `widest`
    each way, the bias by the break-away torque. Reference: Astrom, Wittenmark, Adaptive Control, 2nd edition, 1995,
    chapters 2 and 11.
    """

    law: LuGre
    source: Source = "reference"
    doubt: float = 0.3
    memory: Scalar = parameter("s", "Time over which the past is forgotten", default=20.0, low=0.1, nominal=10)
    slowest: Scalar = parameter("rad/s", "Speed below which nothing is learned", default=2e-5, low=0, nominal=1e-5)
    widest: Scalar = parameter("1", "Largest factor between estimate and model", default=3.0, low=1)
    noise: Scalar = parameter("N.m", "RMS of the residual that is chance", default=0.5, low=1e-6)

    def parameters(self) -> tuple[Variable, ...]:
        """The law's parameters and those of the estimation."""
        return (*parameters_of(self.law, LAW), *parameters_of(self, PREFIX))

    def states(self) -> tuple[Variable, ...]:
        """The estimates, bristles and last speed, sensitivities, filters, covariance."""
        found = [
            Variable(name="level", unit="1", description="Estimated friction level over the model's", start=1.0),
            Variable(name="stiffness", unit="1", description="Estimated bristle stiffness over the model's", start=1.0),
            Variable(name="bias", unit="N.m", description="Estimated torque that does not depend on the speed"),
            Variable(name="bristle", unit="N.m", description="Bristle torque sigma0 z"),
            Variable(name="speed", unit="rad/s", description="Speed the friction model saw at the last tick"),
            *(_memory(f"slope.{name}", f"Bristle torque by {name}") for name in ("level", "stiffness")),
            *(_memory(f"seen.{name}{k}", f"Torque by {name} behind pole {k + 1}") for name, k in _CHAIN),
            *(_memory(f"P{i}{j}", f"Covariance {i}{j}", self._start[i] if i == j else 0.0) for i, j in UPPER),
        ]
        return tuple(replace(one, name=f"{PREFIX}.{one.name}") for one in found)

    def chapter(self, onto: str) -> Chapter:
        """Say what is estimated, and how."""
        return chapter_of(self, PREFIX, "Friction as estimated", onto, "On-line identification")

    def advance(
        self, symbols: dict[str, Scalar], state: list[Any], seen: Seen, period: float
    ) -> tuple[list[Any], Scalar]:
        """Return the states after this tick and the torque expected now."""
        now = getattr(seen, self.source)
        this, law = with_symbols(self, symbols, now, PREFIX), with_symbols(self.law, symbols, now, LAW)
        theta, (bristle, before), slopes, chain, packed = cut(state, 3, 2, 2, 2 * POLES, 6)
        point, middle = (law, slopes, theta), (before + now) / 2
        bristle, slopes = _along(lambda one, z: one.advance(z, middle, one.level(middle), period), bristle, *point)
        point = (law, slopes, theta)
        torque, phi = _along(lambda one, z: one.contact(z, now, one.level(now)) + one.viscous(now), bristle, *point)
        chain = _passed(phi, chain, 1 - ca.exp(-symbols["observer_bandwidth"] * period))
        delayed = ca.vertcat(chain[POLES - 1], chain[-1], 1)
        learned = _recursion(_unpacked(packed), delayed, this.noise**2 * 2 * CHANCE_TIME / period)
        moving = ca.fabs(now) > this.slowest
        step, P = (ca.if_else(moving, new, old) for new, old in zip(learned, (0, _unpacked(packed)), strict=True))
        P = P * (1 + ca.if_else(ca.logic_and(moving, self._certain(P)), period / this.memory, 0))
        theta = this._bounded(ca.vertcat(*theta) + step * seen.residual, law)
        return [*theta, bristle, now, *slopes, *chain, *(P[i, j] for i, j in UPPER)], torque + theta[2]

    @property
    def _start(self) -> tuple[float, float, float]:
        """Variances at the start."""
        breakaway = self.law.Fc if self.law.Fs is None else self.law.Fs
        level = sum(breakaway) / 2 if isinstance(breakaway, Pair) else breakaway
        return self.doubt**2, self.doubt**2, (self.doubt * level) ** 2

    def _certain(self, P: Any) -> Any:
        """Whether every variance is below that of the start."""
        below = [P[k, k] < variance for k, variance in enumerate(self._start)]
        return ca.logic_and(ca.logic_and(below[0], below[1]), below[2])

    def _bounded(self, theta: Any, law: LuGre) -> list[Any]:
        factors = [ca.fmax(1 / self.widest, ca.fmin(self.widest, theta[k])) for k in (0, 1)]
        return [*factors, within(law.level(0), theta[2])]


_CHAIN = tuple((name, k) for name in ("level", "stiffness") for k in range(POLES))


def _memory(name: str, text: str, start: float = 0.0) -> Variable:
    return Variable(name=name, unit="1" if name[0] == "P" else "N.m", description=text, start=start)


def _scaled(law: LuGre, level: Scalar, stiffness: Scalar) -> LuGre:
    peak = None if law.Fs is None else level * law.Fs
    return replace(law, Fc=level * law.Fc, Fs=peak, sigma0=stiffness * law.sigma0)


def _along(
    formula: Callable[[LuGre, Any], Any], bristle: Any, law: LuGre, slopes: list[Any], theta: list[Any]
) -> tuple[Any, list[Any]]:
    """Value of a formula of law and bristle, and its total derivatives by the law's level and stiffness."""
    places = [ca.SX.sym(name) for name in ("bristle", "level", "stiffness")]
    value = formula(_scaled(law, *places[1:]), places[0])
    parts = [value, *ca.horzsplit(ca.jacobian(value, ca.vertcat(*places)))]
    value, by_bristle, *by = ca.substitute(parts, places, [ca.SX(one) for one in (bristle, *theta[:2])])
    return value, [by_bristle * slope + own for slope, own in zip(slopes, by, strict=True)]


def _passed(phi: list[Any], chain: list[Any], share: Scalar) -> list[Any]:
    """Send each regressor through its poles, one after the other."""
    found = []
    for value, filters in zip(phi, cut(chain, POLES, POLES), strict=True):
        for old in filters:
            value = old + share * (value - old)
            found.append(value)
    return found


def _unpacked(packed: list[Any]) -> Any:
    P = ca.SX(3, 3)
    for value, (i, j) in zip(packed, UPPER, strict=True):
        P[i, j] = P[j, i] = value
    return P


def _recursion(P: Any, phi: Any, R: Scalar) -> tuple[Any, Any]:
    """Gain and covariance after one observation of variance R."""
    push = P @ phi
    gain = push / (R + ca.dot(phi, push))
    return gain, P - gain @ push.T
