"""A mount in its loop over a wandering set point, as a recording of 1 kHz."""

import numpy as np

from cosim.data.recording import Recording
from cosim.estimation.identify.machine import Machine
from cosim.estimation.prepare import Prepared, prepare
from cosim.estimation.set_point import set_point
from pyfmi_models.card import read_card
from pyfmi_models.mount import Mount

SECONDS = 16.0


def recorded(mount: Mount) -> Prepared:
    """The closed loop over a wandering set point, as 1 kHz rows, prepared for a diagnosis."""
    card = read_card("paper_mount")
    t = np.arange(int(SECONDS * 1000)) / 1000
    x = np.clip(t / 2.5, 0, 1)
    tones = ((0.5, 0.1, 0.0), (0.1, 0.31, 1.0), (0.02, 0.83, 2.0), (0.001, 3.0, 0.5), (2e-4, 7.0, 0.5))
    waves = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in tones)
    q_d = x**3 * (10 - 15 * x + 6 * x * x) * waves
    signals = set_point(Recording("set point", {"t": t, "q": q_d, "q_d": q_d}), 1e-4)
    machine = Machine(mount.model(), card.controller_model(), ("axis.inertia",), 1e-4)
    y, _ = machine.run(np.array([30.0]), np.column_stack(list(signals.values())), {})
    window = np.r_[0.5, np.ones(9), 0.5] / 10
    rows = len(y) // 10
    table = {"t": t[:rows], "tau": np.convolve(y[:, 1], window, mode="same")[::10][:rows], "q": y[::10, 0][:rows]}
    return prepare([Recording("r", table)], 70.0)
