"""Another friction law is proposed where a row of elements rubs, and none where the base's own bristle does."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow.parquet as pq
import pytest
from problems import problem_of
from wandering import axis, recorded

from cosim.data.recording import Recording
from cosim.delivery.deliver import write_missing_torque
from cosim.diagnosis.measure.breakdown import curve, parts, samples
from cosim.diagnosis.measure.law_selection import FOLDS, LEAST, proposed_law
from cosim.diagnosis.measure.protocol import Structures, band_of, judge, traces
from cosim.estimation.blocks import Blocks
from cosim.estimation.prepare import Band
from cosim.estimation.problem import Problem
from pyfmi_models.friction import Coulomb, Dahl, FrictionLaw, LuGre, MaxwellSlip

Array = npt.NDArray[np.float64]
Truth = Callable[[Array], Array]
REACH = np.geomspace(2e-3, 0.1, 6)
"""Distances over which the elements slip [rad]."""


def bristle(q: Array) -> Array:
    """Dahl's curve, solved from row to row: 1 N m over 0.01 rad."""
    out, state = np.empty_like(q), 0.0
    for row, step in enumerate(np.diff(q, prepend=q[0])):
        state = np.sign(step) + (state - np.sign(step)) * np.exp(-abs(step) / 0.01) if step else state
        out[row] = state
    return out


def row_of_elements(q: Array) -> Array:
    """Jenkin elements with equal levels, 1 N m together."""
    out, state = np.empty_like(q), np.zeros(len(REACH))
    for row, step in enumerate(np.diff(q, prepend=q[0])):
        state = np.clip(state + step / REACH, -1, 1)
        out[row] = state.mean()
    return out


def problem(friction: FrictionLaw, truth: Truth) -> Problem:
    """Two recordings of an axis that turns over and over after distances of 2e-3 to 0.3 rad."""
    rng, t = np.random.default_rng(5), np.arange(30_000) / 1000
    recordings = []
    for name, phase in (("one", 0.0), ("two", 1.0)):
        size = 0.15 * np.exp(-2.0 * (1 + np.sin(0.5 * t + phase)))
        q = size * np.sin(2 * np.pi * 0.7 * t + phase)
        a = np.gradient(np.gradient(q, t), t)
        recordings.append(recorded(5 * a + truth(q) + 0.01 * rng.standard_normal(len(t)), t, q, name))
    return problem_of(replace(axis(), friction=friction), *recordings, cutoff=15.0, slow=-1.0, sample=1e-3)


def proposed(friction: FrictionLaw, truth: Truth) -> dict[str, object]:
    this = problem(friction, truth)
    return proposed_law(this, this.fit(this.mount, 25))


LUGRE, DAHL = LuGre(sigma0=100.0, Fc=1.0, sigma1=0.1), Dahl(sigma0=100.0, Fc=1.0)


@pytest.mark.parametrize("law", [LUGRE, DAHL])
def test_a_row_of_elements_is_told_from_one_bristle(law: FrictionLaw) -> None:
    elements = proposed(law, row_of_elements)
    assert elements["proposed"] == "maxwell_slip"
    assert LEAST < float(elements["gain"]) < 1  # type: ignore[arg-type]
    assert proposed(law, bristle) == {"base": law.key, "proposed": law.key, "gain": 0.0, "curve": 0.0}


def test_one_bristle_is_proposed_in_place_of_a_row_that_is_none_and_nothing_in_place_of_no_memory() -> None:
    assert proposed(MaxwellSlip(sigma0=100.0, Fc=1.0), bristle)["proposed"] == "lugre"
    assert proposed(Coulomb(Fc=1.0), row_of_elements)["proposed"] == "coulomb", "its memory is an effect"


@pytest.mark.parametrize("fold", [0, 3])
def test_where_one_fold_holds_all_rows_that_count_nothing_is_predicted_and_no_law_proposed(fold: int) -> None:
    """The others are fitted to no row at all."""
    this = problem(LUGRE, row_of_elements)
    only = np.zeros(len(this.weight))
    only[np.concatenate(Blocks.of(this.prepared).rows[fold::FOLDS])] = 1.0
    weighed = replace(this, weight=only)
    found = proposed_law(weighed, weighed.fit(this.mount, 10))
    assert found == {"base": "lugre", "proposed": "lugre", "gain": 0.0, "curve": 0.0}


# The file of missing torque says nothing where nothing was judged; the page leaves no second time out.

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
