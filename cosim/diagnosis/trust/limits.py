"""What recordings cannot show, whatever is missing.

A coarse encoder's step limits it, no set point beside the position, and no motion away from turns.
"""

from collections.abc import Sequence
from math import degrees, pi, sqrt

import numpy as np

from cosim.data.recording import Recording
from cosim.data.resolution import SEEN_STEPS, resolution
from cosim.diagnosis.answer.doubt_entry import Sanity
from cosim.diagnosis.terms.dictionary import further_columns
from cosim.estimation.end_stops import Push
from cosim.estimation.prepare import PROTOCOL_HZ, Prepared
from cosim.estimation.row_weights import far_from_turns
from pyfmi_models.mount import Mount

SPOILED = 0.03
"""Share of the torque from which the torque that rounding alone seems to need spoils a band: the noise of good
recordings is below a third of it, and an effect that is a tenth of the torque is three times it."""
CLEAR_SECONDS = 1.0
"""Seconds of clear motion away from turns below which what is slow cannot be judged: the rest is measured there in
cells of a quarter of a second. Unit: s. None of 65 machines of two generators has less; a measured joint that hardly
moved for 20 s has none."""


def encoder_step(recordings: Sequence[Recording], mount: Mount, cutoff: float) -> tuple[Sanity, ...]:
    """Say what the step of a coarse encoder limits; nothing where rounding spoils no torque in the protocol's band.

    There it limits nothing that is printed.
    `cutoff` [Hz] is the band of the analysis. Rounding to a step s is white noise of s / sqrt(12).
    """
    steps = {one.name: resolution(one["q"]) for one in recordings if "q" in one}
    name, step = max(steps.items(), key=lambda pair: pair[1], default=("", 0.0))
    coarse = next((one for one in recordings if one.name == name), None)
    if coarse is None or rounding_torque(coarse, step, float(mount.axis.inertia), PROTOCOL_HZ) < SPOILED:
        return ()
    unit, size = ("mm" if mount.motion == "linear" else "mrad"), 1e3 * step
    text = (
        f"The encoder of {name} counts in steps of {size:.3g} {unit}: the analysis ends at {cutoff:.3g} Hz, and a "
        f"presliding reach or a play below about {SEEN_STEPS * size:.2g} {unit} cannot be seen."
    )
    return (Sanity(finding="encoder_step", statement=text),)


def rounding_torque(recording: Recording, step: float, inertia: float, band: float) -> float:
    """RMS torque that the rounding of the position to a step seems to need in a band [Hz], over that of the torque."""
    band = min(band, 0.3 / recording.sample_time)
    share = 2 * band * recording.sample_time / 5
    acceleration = step / sqrt(12) * (2 * pi * band) ** 2 * sqrt(share)
    return inertia * acceleration / max(float(np.std(recording["tau"])), 1e-300)


def end_stop(found: Push, recordings: Sequence[Recording], motion: str) -> Sanity:
    """Say that recordings push against something at an end of the travel, and that nothing is judged there."""
    names = ", ".join(dict.fromkeys(recordings[number].name for number, *_ in found.spans))
    linear = motion == "linear"
    at, unit = (f"{1e3 * found.at:.4g} mm", "N") if linear else (f"{degrees(found.at):.4g}°", "N·m")
    text = (
        f"{names}: at {at}, an end of the travel, the axis hardly moves and pushes with {found.torque:.3g} {unit} more "
        f"than friction and load take ({found.seconds:.2g} s in all): an end stop. Nothing is judged there."
    )
    return Sanity(finding="end_stop", statement=text)


def half_sample(recordings: Sequence[Recording], late: float, sample_time: float) -> tuple[Sanity, ...]:
    """Say that the torque acts so many seconds later than it is stamped, less than a row, and was moved by that."""
    if not late:
        return ()
    names, side = ", ".join(one.name for one in recordings), "after" if late > 0 else "before"
    how = "as one that holds until the next row" if late > 0 else "as one that is a mean since the last row"
    text = (
        f"The torque of {names} acts {1e3 * abs(late):.2g} ms {side} its time stamp, {abs(late) / sample_time:.2g} of "
        f"a row, {how}. It was moved by that; it is no delay of the machine."
    )
    return (Sanity(finding="half_sample", statement=text),)


def no_set_point(recordings: Sequence[Recording]) -> tuple[Sanity, ...]:
    """Say what it costs that the set point was not recorded."""
    without = [one.name for one in recordings if "q_d" not in one]
    if not without:
        return ()
    text = (
        f"{', '.join(without)}: no set point (q_d) was recorded. So only the fit distinguishes a delay from a lag, "
        "bias by the control loop cannot be tested, and nothing is validated in closed loop. Record q_d as well."
    )
    return (Sanity(finding="no_set_point", statement=text),)


def little_motion(prepared: Prepared) -> tuple[Sanity, ...]:
    """Say that recordings of training hold hardly any motion away from turns."""
    seconds_of = np.concatenate([np.full(len(piece.kept), piece.dt * piece.stride) for piece in prepared.pieces])
    seconds = float(far_from_turns(prepared) @ seconds_of)
    if seconds >= CLEAR_SECONDS:
        return ()
    text = (
        f"{', '.join(prepared.names)}: only {seconds:.2g} s of clear motion away from reversals, below "
        f"{prepared.cutoff:.3g} Hz. So slow effects cannot be judged, and that nothing was found says little. Record "
        "longer strokes at speeds that last."
    )
    return (Sanity(finding="little_motion", statement=text),)


def own_torque(prepared: Prepared) -> tuple[Sanity, ...]:
    """Say which columns are the axis' own torque, asked for or read elsewhere, and so are tried as no cause."""
    names = further_columns(prepared).torque
    if not names:
        return ()
    tells, it = ("each tells", "them") if names[1:] else ("it tells", "it")
    text = (
        f"Beside {', '.join(names)} the axis hardly needs friction or inertia of its own: {tells} its torque, as a "
        f"command or another reading, and is no cause. Nothing was learned over {it}."
    )
    return (Sanity(finding="own_torque", statement=text),)


def own_set_point(prepared: Prepared) -> tuple[Sanity, ...]:
    """Say which columns are the axis' own set point under another name, and so are tried as no cause."""
    names = further_columns(prepared).set_point
    if not names:
        return ()
    it = "them" if names[1:] else "it"
    text = f"The axis follows {', '.join(names)}, as its set point or another reading of it: no cause. "
    text += f"Nothing was learned over {it}."
    if not any("q_d" in piece.extras for piece in prepared.pieces):
        text += f" A set point of the position is of use where it is stated: --columns q_d={names[0]}."
    return (Sanity(finding="own_set_point", statement=text),)
