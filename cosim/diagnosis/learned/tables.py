"""A learned term as a table for a reader: values over its quantity."""

import numpy as np

from cosim.support.plain import JsonObject
from pyfmi_models.effects import Effect
from pyfmi_models.effects.learned import LearnedDrive, LearnedFriction, LearnedTorque
from pyfmi_models.effects.learned_memory import LearnedAfterReversal, LearnedHysteresis
from pyfmi_models.waves import spoken

ROWS = 41
"""Values of a table over one quantity; a table of products has `COLUMNS` more in each row."""
COLUMNS = 5


def table_of(effect: Effect, linear: bool) -> JsonObject:
    """Return the quantity, its values, and what the term does there: a torque, or a share of the friction level."""
    torque = "N" if linear else "N.m"
    if isinstance(effect, LearnedHysteresis):
        return {"kind": "hysteresis", "strokes": list(effect.strokes), "torque": list(effect.torque), "unit": torque}
    if isinstance(effect, LearnedAfterReversal):
        own = {"ways": list(effect.ways), "times": list(effect.times), "level_change": list(effect.level_change)}
        return {"kind": "friction after a reversal", **own, "unit": "1"}
    if isinstance(effect, LearnedDrive):
        command, missing = effect.curve(ROWS)
        return {"kind": "drive", "command": command.tolist(), "missing": missing.tolist(), "unit": torque}
    return _of_waves(effect, torque)


def _of_waves(effect: Effect, torque: str) -> JsonObject:
    if not isinstance(effect, LearnedTorque | LearnedFriction):
        raise TypeError(f"{type(effect).__name__} has no table")
    is_torque = isinstance(effect, LearnedTorque)
    named = {"kind": "torque" if is_torque else "friction", "unit": torque if is_torque else "1"}
    at, values = effect.values(ROWS)
    if not effect.by:
        shown = values if is_torque else np.expm1(values)
        return {**named, "over": spoken(effect.over), "at": at.tolist(), "value": shown.tolist()}
    others = np.linspace(effect.by_seen[0], effect.by_seen[1], COLUMNS)
    grid = np.array([effect.values(ROWS, float(other))[1] for other in others])
    shown = grid if is_torque else np.expm1(grid)
    places = {"at": at.tolist(), "by": spoken(effect.by), "by_at": others.tolist(), "value": shown.T.tolist()}
    return {**named, "over": spoken(effect.over), **places}
