"""Of which rows a model says anything, and how much each row counts.

At rest a friction law without memory says nothing. And rows that repeat one operating point say little that is new:
what a law misses there, they all miss alike. Ways that are shorter than what recordings show are lost in the encoder's
steps or in the filter.
"""

from math import pi

import numpy as np
import numpy.typing as npt

from cosim.data.resolution import SEEN_STEPS
from cosim.estimation.prepare import Array, Piece, Prepared
from cosim.support.statistics import rms
from pyfmi_models.friction import FrictionLaw, MemorylessLaw

CLEAR_MOTION = 0.02
"""Clear motion: faster than this share of the highest speed."""


STILL = 0.1
"""A recording whose speeds all stay below this share of what is clear motion beside the others is at rest."""


def least_speed(v: Array) -> float:
    """Speed above which motion is clear, on the scale of these speeds."""
    return CLEAR_MOTION * float(np.abs(v).max())


def remembers(law: FrictionLaw, prepared: Prepared) -> bool:
    """Whether recordings show what a law remembers: not where a contact slides before anything shows it bend.

    Such a bristle answers rounding, noise and what the filter does to a stop with a part of the level.
    """
    if isinstance(law, MemorylessLaw):
        return False
    return not bend(law) or bend(law) >= least_way(prepared)


def described_rows(law: FrictionLaw, v: Array) -> npt.NDArray[np.bool_]:
    """Rows at these speeds of which the law says something: all, or without memory those in clear motion."""
    if isinstance(law, MemorylessLaw):
        return np.abs(v) > least_speed(v)
    return np.ones(len(v), bool)


def weights(law: FrictionLaw, prepared: Prepared) -> Array:
    """Weight of each kept row in a fit: 0 where the law says nothing; squares of the others average 1.

    All rows count alike where there is no friction that could hold at rest.

    Rest is judged by the speeds of its own recording: one at a hundredth of the others' speed moves all the same.
    """
    v = prepared.stacked("v")
    if law.key == "none":
        return np.ones(len(v))
    shown = law if remembers(law, prepared) else law.steady()
    says = np.concatenate([_says(shown, piece.v[piece.kept], least_speed(v)) for piece in prepared.pieces])
    new = says / _repeated(v, says, prepared.recording_of)
    return np.asarray(np.sqrt(new * says.sum() / max(new.sum(), 1e-300)))


def far_from_turns(prepared: Prepared) -> Array:
    """1 at kept rows in clear motion that no turn is near, else 0.

    Friction steps at a turn, and the filter smears what a law lacks there over the period of its cutoff: an axis that
    sticks within a step of its encoder leaves there more than most effects.
    """
    least = least_speed(prepared.stacked("v"))
    return np.concatenate([_far(piece, least)[piece.kept] for piece in prepared.pieces])


def _far(piece: Piece, least: float) -> Array:
    """1 where the motion is clear for a period of the cutoff before and after a row, else 0."""
    clear = np.abs(piece.v) > least
    clear &= np.diff(np.sign(piece.v), prepend=np.sign(piece.v[:1])) == 0
    around, rows = max(1, round(1 / (piece.cutoff * piece.dt))), np.arange(len(clear))
    others = np.concatenate([[0], np.cumsum(~clear)])
    near = others[np.minimum(rows + around + 1, len(clear))] - others[np.maximum(rows - around, 0)]
    return np.asarray(near == 0, float)


def _says(law: FrictionLaw, v: Array, least: float) -> Array:
    still = isinstance(law, MemorylessLaw) and np.abs(v).max(initial=0.0) < STILL * least
    return np.zeros(len(v)) if still else described_rows(law, v).astype(float)


def _repeated(v: Array, says: Array, recording: npt.NDArray[np.int64]) -> Array:
    """How many rows stand for one, at each row: 1 + (n - 1) rho for a recording of n rows.

    rho is the intraclass correlation of speed, from an analysis of variance: 1 if each recording holds one speed, about
    0 if each visits all. With errors that a recording's rows have in common this is the factor of Moulton (Journal of
    Econometrics 32, 1986, 385).
    """
    count = np.bincount(recording, weights=says)
    groups, rows = np.count_nonzero(count), count.sum()
    if groups < 2 or rows <= groups:
        return np.ones(len(v))
    mean = np.bincount(recording, weights=says * v) / np.maximum(count, 1)
    within = float(says @ (v - mean[recording]) ** 2) / (rows - groups)
    between = float(count @ (mean - (count @ mean) / rows) ** 2) / (groups - 1)
    size = (rows - (count @ count) / rows) / (groups - 1)
    rho = max(0.0, (between - within) / max(between + (size - 1) * within, 1e-300))
    return np.asarray(1 + np.maximum(count[recording] - 1, 0) * rho)


SMEARED = 0.25
"""Share of what the filter smears below which a way is lost. Unit: 1. A low-pass of cutoff f smears a turn with
acceleration a over a / (2 pi f)^2. Of 36 machines of two generators a bristle that slides within .03 to .09 of it is
refitted with 100 to 1400 times its damping; from .4 on its stiffness is found within 1.4 times where the law is the
machine's. From .1 to .35 the same machines are called so."""


LOST = 0.1
"""Share of the level at rest below which a Coulomb level is lost: something else stood in for it. Unit: 1. A machine
that conceals presliding was refitted to .05, a null has .68; from .06 to .6 both are called the same."""


def held_level(law: FrictionLaw) -> float:
    """What a contact holds before it slides, the mean of both directions [N m, N]; 0 where the law has no level.

    The Coulomb level, as contacts creep below what they break away at; what is held at rest where that level is lost.
    """
    sliding, rest = (
        0.0 if value is None else float(np.mean(value)) for value in (getattr(law, name, None) for name in ("Fc", "Fs"))
    )
    return sliding if sliding >= LOST * rest else rest


def bend(law: FrictionLaw) -> float:
    """Way [rad, m] by which the law's contact bends before it slides; 0 where it does not bend."""
    stiffness = getattr(law, "sigma0", None)
    return held_level(law) / float(np.mean(stiffness)) if stiffness else 0.0


def least_way(prepared: Prepared) -> float:
    """Way [rad, m] below which neither the encoders nor the filtered motion show a displacement."""
    step = max(piece.step for piece in prepared.pieces)
    smear = rms(prepared.stacked("a")) / (2 * pi * max(prepared.band)) ** 2
    return max(SEEN_STEPS * step, SMEARED * smear)
