"""Stability margins of the sampled loop, linearised at an operating point, from the models' own equations.

    L(z) = -C(z) z^-1 P(z),  z = exp(j w h)

P is the plant under a torque that is held over a period h, C the controller from reading to command; the command acts a
tick after its sample. Slopes are CasADi's, so friction compensation, filters and saturation by their slope at the
point are part of the loop. Definitions: Astrom, Murray, Feedback Systems, 2nd edition, chapter 10.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag, expm

from pyfmi_models.model import Model

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]
NEUTRAL = 1e-9
"""An eigenvalue as near as this to 1 belongs to what nothing excites, as an estimate that is not being learned."""


@dataclass(frozen=True)
class Linear:
    """A sampled linear system with one input and one output, x+ = A x + B u, y = C x + D u."""

    A: Floats
    B: Floats
    C: Floats
    D: float
    period: float

    def response(self, omega: Floats) -> Complexes:
        """Frequency response at angular frequencies [rad/s]."""
        z = np.exp(1j * omega * self.period)
        states = np.linalg.solve(z[:, None, None] * np.eye(len(self.A)) - self.A, self.B[:, None].astype(complex))
        return np.asarray(states[:, :, 0] @ self.C + self.D, dtype=np.complex128)

    def reduced(self) -> "Linear":
        """Return the part that leads from input to output: states that neither is joined to play no part in a loop."""
        joined = self.A != 0
        reached, seen = self.B != 0, self.C != 0
        for _ in self.A:
            reached, seen = reached | joined @ reached, seen | joined.T @ seen
        kept = reached & seen
        return Linear(self.A[np.ix_(kept, kept)], self.B[kept], self.C[kept], self.D, self.period)

    def delayed(self, ticks: int) -> "Linear":
        """Return the system with its output so many periods later."""
        if ticks == 0:
            return self
        shift = np.eye(ticks, k=-1)
        A = block_diag(self.A, shift)
        A[len(self.A), : len(self.A)] = self.C
        last = np.zeros(len(A))
        last[-1] = 1.0
        return Linear(A, np.concatenate([self.B, [self.D], np.zeros(ticks - 1)]), last, 0.0, self.period)


@dataclass(frozen=True)
class Margins:
    """How far a loop is from instability.

    `phase` in degrees at the worst crossover, `delay` the further dead time [s] at which the loop becomes unstable,
    `Ms` the largest amplification of a disturbance of the output, `crossover` [rad/s] the highest; `noise` the RMS of
    the command for white noise of the reading with RMS 1, a fresh sample a tick [N m/rad]; infinite where unstable.
    """

    stable: bool
    phase: float
    delay: float
    Ms: float
    crossover: float
    noise: float


def linearised(model: Model, output: str, at: Mapping[str, float], source: str) -> tuple[Floats, Floats, Floats, float]:
    """Return A, B, C, D of a model from the input `source` to an output, at values of states and inputs."""
    names = [[variable.name for variable in group] for group in (model.states, model.inputs, model.outputs)]
    sizes = (1, len(model.states), len(model.inputs), len(model.parameters))
    point = [ca.SX.sym(name, size) for name, size in zip("txup", sizes, strict=True)]
    following, outputs = model.equations(*point)
    chosen = outputs[names[2].index(output)]
    place = names[1].index(source)
    slopes = [ca.jacobian(part, variable) for part in (following, chosen) for variable in point[1:3]]
    values = [[at.get(v.name, v.start) for v in group] for group in (model.states, model.inputs, model.parameters)]
    A, B, C, D = (one.full() for one in ca.Function("slopes", point, slopes)(0, *values))
    return A, B[:, place], C[0], float(D[0, place])


def held(plant: Model, period: float, at: Mapping[str, float], output: str = "q") -> Linear:
    """Return the plant from torque to reading, under a torque that is held over each period."""
    A, B, C, D = linearised(plant, output, at, "tau")
    whole = expm(period * np.block([[A, B[:, None]], [np.zeros((1, len(A) + 1))]]))
    return Linear(whole[:-1, :-1], whole[:-1, -1], C, D, period)


def feedback(controller: Model, at: Mapping[str, float]) -> Linear:
    """Return the controller from reading to minus its command, without what the reading does not reach."""
    assert controller.period is not None
    A, B, C, D = linearised(controller, "tau", at, "q")
    return Linear(A, B, -C, -D, controller.period).reduced()


def margins(plant: Linear, controller: Linear, delay: int = 1) -> Margins:
    """Return the margins of the loop in which a command acts `delay` ticks after its sample."""
    A = _closed(plant, controller.delayed(delay))
    stable = bool(np.abs(np.linalg.eigvals(A)).max() < 1 + NEUTRAL)
    omega = np.geomspace(0.1, np.pi / plant.period, 4000)
    loop = plant.response(omega) * controller.response(omega) * np.exp(-1j * omega * plant.period * delay)
    phase, later, crossover = _crossovers(omega, loop)
    Ms = float((1 / np.abs(1 + loop)).max())
    return Margins(stable, phase, later, Ms, crossover, _noise(plant, controller, delay) if stable else np.inf)


def _closed(plant: Linear, controller: Linear) -> Floats:
    """State matrix of the closed loop; the plant passes nothing on at once."""
    n = len(plant.A)
    A = block_diag(plant.A - controller.D * np.outer(plant.B, plant.C), controller.A)
    A[:n, n:] = -np.outer(plant.B, controller.C)
    A[n:, :n] = np.outer(controller.B, plant.C)
    return np.asarray(A)


def _noise(plant: Linear, controller: Linear, delay: int) -> float:
    """RMS of the command under white noise of the reading: its power over all frequencies."""
    omega = np.linspace(0, np.pi / plant.period, 10001)[1:]
    control = controller.response(omega)
    loop = plant.response(omega) * control * np.exp(-1j * omega * plant.period * delay)
    return float(np.sqrt(np.mean(np.abs(control / (1 + loop)) ** 2)))


def _crossovers(omega: Floats, loop: Complexes) -> tuple[float, float, float]:
    """Worst phase margin [deg] and delay margin [s] over all crossovers of gain 1, and the highest crossover."""
    size = np.log(np.abs(loop))
    places = np.flatnonzero(np.diff(np.signbit(size)))
    if not len(places):
        return np.inf, np.inf, 0.0
    part = size[places] / (size[places] - size[places + 1])
    at = omega[places] * (omega[places + 1] / omega[places]) ** part
    angle = np.unwrap(np.angle(loop))
    turned = np.mod(angle[places] + part * (angle[places + 1] - angle[places]), 2 * np.pi)
    ahead = np.mod(turned - np.pi, 2 * np.pi)  # how far the loop may still turn back before it meets -1
    return float(np.degrees(np.minimum(ahead, 2 * np.pi - ahead)).min()), float((ahead / at).min()), float(at.max())
