"""An example to try: an axis whose motor ripples 24 times a turn, which its card does not know.

    30 q'' = tau - (2.5 sign(v) + 12 v) - 0.5 cos(24 q + 0.7)

Three recordings of 30 s under a set point of several waves, made from these equations with noise, and the card.
"""

import numpy as np

RATE, SECONDS = 200.0, 30.0
"""Rows a second [Hz], and length [s]."""
INERTIA, LEVEL, VISCOUS = 30.0, 2.5, 12.0
"""kg m2, N m, N m s/rad."""
RIPPLE, CYCLES, PHASE = 0.5, 24, 0.7
"""N m, waves a turn, rad."""
NOISE = 0.15
"""Of the torque [N m], RMS."""
NAMES = ("example_1.csv", "example_2.csv", "example_heldout.csv")
CARD_NAME = "example.toml"
CARD = f"""[mount]
name = "example axis"
inertia = {INERTIA}

[friction]
model = "coulomb"
Fc = {LEVEL}
sigma2 = {VISCOUS}
"""


def recordings() -> dict[str, str]:
    """Return the text of each recording by its name."""
    return {name: _recording(number) for number, name in enumerate(NAMES)}


def _recording(number: int) -> str:
    t = np.arange(round(RATE * SECONDS)) / RATE
    q, v, a = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
    for k, (size, hertz) in enumerate(((0.7, 0.11), (0.15, 0.31 + 0.02 * number), (0.03, 0.8))):
        omega, phase = 2 * np.pi * hertz, 0.9 * number + k
        q += size * np.sin(omega * t + phase)
        v += size * omega * np.cos(omega * t + phase)
        a -= size * omega**2 * np.sin(omega * t + phase)
    tau = INERTIA * a + LEVEL * np.sign(v) + VISCOUS * v + RIPPLE * np.cos(CYCLES * q + PHASE)
    tau += NOISE * np.random.default_rng(number).standard_normal(len(t))
    rows = (f"{x:.3f},{y:.5g},{z:.9g}" for x, y, z in zip(t, tau, q, strict=True))
    return "\n".join(["t [s],tau [N.m],q [rad]", *rows, ""])
