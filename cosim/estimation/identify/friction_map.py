"""The quasi-static friction-velocity map: friction torque over speed in steady sliding.

    tau_f = tau - J q''          at speeds above a cut, where bristles have slipped
    tau_f = [Fc + (Fs - Fc) exp(-|v/Vs|^delta)] sign(v) + sigma2 v

Fitted for each direction and for both together. Fc, Fs - Fc and sigma2 enter linearly, so the two others are searched
on a grid and no start is needed (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413).
Single parameters are ill-conditioned, curves are not: compare the curves and their bands.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from cosim.data.recording import Recording
from cosim.estimation.identify.estimate import Array, Estimate, Outputs, estimate
from cosim.estimation.prepare import choose_cutoff, prepare
from cosim.estimation.rowwise import Rowwise, Tape
from cosim.support.errors import InputError
from pyfmi_models.friction import Stribeck
from pyfmi_models.model import parameters_of

NAMES = ("Fc", "Fs", "Vs", "delta", "sigma2")
DIRECTIONS = {"positive": (1.0,), "negative": (-1.0,), "both": (1.0, -1.0)}
CUT = 0.07
"""Speeds below this share of the highest are left out, unless a cut is given."""
LEAST_ROWS = 50
Z95 = 1.96


class Samples(NamedTuple):
    """Speed and friction torque where it slides."""

    v: Array
    friction: Array


@dataclass(frozen=True)
class FrictionMap:
    """Maps by direction; `cut` [rad/s], whether J q'' was kept, and the samples they were fitted to."""

    fits: dict[str, Estimate]
    cut: float
    keep_inertia: bool
    samples: Samples

    def curve(self, direction: str, v: Array) -> tuple[Array, Array]:
        """Friction torque at speeds v > 0 and the half-width of its 95 % band."""
        fit = self.fits[direction]
        torque, *slopes = _curve()(v[None, :], fit.values)
        by_parameter = np.stack(slopes, axis=1)
        spread = np.einsum("ij,jk,ik->i", by_parameter, fit.covariance, by_parameter)
        return torque, Z95 * np.sqrt(np.maximum(spread, 0))


def friction_map(
    recordings: Sequence[Recording], inertia: float, cut: float | None = None, keep_inertia: bool = True
) -> FrictionMap:
    """Fit the maps; raise InputError where no speed is above the cut in either direction."""
    samples, cut = samples_of(recordings, inertia, cut, keep_inertia)
    fits = {name: _fitted(samples, signs) for name, signs in DIRECTIONS.items() if _enough(samples, signs)}
    if not fits:
        raise InputError(f"No friction map: fewer than {LEAST_ROWS} rows are faster than the cut of {cut:.3g}.")
    return FrictionMap(fits, cut, keep_inertia, samples)


def samples_of(
    recordings: Sequence[Recording], inertia: float, cut: float | None, keep_inertia: bool
) -> tuple[Samples, float]:
    """Speed and friction torque of the rows that are faster than a cut (none: a share of the highest), and that cut."""
    prepared = prepare(recordings, choose_cutoff(recordings, inertia))
    top = max(abs(edge) for edge in prepared.ranges["v"])
    cut = CUT * top if cut is None else cut
    parts = []
    for piece in prepared.pieces:
        v, a = piece.lowpass(piece.v)[piece.kept], piece.lowpass(piece.a)[piece.kept]
        friction = piece.tau[piece.kept] - (inertia * a if keep_inertia else 0.0)
        parts.append((v[np.abs(v) > cut], friction[np.abs(v) > cut]))
    return Samples(*(np.concatenate(column) for column in zip(*parts, strict=True))), cut


def _of(samples: Samples, signs: tuple[float, ...]) -> Samples:
    """Rows of some directions, folded onto positive speed."""
    rows, sign = np.isin(np.sign(samples.v), signs), np.sign(samples.v)
    return Samples((sign * samples.v)[rows], (sign * samples.friction)[rows])


def _enough(samples: Samples, signs: tuple[float, ...]) -> bool:
    return all(len(_of(samples, (sign,)).v) >= LEAST_ROWS for sign in signs)


def _fitted(samples: Samples, signs: tuple[float, ...]) -> Estimate:
    folded, curve = _of(samples, signs), _curve()

    def model(values: Array) -> Outputs:
        torque, *slopes = curve(folded.v[None, :], values)
        return Outputs((folded.friction - torque)[:, None], np.stack(slopes, axis=1)[:, None, :])

    fits = [estimate(NAMES, start, model, _limits()) for start in _starts(folded)]
    return min(fits, key=lambda fit: fit.rms[0])


def _limits() -> Array:
    """Lowest and highest value of each parameter, as the law declares them: (parameters, 2)."""
    declared = {one.name: one for one in parameters_of(Stribeck(Fc=1.0, Fs=1.0, Vs=1.0))}
    return np.array([(declared[name].low, declared[name].high) for name in NAMES])


def _curve() -> Rowwise:
    """Steady friction torque at v > 0 and its derivatives: the law's own equation."""
    v, p = ca.SX.sym("v"), ca.SX.sym("p", len(NAMES))
    law = Stribeck(**{name: p[index] for index, name in enumerate(NAMES)})
    torque = law.level(v) + law.viscous(v)
    return Rowwise(Tape.of(v, p, ca.vertcat(torque, ca.jacobian(torque, p).T)))


def _starts(samples: Samples, count: int = 3) -> list[Array]:
    """The best (Vs, delta) of a grid, the linear parameters fitted for each."""
    v, friction = samples.v, samples.friction
    found = []
    for speed in np.geomspace(v.min() / 3, v.max(), 20):
        for power in (0.6, 1.0, 1.4, 2.0, 3.0):
            fall = np.exp(-((v / speed) ** power))
            columns = np.column_stack([np.ones_like(v), fall, v])
            level, rise, viscous = np.linalg.lstsq(columns, friction, rcond=None)[0]
            rest = float(np.sum((friction - columns @ [level, rise, viscous]) ** 2))
            found.append((rest, [level, level + rise, speed, power, viscous]))
    best = [numbers for _, numbers in sorted(found, key=lambda item: item[0]) if min(numbers) > 0]
    typical = float(np.median(np.abs(friction)))
    plain = [typical, typical, float(np.median(v)), 2.0, 0.1 * typical / float(v.max())]
    return [np.array(numbers) for numbers in (best or [plain])[:count]]
