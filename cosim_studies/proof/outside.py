"""Effects that no listed name explains: the right answer about them is "unknown", with what it depends on.

Each of these depends on something for which the diagnosis has general shapes (`cosim/diagnosis/terms/dictionary.py`):
its authors and those of the shapes are the same. `beyond.py` holds effects for which it has none.
"""

from dataclasses import replace

import numpy as np

from cosim.support.statistics import rms
from cosim_studies.proof.beyond import SHAPELESS
from cosim_studies.proof.families import Family, add_push, goal, signed
from cosim_studies.proof.simulated_axis import Parameters, SimulatedAxis, drift
from cosim_studies.proof.truth import ticks


def acceleration_drag(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Drag that needs speed and acceleration at once: c |a| v."""
    shape = rms(bench.training.a * bench.training.v)
    bench.mount["swerve"] = 1.6 * goal(bench, rng, size) / shape
    return {"coefficient": bench.mount["swerve"]}


def remanence(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Magnetised iron: a hysteretic spring with a long stroke."""
    length = bench.pace.amplitude * float(rng.uniform(0.3, 0.8))
    bench.mount |= {"remanence": 2 * goal(bench, rng, size), "remanence_length": length}
    return {"torque": bench.mount["remanence"], "length_rad": length}


def reversal_kick(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """A squeezed oil film: extra drag that fades with the time since the last reversal."""
    fade = float(rng.uniform(0.25, 0.8))
    bench.mount |= {"kick": 3 * goal(bench, rng, size), "kick_time": fade}
    return {"torque": bench.mount["kick"], "fade_s": fade}


def random_walk(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """A torque that wanders off and never returns for long."""
    rms = 1.3 * goal(bench, rng, size)
    add_push(bench, lambda _, t: drift(rng, t.size, rms, 4.0))
    return {"rms": rms, "correlation_s": 4.0}


def rubbing(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Something rubs for a few seconds, now and then."""
    extra, spans = size * float(rng.uniform(0.6, 1.0)), {}
    for name, drive in bench.drives.items():
        starts = np.sort(rng.uniform(0.05, 0.85, 3)) * bench.pace.duration
        spans[name] = [[float(s), float(s + rng.uniform(0.06, 0.12) * bench.pace.duration)] for s in starts]
        time = ticks(drive.level.size)
        gate = np.any([(time > low) & (time < high) for low, high in spans[name]], axis=0)
        bench.drives[name] = replace(drive, level=drive.level * (1 + extra * gate))
    return {"relative": extra, "where": {"axis": "time", "intervals": spans}}


def thermal_tilt(bench: SimulatedAxis, rng: np.random.Generator, size: float) -> Parameters:
    """Friction that depends on the product of position and temperature."""
    spread = 6.0 * bench.pace.amplitude
    bench.mount["thermal_tilt"] = size * signed(rng, 0.6, 1.0) / spread
    bench.shows_temperature = True
    return {"per_degC_rad": bench.mount["thermal_tilt"]}


_FOREIGN: tuple[Family, ...] = (acceleration_drag, remanence, reversal_kick, random_walk, rubbing, thermal_tilt)

SHAPED = {family.__name__: family for family in _FOREIGN}
"""Effects with a shape in the diagnosis."""
OUTSIDE_EFFECTS = SHAPED | SHAPELESS
