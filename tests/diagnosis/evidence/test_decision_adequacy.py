"""How large what is left is: on motions of which every number is known."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from motions import RATE, TORQUE, Array, Motion
from problems import compared, problem_of
from wandering import axis, recorded, swing

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.adequacy import over_time, share_beside, share_left, share_there
from cosim.diagnosis.evidence.discrepancy import WAVES, Discrepancy, discrepancy
from cosim.diagnosis.evidence.marginal import Group, Marginal, marginal
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.evidence.structure import Structure
from cosim.diagnosis.search.candidate_fit import weighed
from cosim.estimation.prepare import Prepared, prepare
from cosim.estimation.problem import Problem
from pyfmi_models.effects import FrictionAsymmetry
from pyfmi_models.effects.quadratic_drag import QuadraticDrag


def comparing(motion: Motion, level: float | Array, weight: Array | None = None) -> Any:
    rows = len(motion.stacked("v"))
    problem = SimpleNamespace(prepared=motion, weight=np.ones(rows) if weight is None else weight)
    return SimpleNamespace(problem=problem, nuisances=SimpleNamespace(level=np.broadcast_to(level, rows)))


def steady(seconds: int) -> Motion:
    return Motion({"v": [np.ones(seconds * RATE)], "tau": [np.full(seconds * RATE, TORQUE)]})


def left(residual: Array) -> Any:
    return SimpleNamespace(residual=residual)


RIGHT = left(np.zeros(4 * RATE))  # leaves nothing in training


def elsewhere(v: Array, moved: Array | None = None, **other: Array) -> Any:
    """Held-out recordings at a speed, and what may be otherwise there."""
    columns = np.empty((len(v), 0)) if moved is None else moved
    return SimpleNamespace(
        prepared=Motion({"v": [v], **{name: [one] for name, one in other.items()}}), moved=lambda _: columns
    )


FAST = np.tile([1.0, -1.0], 2 * RATE)


@pytest.mark.parametrize(("rest", "share"), [(0.5 + 0 * FAST, 0.25), (FAST, 0.0), (0.5 + FAST, 0.25)])
def test_a_rest_that_changes_within_a_quarter_of_a_second_is_none(rest: Array, share: float) -> None:
    assert share_left(comparing(steady(4), 2.0), left(rest)) == pytest.approx(share, rel=1e-12, abs=1e-12)


def test_only_rows_in_clear_motion_count_by_their_weight() -> None:
    motion = Motion({"v": [np.repeat([1.0, 0.0], 2 * RATE)], "tau": [np.full(4 * RATE, 2.0)]})
    rest = np.repeat([0.5, 9.0], 2 * RATE)
    assert share_left(comparing(motion, np.repeat([1.0, 7.0], 2 * RATE)), left(rest)) == pytest.approx(0.5, rel=1e-12)
    weight = np.repeat([1.0, 0.0, 1.0], [RATE, RATE, 2 * RATE])
    rest = np.repeat([0.5, 3.0, 9.0], [RATE, RATE, 2 * RATE])
    assert share_left(comparing(motion, 1.0, weight), left(rest)) == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize(("level", "expected"), [(2.0, 0.25), (0.3, 0.5 / 0.3), (0.1, 0.5 / 0.2), (0.0, 0.5 / 0.2)])
def test_where_friction_is_small_a_tenth_of_the_torque_stands_for_it(level: float, expected: float) -> None:
    assert share_left(comparing(steady(2), level), left(np.full(2 * RATE, 0.5))) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("open_", "wrong", "expected"), [(2.0, 0.0, 0.0), (0.02, 0.0, 0.125), (0.0, 0.0, 0.25), (0.1, 0.4, 0.2)]
)
def test_what_training_leaves_open_is_not_left_elsewhere(open_: float, wrong: float, expected: float) -> None:
    """A rest of 1 N m of 4; a number whose error there is `open_` N m moves by one error.

    Cells are as uncertain as those of training are wrong, .04 N m at least.
    """
    there = elsewhere(np.ones(RATE), np.full((RATE, 1), open_))
    moved = 4 * open_**2
    told = 1 - moved / (moved + max(wrong, 0.04) ** 2)
    found = share_there(comparing(steady(2), 4.0), left(np.full(2 * RATE, wrong)), np.ones(RATE), there)
    assert found == pytest.approx(0.25 * told, rel=1e-9)
    assert found == pytest.approx(expected, abs=0.01)


def test_friction_of_training_is_that_of_clear_motion_by_its_weight() -> None:
    there = elsewhere(np.ones(RATE))
    motion = Motion({"v": [np.repeat([1.0, 0.0], 2 * RATE)], "tau": [np.full(4 * RATE, 2.0)]})
    level, weight = (
        np.repeat([2.0, 6.0, 70.0], [RATE, RATE, 2 * RATE]),
        np.repeat([3.0, 1.0, 5.0], [RATE, RATE, 2 * RATE]),
    )
    clear = np.r_[np.full(RATE, 3.0), np.full(RATE - 1, 1.0)]  # the last row before the rest is near a turn
    expected = 1.0 / np.sqrt(clear @ level[: 2 * RATE - 1] ** 2 / clear.sum())
    assert share_there(comparing(motion, level, weight), RIGHT, np.ones(RATE), there) == pytest.approx(
        expected, rel=1e-3
    )


SECONDS = np.arange(8 * RATE) / RATE
TURNING = np.sign(np.sin(2 * np.pi * SECONDS) + 1e-9)
DRIFT = np.sin(2 * np.pi * SECONDS / 8)
LATE, EARLY = np.clip(SECONDS - 4, 0, 1), 0.2 * np.clip(2 - SECONDS, 0, 1)


@pytest.mark.parametrize("size", [1.0, 1e-6])
@pytest.mark.parametrize(
    ("rests", "shown"),
    [
        pytest.param([DRIFT, 0.5 * DRIFT], "time", id="a torque over time"),
        pytest.param([TURNING * DRIFT] * 2, "friction level over time", id="a friction level over time"),
        pytest.param([TURNING * DRIFT, 0.5 * DRIFT], "friction level over time", id="the level in the louder one"),
        pytest.param([LATE + TURNING * EARLY], "time", id="a torque that begins late"),
        pytest.param([TURNING * LATE + EARLY], "friction level over time", id="a level that begins late"),
    ],
)
def test_a_torque_or_a_level_over_time_whichever_explains_more(rests: list[Array], shown: str, size: float) -> None:
    turning = [TURNING] * len(rests)
    comparison = comparing(Motion({"v": turning, "tau": turning}), np.concatenate(turning))
    assert over_time(comparison, left(size * np.concatenate(rests))) == shown


@pytest.mark.parametrize("axis", ["q", "v", "tau"])
def test_what_is_left_where_training_never_was_is_nothing_left(axis: str) -> None:
    comparison, rest = comparing(steady(4), 2.0), np.repeat([0.0, 1.0], 2 * RATE)
    rows = {"q": np.zeros(4 * RATE), "v": np.ones(4 * RATE), "tau": np.full(4 * RATE, TORQUE)}
    inside = elsewhere(**{name: one.copy() for name, one in rows.items()})
    assert share_there(comparison, RIGHT, rest, inside) > 0.3
    rows[axis][2 * RATE :] += 0.1
    assert share_there(comparison, RIGHT, rest, elsewhere(**rows)) < 0.01


# What a machine is off the equation of a named effect is no evidence of another one.

MOUNT = axis()
DRAG, EVEN = QuadraticDrag(coefficient=6.0), FrictionAsymmetry(level_asymmetry=0.0, viscous_asymmetry=0.0)


def oiled(drag_one_way: float = 0.0, level_one_way: float = 0.0, phase: float = 1.0) -> Problem:
    """An axis in oil; its drag, or its friction level, is larger by this share forward and smaller backward."""
    t = np.arange(8000) / 200
    q, v, a = swing(t, [(0.5, 0.9, 2 * phase), (0.1, 3.1, 2.0 + phase), (0.02, 7.0, 0.5 + phase)], per=1)
    way = np.sign(v)
    tau = 5 * a + 2 * way * (1 + level_one_way * way) + v + 6 * v * np.abs(v) * (1 + drag_one_way * way)
    return problem_of(MOUNT, recorded(tau + 0.01 * np.random.default_rng(1).standard_normal(len(t)), t, q))


@pytest.mark.parametrize(
    ("one_way", "low", "high"),
    [
        pytest.param({"drag_one_way": 0.12}, -np.inf, POLICY.clear, id="a drag that is stronger one way is none"),
        pytest.param({"level_one_way": 0.1}, POLICY.strong, np.inf, id="a level that is higher one way is one"),
    ],
)
def test_evidence_of_a_friction_asymmetry_beside_a_drag(one_way: dict[str, float], low: float, high: float) -> None:
    comparison, _ = compared(oiled(**one_way), 30)
    alone, both = (comparison.problem.fit(replace(MOUNT, effects=some), 30) for some in ((DRAG,), (DRAG, EVEN)))
    assert low < weighed(comparison, both, alone).evidence < high


@pytest.mark.parametrize(("one_way", "is_left"), [(0.15, False), (0.6, True)])
def test_what_an_equation_may_miss_is_no_rest_and_what_no_machine_misses_is(one_way: float, is_left: bool) -> None:
    comparison, base = compared(oiled(drag_one_way=one_way), 30)
    there = oiled(drag_one_way=one_way, phase=2.0).prepared
    found = comparison.problem.fit(replace(MOUNT, effects=(DRAG,)), 30)
    held = Predictive.of(comparison, there, base, there)
    share = share_beside(comparison, found, held.residual(found.mount), held)
    assert (share > POLICY.slight) is is_left


def test_what_a_rest_follows_is_asked_beside_what_named_equations_may_miss_not_beside_those_of_the_card() -> None:
    problem = oiled(drag_one_way=0.12)
    with_drag = replace(MOUNT, effects=(DRAG,))
    speed = np.abs(problem.prepared.stacked("v"))
    column = (speed / np.sqrt(np.mean(speed**2)))[:, None]
    named, known = (
        compared(one, 30)[0].group(one.fit(with_drag, 30), column)[0]
        for one in (problem, replace(problem, mount=with_drag))
    )
    assert named < 0.5 * known
    assert known > POLICY.sure


# The marginal likelihood of a structure, against the dense Gaussian density that it stands for.

Array = npt.NDArray[np.float64]
DICE = np.random.default_rng(18)
FREE = np.array([2.0, 0.5, 9.0, 9.0])
"""Prior standard deviations; those of the last two columns are of a group, so that they do not count."""
START = Marginal(0.0, np.array([0.3, 2.0]), np.array([0.7]), np.zeros(4))


def bands(noise: Array, *rows: int) -> list[tuple[Array, Array]]:
    """Targets and columns of each band, drawn from the model."""
    beta = np.array([1.0, -0.4, *0.4 * DICE.standard_normal(2)])
    drawn = []
    for many, variance in zip(rows, noise, strict=True):
        x = DICE.standard_normal((many, 4))
        drawn.append((x @ beta + np.sqrt(variance) * DICE.standard_normal(many), x))
    return drawn


def found(drawn: list[tuple[Array, Array]], free: Array = FREE, floor: float = 0.0, **more: Any) -> Marginal:
    grams = np.array([np.column_stack([y, x]).T @ np.column_stack([y, x]) for y, x in drawn])
    count = np.array([float(len(y)) for y, _ in drawn])
    return marginal(grams, free, (Group([2, 3], 0.5),), count, count, np.full(len(drawn), floor), **more)


def test_noise_and_sizes_that_are_renewed_explain_the_data_better_and_come_near_the_truth() -> None:
    true = np.array([0.25, 4.0])
    drawn = bands(true, 4000, 4000)
    likelihoods = [found(drawn, rounds=rounds).log_likelihood for rounds in (0, 1, 2, 6)]
    assert likelihoods == sorted(likelihoods)
    assert likelihoods[0] < likelihoods[1]
    assert found(drawn).noise == pytest.approx(true, rel=0.1)
    assert found(drawn, floor=5.0).noise == pytest.approx([5.0, 5.0])


@pytest.fixture(params=["compiled", "interpreted"])
def _way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "interpreted":
        monkeypatch.setattr("cosim.diagnosis.evidence.marginal.library", lambda: None)


@pytest.mark.usefixtures("_way")
def test_renewed_noise_is_the_mean_square_left_with_the_uncertainty_of_the_fit() -> None:
    drawn = bands(START.noise, 40, 70)
    begun, renewed = (found(drawn, start=START, rounds=rounds) for rounds in (0, 1))
    prior = np.diag(1 / np.array([2.0, 0.5, 0.7, 0.7]) ** 2)
    normal = sum((x.T @ x / variance for (_, x), variance in zip(drawn, START.noise, strict=True)), prior)
    covariance = np.linalg.inv(normal)
    expected = [
        (float(np.sum((y - x @ begun.beta) ** 2)) + float(np.trace(covariance @ x.T @ x))) / len(y) for y, x in drawn
    ]
    assert renewed.noise == pytest.approx(expected, rel=1e-9)
    mean = float(np.mean(begun.beta[2:] ** 2 + np.diag(covariance)[2:]))
    size = renewed.sizes[0]
    assert size**2 / mean + size**4 / (2 * mean * 0.5**2) == pytest.approx(1.0, rel=1e-9), "the slope is zero there"


def test_priors_without_bound_are_numbers_all_the_same() -> None:
    told = found(bands(START.noise, 40, 70), np.array([1e300, 1e-300, 1.0, 1.0]))
    assert np.isfinite(told.log_likelihood)
    assert abs(told.beta[1]) < 1e-12


def dense(
    grams: Array, free: Array, group: Group, size: float, count: Array, effective: Array, floor: Array
) -> tuple[float, Array, Array]:
    """`marginal` without its rounds: noise and sizes as they begin, by inverses and determinants."""
    noise = np.maximum(grams[:, 0, 0] / count, floor)
    variance = np.square(free)
    variance[group.columns] = max(size, 1e-6 * group.prior) ** 2
    weight = effective / count / noise
    normal = np.tensordot(weight, grams[:, 1:, 1:], 1) + np.diag(1 / variance)
    target = weight @ grams[:, 1:, 0]
    beta = np.linalg.solve(normal, target)
    energy = weight @ grams[:, 0, 0] - target @ beta
    penalty = (size / group.prior) ** 2 / 2
    sizes = np.linalg.slogdet(normal)[1] + np.log(variance).sum()
    return -(effective @ np.log(noise) + energy + sizes) / 2 - penalty, noise, beta


@pytest.mark.usefixtures("_way")
@pytest.mark.parametrize("relative", [1.0, 0.01, 1e-4, 1e-9])
def test_a_marginal_likelihood_without_rounds_is_the_gaussian_integral(relative: float) -> None:
    """From sizes that are given too, down to a millionth of the prior, where a size counts as that."""
    rng = np.random.default_rng(1)
    bands = [rng.normal(0, 1, (50, 5)) for _ in range(2)]
    grams = np.array([one.T @ one for one in bands])
    count, effective, floor = np.array([50.0, 50.0]), np.array([50.0, 11.0]), np.array([1e-9, 2.0])
    free, group = np.array([3.0, 0.5, 1.0, 1.0]), Group(np.array([2, 3]), 0.7)
    expected, noise, beta = dense(grams, free.copy(), group, size := relative * 0.7, count, effective, floor)
    start = None if relative == 1.0 else Marginal(0.0, noise, np.array([size]), beta)
    found = marginal(grams, free.copy(), [group], count, effective, floor, start, rounds=0)
    assert found.log_likelihood == pytest.approx(expected, rel=1e-8)
    np.testing.assert_allclose(found.noise, noise)
    np.testing.assert_allclose(found.beta, beta, rtol=1e-7, atol=1e-14)
    np.testing.assert_allclose(found.sizes, [size])


# Nuisances of a comparison: how many there are, and that holes in time do not make more of them.


def holed(name: str, holes: tuple[float, ...] = ()) -> Recording:
    """A minute of motion at 200 Hz, half a second left out at each of `holes` [s]."""
    t = np.arange(12_000) / 200
    t = t[[not any(hole <= one < hole + 0.5 for hole in holes) for one in t]]
    q, v, a = swing(t, [(0.3, 0.9, 0.0)], per=1)
    return recorded(2 * np.sign(v) + v + 5 * a, t, q, name)


def made(*recordings: Recording) -> tuple[Prepared, Discrepancy]:
    prepared = prepare(recordings, 10.0)
    return prepared, discrepancy(axis(), prepared, POLICY)


def test_a_level_is_one_before_a_hole_and_after_it() -> None:
    whole, cut = (made(holed("a", holes)) for holes in ((), (20.0, 40.0)))
    rows = [
        np.flatnonzero(np.isin(np.round(w.stacked("t"), 6), np.round(o.stacked("t"), 6)))
        for w, o in ((whole[0], cut[0]), (cut[0], whole[0]))
    ]
    columns = [one.columns[:, one.groups[-1].columns] for _, one in (whole, cut)]
    smooth = np.abs(whole[0].stacked("v")[rows[0]]) > 0.1  # filters remember the ends of a piece where friction turns
    assert columns[0][rows[0]][smooth] == pytest.approx(columns[1][rows[1]][smooth], abs=0.05)
    assert np.abs(columns[0]).max() > 1


def test_a_recording_has_no_share_in_the_wander_of_another() -> None:
    prepared, found = made(holed("a"), holed("b", (30.0,)))
    wander = found.columns[:, found.groups[-1].columns]
    assert not wander[prepared.recording_of == 1, :WAVES].any()
    assert not wander[prepared.recording_of == 0, WAVES:].any()


# How far training leaves the numbers of a structure open.


def test_changes_of_one_standard_error_make_up_the_covariance() -> None:
    spread = np.array([[4.0, 1.0], [1.0, 9.0]])
    found = Structure(axis(), ("a", "b"), np.zeros(2), spread).directions((0, 1))
    np.testing.assert_allclose(found @ found.T, spread, rtol=1e-12)


def test_a_number_of_which_training_says_nothing_leaves_the_others_as_they_are() -> None:
    """A rough spot that a fit had sent away, to 3e77, ended a diagnosis: its variance is no number."""
    spread = np.array([[4.0, np.nan, 0.0], [np.nan, np.inf, np.nan], [0.0, np.nan, 1e308]])
    found = Structure(axis(), ("a", "b", "c"), np.zeros(3), spread).directions((0, 1, 2))
    assert np.isfinite(found).all()
    np.testing.assert_allclose((found @ found.T)[0, 0], 4.0)
