"""A loop of two small FMUs, as the text of a scenario."""

TEXT = """
name = "loop"
step = 1e-3
stop = 0.5
[components.plant]
fmu = "tiny3.fmu"
[components.controller]
fmu = "tiny2.fmu"
parameters = { mode = 1.0, k = 5.0 }
[signals.r]
kind = "sine"
frequency = 2.0
amplitude = 0.1
smooth_start = 0.1
[signals.n]
kind = "noise"
rms = 1e-3
seed = 7
[[connections]]
from = "controller.y"
to = "plant.a"
[[connections]]
from = "plant.y"
to = "controller.b"
gain = 2.0
quantum = 1e-6
noise = "n"
[[connections]]
from = "r.position"
to = "controller.a"
[record]
signals = { q = "plant.y", tau = { signal = "plant.a", mode = "mean" }, q_d = "r.position" }
decimation = 2
"""
