"""The shortest way that recordings show: shorter ones are lost in the encoder's steps or in the filter."""

from math import pi

import numpy as np

from cosim.data.resolution import SEEN_STEPS
from cosim.estimation.prepare import Prepared
from cosim.support.statistics import rms
from pyfmi_models.friction import FrictionLaw

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
