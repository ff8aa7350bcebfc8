"""Does the load that the card states still hang on the axis?"""

from math import degrees

import numpy as np

from cosim.diagnosis.answer.doubt_entry import Sanity
from cosim.estimation.prepare import Array
from cosim.support.statistics import rms
from pyfmi_models.effects import GravityUnbalance
from pyfmi_models.mount import Mount

OTHER = 0.5
"""Share of the card's load from which a difference is another load: masses and lever arms are weighed and measured, to
a tenth or so, not guessed as friction is."""


def load_far_from_card(card: Mount, refitted: Mount, positions: Array) -> tuple[Sanity, ...]:
    """Say of a load off the axis that the refitted base turns it into another one.

    Args:
        card: the base as delivered.
        refitted: the same structure with fitted numbers.
        positions: where the axis was recorded [rad]: two loads that pull alike there are the same load.
    """
    before, after = (dict(mount.of_kind(GravityUnbalance)) for mount in (card, refitted))
    both = [(load, after[name]) for name, load in before.items() if name in after]
    return tuple(
        Sanity(
            finding="base_far_from_card",
            statement=f"Refitted, the known load is another than the card's ({_words(one)} → {_words(other)}): where "
            "the axis was recorded they differ by more than half of it. Possible causes: another payload or "
            "counterweight, or another zero of the position.",
        )
        for one, other in both
        if rms(_pull(other, positions) - _pull(one, positions)) > OTHER * rms(_pull(one, positions))
    )


def _pull(load: GravityUnbalance, positions: Array) -> Array:
    """Torque of a load [N m]."""
    return np.asarray(float(load.mgl) * np.sin(positions + float(load.phase)))


def _words(load: GravityUnbalance) -> str:
    return f"{float(load.mgl):.3g} N·m at {degrees(float(load.phase)):.0f}°"
