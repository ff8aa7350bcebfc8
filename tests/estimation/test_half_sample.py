"""A torque that is stamped half a row early or late is moved; a line of the motion itself is no outside disturbance."""

import numpy as np
import pytest
from wandering import swing

from cosim.data.recording import Recording
from cosim.diagnosis.effects.candidates import span_of
from cosim.diagnosis.effects.periodogram import tones
from cosim.estimation.half_sample import are_even, moved, torque_late
from cosim.estimation.prepare import choose_cutoff, prepare
from cosim.estimation.problem import Problem
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

FINE = 40
"""Steps of the exact motion in a row."""
LINES = ((0.11, 0.3), (0.27, 0.12), (0.63, 0.036))
CARD = Mount(name="axis", axis=Axis(inertia=30.0), friction=Coulomb(Fc=2.5, sigma2=30.0))


def run(
    stamp: str = "centred", rate: float = 250.0, delay: float = 0.0, noise: float = 0.02, missing: float = 0.0
) -> Recording:
    """A motion of three lines; torque as loggers stamp it, `delay` rows later; `missing` N m of unbalance."""
    random, t = np.random.default_rng(4), np.arange(int(30 * rate) * FINE) / (rate * FINE)
    q, v, a = swing(t, [(size, f, phase) for (f, size), phase in zip(LINES, (0.4, 2.0, 4.0), strict=True)])
    tau = 30 * a + 2.5 * np.tanh(v / 1e-3) + 30 * v + missing * np.sin(q)
    mean = np.convolve(tau, np.ones(FINE) / FINE, "same")  # over the row that is centred at each moment
    late = {"centred": 0.0, "ordered": 0.5, "mean since": -0.5}[stamp] + delay
    rows = np.arange(2, int(30 * rate) - 2)
    logged = mean[rows * FINE + round(late * FINE)]
    table = {"t": t[rows * FINE], "tau": logged + random.normal(0, noise, len(rows)), "q": q[rows * FINE]}
    table["q"] = table["q"] + random.normal(0, 1e-7, len(rows))
    return Recording(f"run {stamp}", table)


def problem_of(recording: Recording) -> Problem:
    prepared = prepare([recording], choose_cutoff([recording], 30.0))
    return Problem(CARD, prepared, np.ones(len(prepared.recording_of)), recording.sample_time)


def late(recording: Recording) -> float:
    """Rows by which the torque of a recording is found to act later than it is stamped."""
    problem = problem_of(recording)
    return torque_late(problem, problem.fit(problem.mount, 75)) / recording.sample_time


@pytest.mark.parametrize("rate", [250.0, 500.0])
@pytest.mark.parametrize(("stamp", "rows"), [("centred", 0.0), ("ordered", 0.5), ("mean since", -0.5)])
def test_a_torque_that_is_stamped_half_a_row_off_is_seen_and_moved(stamp: str, rows: float, rate: float) -> None:
    given = run(stamp, rate)
    found = late(given)
    assert found == pytest.approx(rows, abs=0.07)  # to first order only: friction turns within a row
    assert abs(late(moved(given, found * given.sample_time))) < 0.05
    centred, put_right = (one["tau"] for one in (run("centred", rate), moved(given, rows * given.sample_time)))
    assert np.sqrt(np.mean((centred - put_right)[5:-5] ** 2)) < 0.05


@pytest.mark.parametrize("given", [run(delay=2.0), run(delay=1.0), run(delay=0.15), run(missing=3.0), run(noise=1.0)])
def test_a_delay_of_the_machine_and_what_else_is_missing_are_not_moved(given: Recording) -> None:
    assert late(given) == 0.0


def test_rows_that_come_unevenly_are_no_ticks() -> None:
    given = run()
    uneven = given.t + 1e-3 * np.random.default_rng(0).uniform(-1, 1, len(given))
    assert are_even([given])
    assert not are_even([given, Recording("uneven", given.table | {"t": np.sort(uneven)})])


def tones_of(recording: Recording) -> list[float]:
    problem = problem_of(recording)
    base = problem.fit(problem.mount, 75)
    level = np.full(len(base.residual), 2.5)
    return tones(span_of(base.mount, problem.prepared, base.residual, level), base.residual)


@pytest.mark.parametrize("hertz", [0.9, 1.7, 4.3])
@pytest.mark.parametrize("stamp", ["centred", "ordered"])
def test_a_line_of_the_motion_is_no_tone_from_outside_and_a_real_one_is(hertz: float, stamp: str) -> None:
    given = run(stamp)
    shaken = given["tau"] + 0.08 * np.sin(2 * np.pi * hertz * given.t + 1.0)
    for recording in (given, Recording("shaken", given.table | {"tau": shaken})):
        own = [f for f, _ in LINES]
        assert not [one for one in tones_of(recording) if min(abs(one - f) for f in own) < 0.04]
    found = tones_of(Recording("shaken", given.table | {"tau": shaken}))
    assert min(abs(one - hertz) for one in found) < 0.04
