"""The motion of neighbouring axes along a recording, and which of it differs from the axis' own."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from cosim.data.neighbours import KINDS, Neighbour, neighbours
from cosim.data.recording import Recording
from cosim.data.resolution import resolution
from cosim.estimation.filters import derivative, lowpass, noise_of
from pyfmi_models.mount import Mount

Array = npt.NDArray[np.float64]
Motion = tuple[Array, Array, Array]
"""Position, speed and acceleration at the same rows."""
STILL = 10.0
"""Times the RMS noise, or the step, of its reading that a neighbour must move from end to end: what stands still is
within 6 as good as always."""
ALONE = 1e-3
"""Share of the energy of a neighbour's position and of its acceleration that must not follow the axis' own: 3 % of its
motion. What follows is the axis itself in other units or through a second encoder (whose twist, play and lag are less
than that), its set point, or an axis that moves in proportion to it, and then nothing tells their torques apart."""


def key(name: str, kind: str) -> str:
    """Under which name a piece holds what a neighbour's motion was."""
    return f"{name} {kind}"


def motions(found: Sequence[Neighbour], table: Mapping[str, Array], dt: float, cutoff: float) -> dict[str, Array]:
    """Position, speed and acceleration of neighbours by `key`, filtered and differentiated as the axis' own.

    What was recorded is taken; what was not is the derivative of what was. A position that was not is the integral of
    the speed, from 0 on. The motion of an only neighbour is there under the names of a plant's inputs too.

    Args:
        found: the neighbours.
        table: columns of a recording on an even grid.
        dt: step of the grid [s].
        cutoff: of the low-pass [Hz].
    """
    columns: dict[str, Array] = {}
    for one in found:
        names = (one.position, one.speed, one.acceleration)
        q, v, a = (lowpass(table[name], dt, cutoff) if name else None for name in names)
        if v is None and q is not None:
            v = derivative(q, dt)
        elif v is None and a is not None:
            v = np.cumsum(a) * dt
        assert v is not None  # one of three columns is there
        if a is None:
            a = derivative(derivative(q, dt) if q is not None else v, dt)
        q = q if q is not None else np.cumsum(v) * dt
        signals = dict(zip(KINDS, (q, v, a), strict=True))
        columns |= {key(one.name, kind): column for kind, column in signals.items()}
        columns |= {f"neighbour_{kind}": column for kind, column in signals.items()} if len(found) == 1 else {}
    return columns


def moving(found: Sequence[Neighbour], table: Mapping[str, Array], dt: float, cutoff: float) -> frozenset[str]:
    """Names of the neighbours that do not stand still."""
    names = []
    for one in found:
        reading = table[one.name]
        least = STILL * max(noise_of(reading, dt), resolution(reading))
        names += [one.name] if float(np.ptp(lowpass(reading, dt, cutoff))) > least else []
    return frozenset(names)


def is_alone(own: Motion, other: Motion) -> bool:
    """Whether a neighbour moves by itself: its position does not follow the axis, even late, nor its acceleration."""
    (q, v, a), (position, _, acceleration) = own, other
    return _own_share(np.column_stack([q, v]), position) > ALONE and _own_share(a[:, None], acceleration) > ALONE


def _own_share(own: Array, column: Array) -> float:
    known = np.column_stack([own, np.ones(len(column))])
    known = known / (np.sqrt((known**2).sum(0)) + 1e-300)
    centred = column - column.mean()
    left = centred - known @ np.linalg.lstsq(known, centred, rcond=1e-9)[0]
    return float(left @ left) / max(float(centred @ centred), 1e-300)


def as_inputs(recording: Recording, mount: Mount, cutoff: float) -> Recording:
    """A recording with the motion of neighbours under the names of a plant's inputs, in which its effects read it."""
    known = mount.recorded_as()
    wanted = {one.name: known.get(one.name, one.name) for one in mount.inputs()}
    wanted = {name: own for name, own in wanted.items() if name in known or name not in recording}
    there = neighbours(recording.columns, recording.units)
    if not wanted or not there:
        return recording
    dt = recording.sample_time
    found = motions(there, recording.table, dt, min(cutoff, 0.3 / dt))
    return replace(recording, table=recording.table | {n: found[own] for n, own in wanted.items() if own in found})
