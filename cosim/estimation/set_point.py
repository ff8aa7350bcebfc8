"""The set point that was recorded, at every tick of the controller that followed it."""

import numpy as np

from cosim.data.held import held_columns, new_rows
from cosim.data.recording import Recording
from cosim.estimation.prepare import Array


def set_point(recording: Recording, step: float) -> dict[str, Array]:
    """Set point at every tick from a recorded one: a quintic spline, so that its acceleration is smooth.

    Of one that repeats its readings, those that are new.
    """
    from scipy.interpolate import make_interp_spline  # a tenth of a second that a fit does not need

    every = held_columns(recording.table).get("q_d")
    rows = new_rows(recording["q_d"], every) if every else np.arange(len(recording))
    spline = make_interp_spline(recording.t[rows], recording["q_d"][rows], k=5)
    t = recording.t[0] + step * np.arange(int(np.floor(recording.duration / step)))
    return {"q_d": spline(t), "v_d": spline(t, 1), "a_d": spline(t, 2)}
