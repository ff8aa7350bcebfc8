"""From 10 kHz of simulated loop to the recording a user would hand over."""

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cosim_studies.proof.simulated_axis import RECORDINGS, SimulatedAxis, drift
from cosim_studies.proof.truth import TICK, Array

_DECOYS: dict[str, tuple[float, float, float]] = {  # mean, rms, correlation [s]
    "humidity": (55.0, 4.0, 60.0),
    "wind": (3.0, 1.2, 3.0),
    "supply_voltage": (48.0, 0.15, 1.0),
}


def _ticks(n: int, rate_hz: int) -> tuple[int, NDArray[np.int64]]:
    """Ticks per row, and the tick of every row that has a full interval around it."""
    every = round(1 / TICK / rate_hz)
    return every, np.arange(every, n - every, every, dtype=np.int64)


def centred_mean(held: Array, every: int, rows: NDArray[np.int64]) -> Array:
    """Mean of a value held from tick to tick over the interval of `every` ticks centred at each row."""
    total = np.concatenate([[0.0], np.cumsum(held)])
    edge = np.arange(total.size, dtype=float)
    half = every / 2
    return np.asarray((np.interp(rows + half, edge, total) - np.interp(rows - half, edge, total)) / every)


def columns_of(
    bench: SimulatedAxis, name: str, raw: dict[str, Array], rate_hz: int, rng: np.random.Generator
) -> pd.DataFrame:
    """`t`, `tau` (mean command around t), `q` (reading at t), `q_d`, and `temperature` where there is a sensor."""
    every, rows = _ticks(raw["command"].size, rate_hz)
    columns: dict[str, Any] = {"t": rows * TICK, "tau": centred_mean(raw["command"], every, rows)}
    columns["q"] = _readings(bench, raw, rows, rng)
    if bench.shows_set_point:
        columns["q_d"] = bench.motions[name].q[rows]
    if bench.shows_temperature:
        columns["temperature"] = np.round(raw["temperature"][rows] + 0.03 * rng.standard_normal(rows.size), 2)
    return pd.DataFrame(columns)


def _readings(bench: SimulatedAxis, raw: dict[str, Array], rows: NDArray[np.int64], rng: np.random.Generator) -> Array:
    """The controller's own readings; with a skewed clock the encoder is read again at other times."""
    offset, skew = bench.clock["offset_ms"] * 1e-3, bench.clock["drift_ppm"] * 1e-6
    if offset == 0 and skew == 0:
        return np.asarray(raw["reading"][rows])
    when = rows * (1 + skew) + offset / TICK
    clean = np.interp(when, np.arange(raw["clean_reading"].size), raw["clean_reading"])
    noisy = clean + bench.noise["encoder_rms"] * rng.standard_normal(rows.size)
    return np.asarray(np.round(noisy / bench.noise["quantum"]) * bench.noise["quantum"])


def decoys(rng: np.random.Generator, bench: SimulatedAxis, rate_hz: int) -> dict[str, dict[str, Array]]:
    """In half of the cases one or two columns that have nothing to do with the torque."""
    count = int(rng.choice([0, 0, 1, 2]))
    names = rng.choice(list(_DECOYS), count, replace=False)
    return {recording: {name: _decoy(rng, bench, name, rate_hz) for name in names} for recording in RECORDINGS}


def _decoy(rng: np.random.Generator, bench: SimulatedAxis, name: str, rate_hz: int) -> Array:
    mean, rms, correlation = _DECOYS[name]
    n = bench.motions[RECORDINGS[0]].q.size
    return np.asarray(mean + drift(rng, n, rms, correlation)[_ticks(n, rate_hz)[1]])


def oracle(raw: dict[str, Array], rate_hz: int) -> pd.DataFrame:
    """What no recording shows: true angle, speed, friction torque, other concealed torque (both resist)."""
    _, rows = _ticks(raw["command"].size, rate_hz)
    hidden = {name: raw[name][rows] for name in ("angle", "speed", "temperature", "friction", "extra")}
    return pd.DataFrame({"t": rows * TICK, **hidden})
