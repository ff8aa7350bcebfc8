"""Lag or delay, spring or the loop's answer to noise? Asked of what follows the set point: no noise can imitate that.

In closed loop the controller answers encoder noise and disturbances, so recorded torque and recorded motion are related
by the controller as well as by the machine, and least squares mistakes the one for the other: gain and phase of a drive
come out wrong just where lag and delay differ. The set point knows nothing of noise. With z the torque that the set
point would need, the cross-spectra

    S_z,tau = D^-1(w) S_z,needed,      D = 1 / (1 + j w T)  or  exp(-j w T)

hold whatever the noise is: z is an instrument. Base parameters and the shapes that friction laws cannot agree on stay
free.

Where a motion asks nothing of the upper band, torque and acceleration there are noise and the controller's answer to
it. Least squares takes that answer for mechanics: an inertia that is less where the loop is slow is a spring. With x
what the effect adds along the measured motion, z the same along the set point, and r what the structure leaves, all
free of the base's tangents and of what friction laws lack,

    share = 1 + z'r / z'x

is how much of the effect the set point asks for: 1 of a real one, 0 of the loop's answer.
Reference: Soderstrom and Stoica, Instrumental Variable Methods for System Identification, 1983, chapter 5.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects.delay_and_lag import Drive, milliseconds, timed
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.candidate_fit import CandidateFit
from cosim.estimation.blocks import Blocks
from cosim.estimation.discrepancy_basis import speed_shapes, stop_distances, stop_operators
from cosim.estimation.filters import derivative
from cosim.estimation.fit import Fit, free_parameters
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.least_squares import projected
from cosim.estimation.prepare import Array, Piece, Prepared
from cosim.estimation.tonal_disturbance import without_tones
from cosim.support.statistics import SURELY, hann
from pyfmi_models.effects import ActuatorLag, Delay, DriveEffect, Effect
from pyfmi_models.mount import Mount

Complex = npt.NDArray[np.complex128]
Misfits = dict[str, float]
TWINS: tuple[type[Drive], ...] = (Delay, ActuatorLag)
SEGMENT = 4.0
"""Seconds of a segment of a spectrum; those of cross-spectra overlap by half."""
LOWEST = 0.4
"""Hz: below this no drive effect shows."""
SMOOTH = 5
"""Bins over which the noise of a cross-spectrum is averaged."""
OVERLAP = 2.0
"""Divides chi-squared: overlapping windowed segments and neighbouring bins tell the same twice."""
DECISIVE = SURELY**2
"""Difference of chi-squared from which one of the two is excluded (three standard errors)."""
TOLD = 0.65
"""Share of the set point's misfit that a delay or a lag must explain."""
MUCH = 0.1
"""Share of the plain residual energy that is much."""
SHAPE_PRIOR = 0.3
"""A friction shape may have about this share of the torque's RMS."""
GRID = np.geomspace(0.3, 3.0, 13)
"""Time constants and dead times that are looked at, relative to the fitted one."""
BLOCK_SECONDS = 2.0
"""Longer than the residual remembers, short enough for many."""


@dataclass(frozen=True)
class Crossed:
    """Cross-spectra with the instrument, a row a segment: of the torque (segments, bins), of columns (.., columns)."""

    omega: Array
    torque: Complex
    columns: Complex


def excludes(misfits: Misfits, effect: Effect, rival: Effect) -> float | None:
    """By how much chi-squared speaks for an effect against its rival; None where the set point says nothing of them."""
    if not {effect.id, rival.id} <= set(misfits) or effect.id == rival.id:
        return None
    return misfits[rival.id] - misfits[effect.id]


def settled(misfits: Misfits, best: CandidateFit, rivals: Sequence[CandidateFit]) -> CandidateFit:
    """The rival that the set point demands in place of the best, else the best."""
    for rival in rivals:
        margin = excludes(misfits, best.effect, rival.effect)
        if margin is not None and margin < -DECISIVE:
            return rival
    return best


def is_told(misfits: Misfits, one: CandidateFit) -> bool:
    """Whether what follows the set point is late at all: noise that the controller answers looks late by itself.

    Being late must explain most of what the set point sees of a model without it: friction that meets a noisy speed is
    late as well, but explains little. Where it explains much of the plain residual too, something else may be missing
    beside it, and leaves the set point more to see.
    """
    if one.effect.id not in misfits:
        return True
    explained = misfits["none"] - misfits[one.effect.id]
    least = 0.0 if one.plain_gain > MUCH else TOLD * misfits["none"]
    return explained > max(DECISIVE, least)


def misfits_of(prepared: Prepared, fitted: Mount, drive: Effect) -> Misfits:
    """Chi-squared of a delay, of a lag, each with its best time, and of none, by id, where `drive` is one of the two.

    Empty for other effects and without a recorded set point. `fitted` is the structure with the drive.
    """
    if type(drive) not in TWINS or not isinstance(drive, DriveEffect):
        return {}
    mount = _without(fitted, drive)
    if not prepared.has_position or any("q_d" not in piece.extras for piece in prepared.pieces):
        return {}
    parts = [part for part in (_crossed(mount, piece, prepared) for piece in prepared.pieces) if part is not None]
    if not parts:
        return {}
    ms = milliseconds(drive)
    noise = [_noise(part.torque - part.columns[..., 0] / drive.response(part.omega)) for part in parts]
    least = {form.id: _least(parts, noise, form, ms) for form in TWINS}
    return least | {"none": _chi2(parts, noise, Delay, 0.0)}


def _least(parts: Sequence[Crossed], noise: Sequence[Array], form: type[Drive], fitted: float) -> float:
    from scipy.optimize import minimize_scalar  # a tenth of a second that most diagnoses do not need

    values = [_chi2(parts, noise, form, share * fitted) for share in GRID]
    best = int(np.argmin(values))
    ends = GRID[max(best - 1, 0)], GRID[min(best + 1, len(GRID) - 1)]
    found = minimize_scalar(lambda share: _chi2(parts, noise, form, share * fitted), bounds=ends, method="bounded")
    return min(values[best], float(found.fun))


def _crossed(mount: Mount, piece: Piece, prepared: Prepared) -> Crossed | None:
    inverse = Inverse(mount, free_parameters(mount))
    values = inverse.present
    needed = inverse.behind(piece, inverse.momentary(piece, values), values)
    wanted = on_set_point(piece)
    own = Inverse(without_tones(mount), ())
    instrument = own.behind(wanted, own.momentary(wanted, np.zeros(0)), np.zeros(0))
    top = max(abs(edge) for edge in prepared.ranges["v"])
    shapes = piece.lowpass(np.column_stack([stop_operators(piece, stop_distances(prepared)), speed_shapes(piece, top)]))
    scaled = needed[:, 1:] * np.where(values == 0, 1.0, np.abs(values))
    columns = np.column_stack([needed[:, 0], scaled, shapes * float(np.std(piece.tau))])
    inside = piece.inside
    pieces = np.column_stack([instrument[:, 0], piece.tau, columns])[inside]
    length = int(SEGMENT / piece.dt)
    starts = range(0, len(pieces) - length + 1, length // 2)
    if len(starts) < 3:
        return None
    window = hann(length)[:, None]
    spectra = np.array(
        [np.fft.rfft((pieces[k : k + length] - pieces[k : k + length].mean(0)) * window, axis=0) for k in starts]
    )
    omega: Array = np.asarray(2 * np.pi * np.fft.rfftfreq(length, piece.dt), float)
    used = (omega > 2 * np.pi * LOWEST) & (omega < 2 * np.pi * 0.9 * piece.cutoff)
    crossed = np.conj(spectra[:, used, :1]) * spectra[:, used, 1:]
    return Crossed(omega[used], crossed[..., 0], crossed[..., 1:])


def on_set_point(piece: Piece) -> Piece:
    """The piece as it would be if the axis followed its set point."""
    q = piece.lowpass(piece.extras["q_d"])
    v = derivative(q, piece.dt)
    return replace(piece, q=q, v=v, a=derivative(v, piece.dt))


def _chi2(parts: Sequence[Crossed], noise: Sequence[Array], form: type[Drive], ms: float) -> float:
    """What the instrument still sees of the best fit with this drive, in units of its noise."""
    drive = timed(form, ms)
    rows, targets = [], []
    for part, sigma in zip(parts, noise, strict=True):
        undone = part.columns.sum(0) / drive.response(part.omega)[:, None]
        rows.append(undone[:, 1:] / sigma[:, None])
        targets.append((part.torque.sum(0) - undone[:, 0]) / sigma)
    matrix, target = np.concatenate(rows), np.concatenate(targets)
    prior = np.diag(np.full(matrix.shape[1], 1 / SHAPE_PRIOR))
    stacked = np.concatenate([matrix.real, matrix.imag, prior])
    whole = np.concatenate([target.real, target.imag, np.zeros(len(prior))])
    left = whole - stacked @ np.linalg.lstsq(stacked, whole, rcond=1e-10)[0]
    return float(left @ left) / OVERLAP


def _noise(residual: Complex) -> Array:
    """Standard deviation of each bin's sum over segments, averaged over neighbouring bins."""
    power = (np.abs(residual) ** 2).sum(0)
    kernel = np.ones(SMOOTH) / SMOOTH
    return np.asarray(np.sqrt(np.convolve(np.pad(power, SMOOTH // 2, mode="edge"), kernel, "valid") + 1e-300))


def is_asked_for(comparison: Comparison, found: Fit, effect: Effect) -> bool:
    """Whether the set point asks for a fitted effect; true where no set point was recorded."""
    prepared, problem = comparison.problem.prepared, comparison.problem
    if not prepared.has_position or any("q_d" not in piece.extras for piece in prepared.pieces):
        return True
    weight = problem.weight
    along = weight * _added(found, effect, prepared.pieces)
    asked = weight * _added(found, effect, tuple(map(on_set_point, prepared.pieces)))
    own = [k for k, name in enumerate(found.free) if not name.startswith(f"{effect.id}.")]
    known = np.column_stack([found.slopes[:, own], comparison.nuisances.columns]) * weight[:, None]
    x, z, r = projected(np.column_stack([along, asked, weight * found.residual]), known).T
    share, error = _share(x, z, r, Blocks.of(prepared, BLOCK_SECONDS))
    return share >= POLICY.half and share > SURELY * error


def _share(x: Array, z: Array, r: Array, blocks: Blocks) -> tuple[float, float]:
    """How much of x the instrument z asks for where r is left of it, and its standard error over blocks."""
    common = float(z @ x)
    if common == 0.0:
        return 0.0, 0.0
    share = 1 + float(z @ r) / common
    left = r + (1 - share) * x
    return share, float(np.sqrt(sum(float(z[rows] @ left[rows]) ** 2 for rows in blocks.rows))) / abs(common)


def _added(found: Fit, effect: Effect, pieces: Sequence[Piece]) -> Array:
    """Torque [N m] that an effect adds to what a motion needs, at the kept rows."""
    mounts = found.mount, _without(found.mount, effect)
    whole, without = (stacked(Inverse(one, ()), pieces, np.zeros(0))[0] for one in mounts)
    return np.asarray(whole - without)


def _without(mount: Mount, effect: Effect) -> Mount:
    return replace(mount, effects=tuple(one for one in mount.effects if one is not effect))
