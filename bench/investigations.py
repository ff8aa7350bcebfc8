"""A small axis in its loop, a card that believes in it, and one with an effect that nobody told."""

import re
from pathlib import Path

BELIEVED = """
[mount]
name = "axis"
inertia = 5.0
torque_limit = 60.0

[friction]
model = "lugre"
sigma0 = 9000.0
sigma1 = 60.0
sigma2 = 4.0
Fc = 2.0
Fs = 2.0
Vs = 0.01

[controller]
kp = 225.0
kd = 30.0
loop_hz = 1000.0
record_hz = 500.0
observer_bandwidth = 120.0
"""
CABLE = '\n[[effects]]\neffect = "cable_wrap"\nstiffness = 2.0\nhome = 0.05\n'
STIFFENING = f"{CABLE}hardening = 20.0\n"
"""A cable that hardens: an even one is a load off the axis over so small a part of a turn."""
SCENARIO = """
name = "axis"
step = 1e-3
stop = 12.0

[components.mount]
card = "CARD"
part = "plant"

[components.controller]
card = "CARD"
part = "controller"

[signals.reference]
kind = "sine"
frequency = 0.25
amplitude = 0.3
smooth_start = 2.0

[signals.ripple]
kind = "noise"
rms = 2e-6
seed = 3

[signals.grain]
kind = "noise"
rms = 0.05
seed = 4

[[connections]]
from = "controller.tau"
to = "mount.tau"
noise = "grain"

[[connections]]
from = "mount.q"
to = "controller.q"
noise = "ripple"

[[connections]]
from = "reference.position"
to = "controller.q_d"

[[connections]]
from = "reference.velocity"
to = "controller.v_d"

[[connections]]
from = "reference.acceleration"
to = "controller.a_d"

[record]
decimation = 2

[record.signals]
tau = { signal = "controller.tau", mode = "mean" }
q = "controller.q"
q_d = "reference.position"
"""
LIMITS = {"position": "-1.5:1.5", "speed": "1", "acceleration": "3"}


def written(folder: Path, effect: str = "") -> tuple[str, str, str]:
    """Scenario, card and machine as files of a folder."""
    card, machine, scenario = folder / "card.toml", folder / "machine.toml", folder / "scenario.toml"
    card.write_text(BELIEVED, "utf-8")
    machine.write_text(BELIEVED + effect, "utf-8")
    scenario.write_text(SCENARIO.replace("CARD", str(card)), "utf-8")
    return str(scenario), str(card), str(machine)


def on_a_drive(folder: Path, effect: str) -> tuple[str, str]:
    """Scenario and card; the plant that a drive moves is the machine, and its encoder has steps in place of noise."""
    scenario, card, machine = written(folder, effect)
    text = re.sub(r'\[signals\.(ripple|grain)\]\nkind = "noise"\nrms = \S+\nseed = \d\n\n', "", SCENARIO)
    text = re.sub(r'noise = "\w+"\n', "", text).replace('from = "mount.q"\n', 'from = "mount.q"\nquantum = 1e-6\n')
    text = text.replace('[components.mount]\ncard = "CARD"', f'[components.mount]\ncard = "{machine}"')
    Path(scenario).write_text(text.replace("CARD", card), "utf-8")
    return scenario, card
