"""The file of missing torque says nothing where nothing was judged; the page leaves no second time out."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from wandering import axis

from cosim.data.recording import Recording
from cosim.delivery.deliver import write_missing_torque
from cosim.diagnosis.measure.breakdown import curve, parts, samples
from cosim.diagnosis.measure.protocol import Structures, band_of, judge, traces
from cosim.estimation.prepare import Band

MODELS = Structures(axis(), axis(), axis())
RATE = 500.0


def recording(name: str, holes: tuple[tuple[float, float], ...] = ()) -> Recording:
    t = np.arange(int(40 * RATE)) / RATE
    t = t[~np.any([(t > a) & (t < b) for a, b in holes], axis=0)] if holes else t
    q = 0.2 * np.sin(0.7 * t) + 0.1 * np.sin(2.3 * t)
    return Recording(name, {"t": t, "tau": 2 * np.sign(np.cos(0.7 * t)), "q": q})


def test_rows_before_after_and_inside_gaps_are_empty(tmp_path: Path) -> None:
    """A piece of 1.5 s between two gaps is too short to be judged: its rows are inside them."""
    whole, holed = recording("whole"), recording("holed", ((12.0, 14.0), (15.5, 17.0)))
    found = traces([whole], [holed], MODELS)
    write_missing_torque(found, [whole, holed], tmp_path / "missing.parquet")
    table = pq.read_table(tmp_path / "missing.parquet").to_pandas()
    assert len(table) == len(whole) + len(holed)
    for name in ("missing_torque", "band", "after"):
        for trace in found:
            rows = table[table["recording"] == trace.name]
            within = rows["t"].between(trace.t[0], trace.t[-1])
            if trace.name == "holed":
                first, second = (trace.t[trace.t < 12.1][-1], trace.t[trace.t > 16.9][0])
                assert first < 12.0 < 17.0 < second
                within &= ~rows["t"].between(first, second, inclusive="neither")
            assert sorted(rows["t"][rows[name].notna()]) == sorted(rows["t"][within])
    assert table["missing_torque"].isna().any()


def test_the_report_judges_every_row_that_the_protocol_judges() -> None:
    run = recording("whole")
    (trace,) = traces([run], [], MODELS)
    assert trace.t[0] == pytest.approx(3.0, abs=0.01)
    assert trace.t[-1] == pytest.approx(run.duration - 0.5, abs=0.01)
    judged = samples((trace,))
    assert len(judged.t) == len(trace.t)
    assert np.sqrt(np.mean(judged.before**2)) == np.sqrt(np.mean(trace.missing**2))


def test_errors_by_part_are_of_the_band_in_which_the_whole_was_judged() -> None:
    """A torque that is mostly noise above 8 Hz is judged below that; its parts, read beside it, must be too."""
    calm = recording("noisy")
    loud = np.gradient(np.random.default_rng(1).normal(0, 800, len(calm)))
    run = Recording("noisy", {**calm.table, "tau": calm.table["tau"] + loud})
    held = judge([run], MODELS, Band(8.0))
    assert held.cutoff_hz == 8.0
    whole, *_ = parts(traces([run], [run], MODELS, band_of(held)))
    assert whole.before == pytest.approx(held.before_rms, rel=1e-9)


def test_a_curve_is_the_mean_over_equal_bins_from_the_first_to_the_last() -> None:
    """Five samples are enough for a bin; one in thirty counts for the half width; what lies outside counts nowhere."""
    edges = np.linspace(-1.0, 1.0, 5)
    place = np.repeat([-1.0, -0.4, 0.2, 0.6], [60, 5, 4, 30])
    x = np.concatenate([place, [-1.01, 1.0, 7.0]])
    y = np.concatenate([place + np.tile([0.1, -0.1], 50)[: len(place)], [99.0, 99.0, 99.0]])
    found = curve(x, y, edges)
    np.testing.assert_allclose(found.x, [-0.75, -0.25, 0.25, 0.75])
    np.testing.assert_allclose(found.mean, [-1.0, -0.38, np.nan, 0.6], atol=1e-12)
    np.testing.assert_allclose(found.half[[0, 3]], [1.96 * 0.1 / np.sqrt(2), 1.96 * 0.1])
    assert np.isnan(found.half[2])
