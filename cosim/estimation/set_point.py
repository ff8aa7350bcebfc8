"""The set point that was recorded, at every tick of the controller that followed it."""

import numpy as np
from scipy.interpolate import make_interp_spline

from cosim.data.recording import Recording
from cosim.estimation.prepare import Array


def set_point(recording: Recording, step: float) -> dict[str, Array]:
    """Set point at every tick from a recorded one: a quintic spline, so that its acceleration is smooth."""
    spline = make_interp_spline(recording.t, recording["q_d"], k=5)
    t = recording.t[0] + step * np.arange(int(np.floor(recording.duration / step)))
    return {"q_d": spline(t), "v_d": spline(t, 1), "a_d": spline(t, 2)}
