"""The quasi-static friction-velocity map: friction torque over speed in steady sliding.

    tau_f = tau - J q''          at speeds above a cut, where bristles have slipped
    tau_f = level(v) sign(v) + viscous(v)

Fitted for each direction and for both together, with the card's own law and those of its numbers that the torque of
steady sliding holds. Of a Stribeck curve, [Fc + (Fs - Fc) exp(-|v/Vs|^delta)] + sigma2 v, three enter linearly, so the
two others are searched on a grid (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413); any
other law starts from the card's numbers, and from these in proportion to the torque.
Single parameters are ill-conditioned, curves are not: compare the curves and their bands.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import casadi as ca
import numpy as np

from cosim.data.recording import Recording
from cosim.estimation.identify.estimate import Array, Estimate, Model, Outputs, determined, estimate
from cosim.estimation.prepare import choose_cutoff, prepare
from cosim.estimation.rowwise import Rowwise, Tape
from cosim.support.errors import InputError
from cosim.support.statistics import Z95
from pyfmi_models.friction import FrictionLaw, Stribeck
from pyfmi_models.model import Pair, Scalar, fields_of, parameters_of

NAMES = ("Fc", "Fs", "Vs", "delta", "sigma2")
"""Numbers of a Stribeck curve, which is the map where no card's law is given."""
PLAIN = Stribeck(Fc=1.0, Fs=1.0, Vs=1.0)
NOT_SEARCHED = ("smoothing",)
"""Numbers of the calculation, not of the friction."""
DIRECTIONS = {"positive": (1.0,), "negative": (-1.0,), "both": (1.0, -1.0)}
CUT = 0.07
"""Speeds below this share of the highest are left out, unless a cut is given."""
LEAST_ROWS = 50
NOTHING = 1e-3
"""Start of a number that the card has at zero, in units of its nominal value: a search of logarithms cannot leave 0."""


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
    law: FrictionLaw = PLAIN

    def curve(self, direction: str, v: Array) -> tuple[Array, Array]:
        """Friction torque at speeds v > 0 and the half-width of its 95 % band."""
        fit, side = self.fits[direction], one_sided(self.law, direction)
        names = sliding_names(side)
        numbers = dict(fit.held) | dict(zip(fit.names, fit.values.tolist(), strict=True))
        torque, *slopes = _curve(side, names)(v[None, :], np.array([numbers[name] for name in names]))
        by_parameter = np.stack([slopes[names.index(name)] for name in fit.names], axis=1)
        spread = np.einsum("ij,jk,ik->i", by_parameter, fit.covariance, by_parameter)
        return torque, Z95 * np.sqrt(np.maximum(spread, 0))


def friction_map(
    recordings: Sequence[Recording],
    inertia: float,
    cut: float | None = None,
    keep_inertia: bool = True,
    law: FrictionLaw | None = None,
) -> FrictionMap:
    """Fit the maps of the card's law, or plain Stribeck curves; numbers that are not determined keep the card's.

    Raises:
        InputError: no speed is above the cut in either direction, or the law has no numbers for a map.
    """
    samples, cut = samples_of(recordings, inertia, cut, keep_inertia)
    sides = [(name, _of(samples, signs)) for name, signs in DIRECTIONS.items() if _enough(samples, signs)]
    if not sides:
        raise InputError(f"No friction map: fewer than {LEAST_ROWS} rows are faster than the cut of {cut:.3g}.")
    if law is None:
        return FrictionMap({name: _fitted(one, PLAIN)[0] for name, one in sides}, cut, keep_inertia, samples)
    fits = {}
    for name, one in sides:
        own = one_sided(law, name)
        best, model = _fitted(one, own)
        fits[name] = determined(best, model, _numbers(own, best.names), _limits(own, best.names))
    return FrictionMap(fits, cut, keep_inertia, samples, law)


def one_sided(law: FrictionLaw, direction: str) -> FrictionLaw:
    """The law with the numbers of one direction; of both: with their mean."""
    pairs = {name: value for name in fields_of(law) if isinstance(value := getattr(law, name), Pair)}
    return replace(law, **{name: getattr(two, direction, sum(two) / 2) for name, two in pairs.items()})


def sliding_names(law: FrictionLaw) -> tuple[str, ...]:
    """Numbers of a one-sided law that its torque in steady sliding holds and that a search of positive numbers finds.

    Raises:
        InputError: there is none, or the law does not say what it is in steady sliding.
    """
    known = [one.name for one in parameters_of(law) if one.low >= 0 and one.name not in NOT_SEARCHED]
    symbols = {name: ca.SX.sym(name) for name in known}
    try:
        torque = _sliding(replace(law, **symbols), ca.SX.sym("v"))
    except TypeError as error:
        raise InputError(f'the card\'s law "{law.key}" has no torque in steady sliding: {error}.') from error
    names = tuple(name for name, symbol in symbols.items() if ca.depends_on(torque, symbol))
    if not names:
        raise InputError(f'the torque of the card\'s law "{law.key}" in steady sliding has no number to fit.')
    return names


def _sliding(law: FrictionLaw, v: Scalar) -> Scalar:
    return ca.SX(law.level(v) + law.viscous(v))


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


def _fitted(folded: Samples, law: FrictionLaw) -> tuple[Estimate, Model]:
    """The best estimate of all numbers of a one-sided law, and what it was fitted with."""
    names = sliding_names(law)
    curve = _curve(law, names)

    def model(values: Array) -> Outputs:
        torque, *slopes = curve(folded.v[None, :], values)
        return Outputs((folded.friction - torque)[:, None], np.stack(slopes, axis=1)[:, None, :])

    starts = _stribeck_starts(folded, names) if set(names) == set(NAMES) else _own_starts(folded, law, names)
    fits = [estimate(names, start, model, _limits(law, names)) for start in starts]
    return min(fits, key=lambda fit: fit.rms[0]), model


def _numbers(law: FrictionLaw, names: Sequence[str]) -> Array:
    return np.array([float(getattr(law, name)) for name in names])


def _limits(law: FrictionLaw, names: Sequence[str]) -> Array:
    """Lowest and highest value of each number, as the law declares them: (numbers, 2)."""
    declared = {one.name: one for one in parameters_of(law)}
    return np.array([(declared[name].low, declared[name].high) for name in names])


def _curve(law: FrictionLaw, names: Sequence[str]) -> Rowwise:
    """Steady friction torque at v > 0 and its derivatives: the law's own equation."""
    v, p = ca.SX.sym("v"), ca.SX.sym("p", len(names))
    torque = _sliding(replace(law, **{name: p[index] for index, name in enumerate(names)}), v)
    return Rowwise(Tape.of(v, p, ca.vertcat(torque, ca.jacobian(torque, p).T)))


def _own_starts(samples: Samples, law: FrictionLaw, names: Sequence[str]) -> list[Array]:
    """The card's numbers; and those in which the torque is linear in proportion to what was recorded."""
    limits, middle = _limits(law, names), float(np.median(samples.v))
    nominal = {one.name: one.nominal for one in parameters_of(law)}
    card = np.array([value if value > 0 else NOTHING * abs(nominal[name]) for name, value in _pairs(law, names)])
    torque, *slopes = (float(column[0]) for column in _curve(law, names)(np.array([[middle]]), card))
    typical = float(np.median(np.abs(samples.friction)))
    size = typical / torque if torque > 0 else 1.0
    linear = np.isin(names, law.linear)
    even = np.where(
        linear & (np.array(slopes) > 0), typical / (max(1, linear.sum()) * np.maximum(slopes, 1e-300)), card
    )
    tried = (card, np.where(linear, size * card, card), size * card, even)
    return [np.clip(one, np.maximum(limits[:, 0], 1e-12), limits[:, 1]) for one in tried]


def _pairs(law: FrictionLaw, names: Sequence[str]) -> list[tuple[str, float]]:
    return list(zip(names, _numbers(law, names).tolist(), strict=True))


def _stribeck_starts(samples: Samples, names: Sequence[str]) -> list[Array]:
    """The three best (Vs, delta) of a grid, the linear parameters fitted for each."""
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
    order = [NAMES.index(name) for name in names]
    return [np.array(numbers)[order] for numbers in (best or [plain])[:3]]
