"""Diagnose your own axis: recordings as dicts of arrays and a card of a few lines; the answer, and the better card.

Run it as it is: `python diagnose_your_axis.py`. Then put `cosim.read("run1.csv")` in the place of `recording(...)`.

The recordings here are of an axis that we know: inertia 30 kg m2, friction 2.5 N m and 30 N m s/rad, and a motor that
tugs 24 times a turn by 0.5 N m. The card knows nothing of the tugs.
"""

from pathlib import Path
from tempfile import mkdtemp

import numpy as np

import cosim

CARD = """
[mount]
name = "azimuth"
inertia = 29.0        # kg m2, from the drawing
torque_limit = 50.0   # N m

[friction]
model = "coulomb"
Fc = 2.2              # N m, a guess
sigma2 = 25.0         # N m s/rad
"""


def recording(seed: int) -> dict[str, np.ndarray]:
    """Return 30 s at 500 Hz: commanded torque and encoder reading while the axis swings to and fro."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 30, 0.002)
    q, v, a = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
    for size, hertz in ((0.5, 0.05 + 0.01 * seed), (0.15, 0.11), (0.04, 0.23)):
        phase, w = rng.uniform(0, 2 * np.pi), 2 * np.pi * hertz
        q += size * np.sin(w * t + phase)
        v += size * w * np.cos(w * t + phase)
        a -= size * w**2 * np.sin(w * t + phase)
    friction = 2.5 * np.tanh(v / 1e-3) + 30.0 * v
    tugs = 0.5 * np.cos(24 * q + 0.7)
    tau = 30.0 * a + friction + tugs + rng.normal(0, 0.2, t.size)
    return {"t": t, "tau": tau, "q": q + rng.normal(0, 2e-7, t.size)}


def main() -> tuple[str, ...]:
    """Diagnose, say what was found, and return the ids of the missing effects."""
    card = Path(mkdtemp(prefix="cosim-axis-")) / "azimuth.toml"
    card.write_text(CARD, "utf-8")
    answer = cosim.diagnose([recording(1), recording(2)], recording(3), card)  # the third one proves it
    print(answer)
    for found in answer.findings:
        if found.effect in answer.missing:
            print(f"\n{found.title}: {found.size} (95 % range {found.size_range})\n{found.statement}\n{found.action}")
    print(f"\nThe better card: {answer.card.effects}")
    return answer.missing


if __name__ == "__main__":
    main()
