"""Design and prove a controller: the fastest observer within two limits, then the loop with all its friction.

Run it as it is: `python design_a_controller.py`. Then name your own card in the place of `paper_mount`.

Design looks at the linear loop: phase margin, and how much of the encoder's noise comes back as torque. Proof does not:
it steps plant and controller as the card says, with LuGre friction, under a sine that turns back.
"""

from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

import cosim
from cosim_studies.paper.margins import feedback, held, margins
from pyfmi_models.card import Card, read_card
from pyfmi_models.card_writer import card_text
from pyfmi_models.friction import LAWS

PERIOD = 1e-4
"""Seconds between two commands."""
LEAST = 45.0
"""Degrees of phase that the loop must keep: a usual demand."""
READING, MOST = 1e-7, 0.05
"""Noise of the encoder [rad RMS], and how much torque [N m RMS] may come of it: a thousandth of what the drive has."""
BANDWIDTHS = (60.0, 90.0, 130.0, 180.0, 220.0, 300.0, 400.0, 600.0)
"""Bandwidths of the observer that are tried, in rad/s."""
SCENARIO = """
name = "proof"
step = 1e-4
stop = 8.0

[components.mount]
card = "{card}"
part = "plant"

[components.controller]
card = "{card}"
part = "controller"

[signals.reference]
kind = "sine"
frequency = 0.25
max_velocity = 3.634e-4      # rad/s, five times the stars'
smooth_start = 2.0

[[connections]]
from = "controller.tau"
to = "mount.tau"

[[connections]]
from = "mount.q"
to = "controller.q"

[[connections]]
from = "reference.position"
to = "controller.q_d"

[[connections]]
from = "reference.velocity"
to = "controller.v_d"

[record]
signals = {{ tau = "mount.tau", q = "mount.q", q_d = "reference.position" }}
decimation = 10
"""


def tuned(card: Card, bandwidth: float) -> Card:
    """Return the card with another observer."""
    assert card.controller
    changes = {"observer_bandwidth": bandwidth, "compensation": "C1"}
    return replace(card, controller=card.controller.model_copy(update=changes))


def limits(card: Card) -> tuple[float, float]:
    """Return phase margin [deg] (0: unstable) and torque noise [N m RMS] of the loop without friction."""
    free = replace(card, friction=LAWS["none"]())
    found = margins(held(free.plant().model(), PERIOD, {}), feedback(free.controller_model(), {"started": 1.0}))
    return found.phase if found.stable else 0.0, READING * found.noise


def proven(card: Card, folder: Path, name: str) -> float:
    """Return the RMS tracking error in arcsec after the start, with the friction of the card."""
    (folder / f"{name}.toml").write_text(card_text(card, "Tried by design_a_controller.py"), "utf-8")
    (folder / f"{name}_run.toml").write_text(SCENARIO.format(card=f"{name}.toml"), "utf-8")
    frame = cosim.run(folder / f"{name}_run.toml").frame()
    late = frame[frame["t"] >= 3.0]
    return float(np.sqrt(np.mean((late["q"] - late["q_d"]) ** 2)) * 180 / np.pi * 3600)


def main() -> tuple[float, float, float]:
    """Return the chosen bandwidth, and the tracking errors with the slowest observer and with the chosen one."""
    card, folder = read_card("paper_mount"), Path(mkdtemp(prefix="cosim-design-"))
    tried = {bandwidth: limits(tuned(card, bandwidth)) for bandwidth in BANDWIDTHS}
    for bandwidth, (phase, noise) in tried.items():
        print(f"observer {bandwidth:5.0f} rad/s: phase margin {phase:5.1f} deg, torque noise {noise:.3f} N m")
    chosen = max(one for one, (phase, noise) in tried.items() if phase >= LEAST and noise <= MOST)
    before, after = proven(tuned(card, BANDWIDTHS[0]), folder, "slow"), proven(tuned(card, chosen), folder, "chosen")
    print(f"chosen: {chosen:.0f} rad/s; tracking error {before:.3g} -> {after:.3g} arcsec RMS with LuGre friction")
    return chosen, before, after


if __name__ == "__main__":
    main()
