"""A number that recordings do not determine keeps the card's value and is named; none is delivered at a bound."""

from pathlib import Path

import numpy as np
import pytest
from wandering import posed, recorded, swing

import cosim
from cosim.data.recording import Recording
from cosim.diagnosis.effects.candidates import span_of
from cosim.diagnosis.effects.periodogram import tones
from cosim.estimation.determined import limited, with_held
from cosim.estimation.fit import edges_of
from cosim.estimation.half_sample import are_even, moved, torque_late
from cosim.estimation.prepare import choose_cutoff
from cosim.estimation.problem import Problem
from pyfmi_models.friction import Coulomb, Stribeck
from pyfmi_models.model import Pair
from pyfmi_models.mount import Axis, Mount

RATE = 250.0
SPEEDS = (0.05, -0.05, 0.1, -0.1, 0.2, -0.2, 0.4, -0.4)


def mount(friction: object = None, inertia: float = 45.0, motion: str = "rotary") -> Mount:
    law = friction or Coulomb(Fc=4.0, sigma2=30.0)
    return Mount(name="axis", axis=Axis(inertia=inertia), friction=law, motion=motion)


def steady(seed: int = 1, speeds: tuple[float, ...] = SPEEDS, noise: float = 1e-7) -> Recording:
    """Constant speeds of 4 s, what lies between them cut out: Coulomb 2.5, viscous 30."""
    random, count = np.random.default_rng(seed), int(4 * RATE)
    t = np.concatenate([6.0 * k + np.arange(count) / RATE for k in range(len(speeds))])
    v = np.repeat(speeds, count)
    q = np.concatenate([4 * sum(speeds[:k]) + speed * np.arange(count) / RATE for k, speed in enumerate(speeds)])
    tau = 2.5 * np.sign(v) + 30 * v + random.normal(0, 0.02, len(t))
    return Recording(f"steady_{seed}", {"t": t, "tau": tau, "q": q + random.normal(0, noise, len(t))})


def speed_alone(seed: int = 1) -> Recording:
    """The same where a tachometer was recorded in place of the position."""
    given = steady(seed)
    v = np.repeat(SPEEDS, int(4 * RATE)) + np.random.default_rng(seed).normal(0, 1e-4, len(given))
    return Recording(given.name, {"t": given.t, "tau": given["tau"], "v": v})


def moving(inertia: float = 30.0, sigma2: float = 30.0, coulomb: float = 2.5) -> Recording:
    """A motion that speeds up and slows down, and the torque that it needs."""
    random, t = np.random.default_rng(3), np.arange(int(30 * RATE)) / RATE
    q, v, a = swing(t, [(0.3, 0.7, 0.0), (0.1, 2.3, 0.0)], per=1)
    tau = inertia * a + coulomb * np.tanh(v / 1e-3) + sigma2 * v
    return recorded(tau + random.normal(0, 0.02, len(t)), t, q + random.normal(0, 1e-7, len(t)))


def problem_of(recording: Recording, card: Mount) -> Problem:
    return posed(card, [recording], choose_cutoff([recording], float(card.axis.inertia)))


def determined(recording: Recording, card: Mount) -> tuple[tuple[str, ...], dict[str, float]]:
    """Names of what is held, and all numbers of the base after the fit."""
    problem = problem_of(recording, card)
    problem, base = with_held(problem, problem.fit(problem.mount, 75))
    return problem.held, {one.name: one.start for one in base.mount.parameters()}


@pytest.mark.parametrize(
    "recording",
    [
        steady(),
        speed_alone(),
        *(steady(noise=n) for n in (1e-9, 1e-6, 0)),
        steady(speeds=(0.3, -0.1, 0.3, -0.1, 0.2)),
    ],
    ids=["position", "speed alone", "less noise", "more noise", "no noise", "other speeds"],
)
@pytest.mark.parametrize("motion", ["rotary", "linear"])
def test_constant_speeds_leave_the_inertia_at_the_cards(recording: Recording, motion: str) -> None:
    held, numbers = determined(recording, mount(motion=motion))
    assert held == ("axis.inertia",)
    assert numbers["axis.inertia"] == 45.0
    assert numbers["friction.Fc"] == pytest.approx(2.5, rel=0.02)
    assert numbers["friction.sigma2"] == pytest.approx(30.0, rel=0.02)


def test_one_speed_determines_the_sum_of_two_numbers_and_one_of_them_is_held() -> None:
    held, numbers = determined(steady(speeds=(0.2, -0.2, 0.2, -0.2)), mount())
    assert "axis.inertia" in held
    assert len(held) == 2
    assert {"friction.Fc": 4.0, "friction.sigma2": 30.0}[held[-1]] == numbers[held[-1]]
    assert numbers["friction.Fc"] + 0.2 * numbers["friction.sigma2"] == pytest.approx(2.5 + 6.0, rel=0.01)


def test_a_direction_that_was_never_driven_keeps_its_friction() -> None:
    card = mount(Coulomb(Fc=Pair(4.0, 4.5), sigma2=Pair(20.0, 25.0)))
    held, numbers = determined(steady(speeds=(0.05, 0.1, 0.2, 0.4)), card)
    assert {"friction.Fc.negative", "friction.sigma2.negative"} <= set(held)
    assert numbers["friction.Fc.negative"] == 4.5
    assert numbers["friction.Fc.positive"] == pytest.approx(2.5, rel=0.02)


def test_motion_that_speeds_up_determines_all_numbers_and_one_that_the_card_has_at_its_bound_may_stay_there() -> None:
    held, numbers = determined(moving(), mount())
    assert held == ()
    assert numbers["axis.inertia"] == pytest.approx(30.0, rel=0.01)
    problem = problem_of(moving(sigma2=0.0), mount(Coulomb(Fc=4.0, sigma2=0.0)))
    assert limited(problem, problem.fit(problem.mount, 75).mount)[1].keys() <= {"friction.Fc"}


@pytest.mark.parametrize("recorded", [moving(sigma2=-1.0), moving(sigma2=-8.0), moving(coulomb=-0.5)])
@pytest.mark.parametrize("card", [mount(), mount(Stribeck(Fc=4.0, Fs=4.5, Vs=0.02, sigma2=30.0))], ids=["level", "map"])
def test_no_number_is_delivered_at_a_bound_and_the_fit_is_hardly_worse(recorded: Recording, card: Mount) -> None:
    problem = problem_of(recorded, card)
    problem, base = with_held(problem, problem.fit(problem.mount, 75))
    better, limits = limited(problem, base.mount)
    edges, given = edges_of(card, problem.prepared.pieces), {one.name: one.start for one in card.parameters()}
    for one in better.parameters():
        if one.name.startswith(("axis.", "friction.")) and one.name in edges:
            margin = 1e-6 * max(abs(given[one.name]), abs(one.start))
            assert all(abs(one.start - edge) > margin for edge in edges[one.name]), one.name
    for name, one in limits.items():
        assert one.is_highest == (given[name] > edges[name][0])
    assert problem.error(problem.fit(better, 1)) < 1.01 * problem.error(base)


def test_a_diagnosis_keeps_the_cards_inertia_and_says_so(tmp_path: Path) -> None:
    card = tmp_path / "axis.toml"
    card.write_text('[mount]\ninertia = 45.0\n[friction]\nmodel = "coulomb"\nFc = 4.0\nsigma2 = 30.0\n')
    done = cosim.diagnose([steady(1), steady(2)], steady(3), card, tmp_path / "out", quick=True)
    written = done.as_json()
    assert written["verdict"] == []
    entry = written["not_determined"]["axis.inertia"]
    assert (entry["value"], entry["limit"]) == (45.0, None)
    assert "inertia = 45.0" in (tmp_path / "out" / "card.toml").read_text()
    assert "do not determine the inertia (axis.inertia)" in " ".join(str(done).split())
    (varying,) = [one for one in written["effects"] if one["effect"] == "inertia_variation"]
    assert varying["answer"] == "not_testable"


# A torque that is stamped half a row early or late is moved; a line of the motion is no outside disturbance.

FINE = 40
"""Steps of the exact motion in a row."""
LINES = ((0.11, 0.3), (0.27, 0.12), (0.63, 0.036))
CARD = mount(Coulomb(Fc=2.5, sigma2=30.0), inertia=30.0)


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
    tau, read = logged + random.normal(0, noise, len(rows)), q[rows * FINE] + random.normal(0, 1e-7, len(rows))
    return recorded(tau, t[rows * FINE], read, f"run {stamp}")


def late(recording: Recording) -> float:
    """Rows by which the torque of a recording is found to act later than it is stamped."""
    problem = problem_of(recording, CARD)
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
    problem = problem_of(recording, CARD)
    base = problem.fit(problem.mount, 75)
    level = np.full(len(base.residual), 2.5)
    return tones(span_of(base.mount, problem.prepared, base.residual, level), base.residual)


@pytest.mark.parametrize("hertz", [0.9, 1.7, 4.3])
@pytest.mark.parametrize("stamp", ["centred", "ordered"])
def test_a_line_of_the_motion_is_no_tone_from_outside_and_a_real_one_is(hertz: float, stamp: str) -> None:
    given = run(stamp)
    shaken = Recording("shaken", given.table | {"tau": given["tau"] + 0.08 * np.sin(2 * np.pi * hertz * given.t + 1.0)})
    found = tones_of(shaken)
    assert not [one for one in (*tones_of(given), *found) if min(abs(one - f) for f, _ in LINES) < 0.04]
    assert min(abs(one - hertz) for one in found) < 0.04
