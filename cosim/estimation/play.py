"""What a mass behind a play, or behind any coupling that is not linear, needs beyond being carried rigidly.

    added(t) = torque passed on - J_far a_near

The far side is simulated behind the recorded near one: it coasts, rubs and is caught (`Coupling.advance`). Its contact
is stiffer than the band of a diagnosis, so one implicit step a row is enough; exact bouncing would explain nothing.
"""

from collections.abc import Sequence
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from cosim.estimation.kernels import done, library
from cosim.estimation.prepare import Array, Piece, Prepared
from cosim.estimation.rowwise import Stepwise
from cosim.support.kept import kept_with
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.base import Coupling
from pyfmi_models.model import fields_of

Columns = npt.NDArray[np.floating[Any]]
SEARCHED = 150.0
"""Rows a second that tell where in a grid the play is."""

AT_ONCE = 8
"""Plays of a grid that are simulated together: more do not take less time each, but more memory."""


def stepped_torque(couplings: Sequence[Coupling], far: Sequence[float], v: Array, a: Array, dt: float) -> Array:
    """Torque [N m] that far masses of inertia `far` add at rows dt apart, the near side at speed v, acceleration a.

    For several couplings of one kind at once: (couplings, rows).
    """
    kind: Any = type(couplings[0])
    names = fields_of(couplings[0])
    numbers = np.array(
        [[one, *(getattr(coupling, name) for name in names)] for coupling, one in zip(couplings, far, strict=True)],
        float,
    )
    passed, kernels, speed = np.empty((len(numbers), len(v))), library(), np.ascontiguousarray(v)
    if kind is Backlash and kernels is not None and hasattr(kernels, "play_run"):
        given = speed.ctypes.data, len(v) - 1, dt, numbers.ctypes.data, len(numbers), passed.ctypes.data
        done(kernels.play_run(*given))
    else:
        walk, columns = walk_of(kind, names), np.vstack([v[:-1], v[1:], np.full(len(v) - 1, dt)])
        passed[:] = [walk(columns, one)[-1] for one in numbers]
    # A step's torque is that of its middle: a row has half of the step before it and half of the one after it.
    return np.asarray((passed + np.column_stack([passed[:, 1:], passed[:, -1]])) / 2 - np.outer(far, a))


def far_torques(prepared: Prepared, plays: tuple[tuple[float, float], ...], ratio: float) -> Array:
    """Torque added per far inertia at the kept rows, filtered, for (gap, deceleration by dry friction) each.

    `ratio` is viscous over dry friction [s/rad]. It serves a search: rows are no denser than `SEARCHED` asks for.
    """
    several = [Backlash(gap_rad=gap, load_friction=slow, load_viscous=ratio * slow) for gap, slow in plays]
    groups = [several[first : first + AT_ONCE] for first in range(0, len(several), AT_ONCE)]
    return np.concatenate([np.column_stack([_searched(piece, some) for some in groups]) for piece in prepared.pieces])


def _searched(piece: Piece, plays: Sequence[Backlash]) -> Array:
    step = max(1, int(1 / (SEARCHED * piece.dt)))
    if step == 1:
        return piece.lowpass(stepped_torque(plays, [1.0] * len(plays), piece.v, piece.a, piece.dt).T)[piece.kept]
    coarse = stepped_torque(plays, [1.0] * len(plays), piece.v[::step], piece.a[::step], step * piece.dt)
    fine = np.vstack([np.interp(piece.t, piece.t[::step], one) for one in coarse])
    return piece.lowpass(fine.T)[piece.kept]


@kept_with(most=2)
def torques_of_grid(prepared: Prepared, plays: tuple[tuple[float, float], ...], ratio: float) -> Columns:
    """The same for a grid that is looked at again: the last two are kept, in half of their memory."""
    return far_torques(prepared, plays, ratio).astype(np.float32)


@cache
def walk_of(kind: Any, names: tuple[str, ...]) -> Stepwise:
    """The states and the torque passed on, from speeds before and after each step and dt."""
    column, numbers = ca.SX.sym("column", 3), ca.SX.sym("numbers", 1 + len(names))
    play = kind(**{name: numbers[1 + k] for k, name in enumerate(names)})
    state = ca.SX.sym("state", len(play.states()) + 1)  # the torque passed on comes last, and nothing follows from it
    before, after, dt = ca.vertsplit(column)
    twist, rate, *further = ca.vertsplit(state)[:-1]
    twist, speed, *others = play.advance(twist, before - rate, further, after, dt, numbers[0])
    return Stepwise(state, column, numbers, ca.vertcat(twist, after - speed, *others))
