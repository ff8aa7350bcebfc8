"""Columns of the axis' own loop, which are no causes: its torque, asked for or read elsewhere, and its set point.

A set point of the speed is a torque, too, where drag is all that an axis needs.

A cause acts beside the axis' own inertia, friction and load, which it still needs. Beside its own torque it needs none
of them: tau = k c + B b with B the motion (inertia, friction of either sign, drag, waves over the position), and what
B explains beside c is small against what it explains alone. Torque then follows torque, which foretells nothing.

A set point is what the axis follows: its motion (q, v, a) tells most of it. Such a column may still be a cause, as a
neighbour that moves along; but in a loop tau = k (c - q) - d v, so with the set point, the position and the speed, B
is needed half as much as with these two alone, and beside a cause as much as before. What is named for a set point
needs no such proof, and what is named for the motion of a neighbour is none.
"""

from collections.abc import Mapping

import numpy as np

from cosim.data.roles import is_named
from cosim.diagnosis.decide.policy import POLICY
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.row_weights import CLEAR_MOTION
from cosim.support.statistics import column_rms

WAVES = 3
"""Waves of a load over the range of positions: a weight on half a turn, or a spring, is one and a half of them."""


def own_torque(prepared: Prepared, columns: Mapping[str, Array]) -> tuple[str, ...]:
    """Return the names of the columns that are the torque of this axis again, though not in every sample.

    Args:
        prepared: recordings of training.
        columns: values of each column at the kept rows, (rows,), low-passed as the torque is.

    Returns:
        Names in the order given. None where motion explains hardly anything of the torque: then nothing tells them.
    """
    tau, motion = prepared.stacked("tau"), _motion(prepared)
    level = np.ones((len(tau), 1))
    alone, moved = _energy_left(level, tau), _energy_left(np.column_stack([level, motion]), tau)
    if alone - moved <= POLICY.small * alone:
        return ()

    def is_torque(column: Array) -> bool:
        beside = np.column_stack([level, column])
        needed = _energy_left(beside, tau) - _energy_left(np.column_stack([beside, motion]), tau)
        return needed < POLICY.small * (alone - moved)

    return tuple(name for name, column in columns.items() if is_torque(column))


def own_set_point(prepared: Prepared, columns: Mapping[str, Array]) -> tuple[str, ...]:
    """Return the names of the columns that are the set point of this axis under another name; arguments as above."""
    tau, motion = prepared.stacked("tau"), _motion(prepared)
    state = np.column_stack([np.ones_like(tau), *(prepared.stacked(name) for name in "qv")])
    moved = np.column_stack([state, prepared.stacked("a")])

    def needed(beside: Array) -> float:
        return _energy_left(beside, tau) - _energy_left(np.column_stack([beside, motion]), tau)

    alone = needed(state)

    def is_followed(column: Array) -> bool:
        return _energy_left(moved, column) <= POLICY.half * _energy_left(state[:, :1], column)

    def closes_loop(column: Array) -> bool:
        return needed(np.column_stack([state, column])) <= POLICY.half * alone

    theirs = {name for one in prepared.neighbours_recorded for name in (one.position, one.speed, one.acceleration)}
    return tuple(
        name
        for name, one in columns.items()
        if name not in theirs and is_followed(one) and (_asks(name) or closes_loop(one))
    )


def _asks(name: str) -> bool:
    return is_named(name, "asked") and is_named(name, "position", "speed")


def _motion(prepared: Prepared) -> Array:
    """What an axis' own motion may ask of its torque, (rows, n)."""
    v = prepared.stacked("v")
    sign = np.tanh(v / (CLEAR_MOTION * np.abs(v).max() + 1e-300))
    shapes = [prepared.stacked("a"), sign, v]
    if prepared.has_position:
        low, high = prepared.ranges["q"]
        place = (prepared.stacked("q") - low) / (high - low)
        shapes += [np.cos(np.pi * k * place) for k in range(1, WAVES + 1)]
    return np.column_stack(shapes)


def _energy_left(columns: Array, tau: Array) -> float:
    scaled = columns / (column_rms(columns) + 1e-300)
    rest = tau - scaled @ np.linalg.lstsq(scaled, tau, rcond=1e-9)[0]
    return float(rest @ rest)
