"""A random disturbance in words: what shakes the machine all the time, and follows nothing that was recorded."""

import numpy as np

from cosim.diagnosis.answer.entries import BroadbandEntry
from cosim.diagnosis.answer.result import Finding
from cosim.diagnosis.decide.calibration import calibrated
from cosim.diagnosis.evidence.broadband import Shaken
from cosim.estimation.prepare import Array
from cosim.support.statistics import rms

ID = "broadband_disturbance"
"""Its id in diagnosis.json: the verdict calls it unknown."""
ACTION = "record at rest, with all around it off and on, and look for what shakes it: floor, wind, pump, another axis"


def broadband_entry(found: Shaken, residual: Array, friction: float, motion: str) -> BroadbandEntry:
    """Describe a disturbance; its probability is that of an effect that removes as much of the residual energy.

    Args:
        found: the disturbance.
        residual: what the model leaves of the held-out recordings [N m, N].
        friction: RMS of the friction [N m, N].
        motion: of the axis, rotary or linear.
    """
    unit = "N" if motion == "linear" else "N·m"
    share = float(np.clip((found.level / max(rms(residual), 1e-300)) ** 2, 0.0, 1.0))
    return BroadbandEntry(
        level=found.level,
        relative=found.level / friction,
        low_hz=found.low,
        high_hz=found.high,
        probability=calibrated(share),
        statement=f"Broad-band disturbance of {found.level:.2g} {unit} RMS, {found.low:.2g} to {found.high:.2g} Hz, "
        "that is there at any motion and not caused by it.",
    )


def broadband_finding(entry: BroadbandEntry, motion: str) -> Finding:
    """The same as a row among the effects: as a name it is only possible, as what makes it is not known."""
    unit = "N" if motion == "linear" else "N.m"
    return Finding(
        effect=ID,
        title="Broad-band disturbance",
        answer="ambiguous",
        probability=entry["probability"],
        gain=0.0,
        parameters={name: entry[name] for name in ("level", "low_hz", "high_hz")},
        units={"level": unit, "low_hz": "Hz", "high_hz": "Hz"},
        size=f"{entry['level']:.2g} {unit.replace('.', '·')}",
        statement=entry["statement"],
        evidence=f"its level at any motion is {entry['relative']:.2g} of the friction, in training and held out",
        action=ACTION[:1].upper() + ACTION[1:] + ".",
    )
