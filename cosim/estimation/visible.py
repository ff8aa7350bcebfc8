"""The shortest way that recordings show: shorter ones are lost in the encoder's steps or in the filter."""

from math import pi

from cosim.data.resolution import SEEN_STEPS
from cosim.estimation.prepare import Prepared
from cosim.support.statistics import rms

SMEARED = 0.25
"""Share of what the filter smears below which a way is lost. Unit: 1. A low-pass of cutoff f smears a turn with
acceleration a over a / (2 pi f)^2. Of 36 machines of two generators a bristle that slides within .03 to .09 of it is
refitted with 100 to 1400 times its damping; from .4 on its stiffness is found within 1.4 times where the law is the
machine's. From .1 to .35 the same machines are called so."""


def least_way(prepared: Prepared) -> float:
    """Way [rad, m] below which neither the encoders nor the filtered motion show a displacement."""
    step = max(piece.step for piece in prepared.pieces)
    smear = rms(prepared.stacked("a")) / (2 * pi * prepared.cutoff) ** 2
    return max(SEEN_STEPS * step, SMEARED * smear)
