"""What a fit looks at: nothing twice, torque alone after a step that it takes back; and the prior beside it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from wandering import posed, recorded, swing

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.candidate_fit import margin
from cosim.diagnosis.search.stages import stage
from cosim.estimation import fit as fitting
from cosim.estimation import problem as problems
from cosim.estimation import tape_cache
from cosim.estimation.equations import Equations
from cosim.estimation.fit import Fit, fit, free_parameters
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.least_squares import ENOUGH, least_squares, of_jacobian
from cosim.estimation.prepare import Piece, Prepared, prepare
from cosim.estimation.priors import trust
from cosim.estimation.problem import AT_HAND, Problem
from cosim.estimation.row_weights import weights
from cosim_studies.proof.generator import make_case, write_case
from cosim_studies.proof.tool import given
from pyfmi_models.effects import Cogging, Delay, Effect, TorqueOffset
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance
from pyfmi_models.effects.position_friction import LocalFriction
from pyfmi_models.friction import Coulomb, LuGre, Stribeck
from pyfmi_models.mount import Axis, Mount

LAW = LuGre(Fc=2.0, Fs=2.4, Vs=0.05, sigma0=5e3, sigma1=20.0, sigma2=1.5)
MOUNT = Mount(name="axis", axis=Axis(inertia=5.0), friction=LAW)
PLAY = Backlash(gap_rad=5e-3, load_share=0.3, load_friction=0.5, load_viscous=0.3)
TONE = PeriodicDisturbance(frequency_hz=3.0, amplitude=0.3)


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    """A wandering motion with friction, a ripple and noise."""
    t = np.arange(8000) / 500
    q, v, a = swing(t, [(0.5, 0.11, 0.0), (0.1, 0.37, 1.0), (0.02, 0.9, 2.0)])
    noise = 0.02 * np.random.default_rng(3).standard_normal(len(t))
    return prepare([recorded(5 * a + 2 * np.tanh(v / 0.01) + 1.5 * v + 0.4 * np.sin(20 * q) + noise, t, q)], 20.0)


def found_from(prepared: Prepared, **more: Any) -> dict[str, float]:
    start = replace(MOUNT, **more)
    return fit(start, prepared.pieces, np.ones(len(prepared.recording_of)), evaluations=60).parameters()


@pytest.mark.parametrize("effect", [PLAY, TONE, Delay(delay_ms=4.0), Cogging(cycles_per_rev=20.0, amplitude=0.4)])
def test_torque_alone_has_the_bits_of_torque_with_its_derivatives(prepared: Prepared, effect: Effect) -> None:
    mount = replace(MOUNT, effects=(effect,))
    inverse = Inverse(mount, free_parameters(mount))
    model = fitting._Model(inverse, prepared.pieces)
    there = 1.01 * inverse.present
    expected = stacked(inverse, prepared.pieces, there)[0]
    assert np.array_equal(model.torque(there), expected)
    assert np.array_equal(model.torque(there), expected)  # as after a step that was taken back
    assert np.array_equal(model.whole(there)[0], expected)
    assert not np.array_equal(model.torque(inverse.present), expected)


def test_a_rough_spot_stays_where_the_axis_was_and_that_of_a_card_where_no_recording_went(prepared: Prepared) -> None:
    spot = LocalFriction(q_center=-0.53, width=0.17, relative_amplitude=1.65)
    found = found_from(prepared, friction=Coulomb(Fc=0.1, sigma2=1.5), effects=(spot,))
    q = prepared.stacked("q")
    assert q.min() <= found["position_friction.q_center"] <= q.max()
    assert 0 < found["position_friction.width"] <= np.ptp(q)
    found = found_from(prepared, effects=(LocalFriction(q_center=9.0, width=0.2, relative_amplitude=0.5),))
    assert found["position_friction.q_center"] == pytest.approx(9.0, abs=1e-6)
    assert found["position_friction.width"] == pytest.approx(0.2, abs=1e-6)


def test_a_number_without_bounds_goes_no_further_than_its_unit_is_told_from_rounding() -> None:
    nowhere = np.array([-np.inf]), np.array([np.inf])
    own = fitting.coordinates(MOUNT, ("axis.inertia",), np.array([5.0]), nowhere)
    assert own.high == -own.low
    assert own.high + 1 > own.high == own.high + 0.4


def test_after_a_step_taken_back_torque_comes_alone(prepared: Prepared, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, bytes]] = []

    def counted(inverse: Inverse, pieces: Sequence[Piece], values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        asked.append((len(inverse.by), values.tobytes()))
        return stacked(inverse, pieces, values)

    monkeypatch.setattr(fitting, "stacked", counted)
    start = replace(MOUNT, effects=(replace(PLAY, gap_rad=0.05),))
    found = fit(start, prepared.pieces, np.ones(len(prepared.recording_of)), MOUNT, 25)
    counts = [count for count, _ in asked]
    assert 0 < counts.count(0) < len(asked) <= 25
    assert counts[0] == len(found.free)
    assert len(set(asked)) == len(asked)  # nothing is looked at twice
    torque, slopes = stacked(Inverse(found.mount, found.free), prepared.pieces, found.values)
    np.testing.assert_allclose(found.torque, torque, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.slopes, slopes, rtol=1e-6, atol=1e-6)


def test_a_prior_that_is_a_share_of_the_misfit_has_exact_derivatives() -> None:
    rng, pull = np.random.default_rng(4), fitting._Prior(np.array([2.0, 0.0, 0.5]))
    rest, slopes, values = rng.normal(size=30), rng.normal(size=(30, 3)), np.array([3.0, -1.0, 0.2])

    def rows(values: np.ndarray, at: np.ndarray) -> np.ndarray:
        return np.asarray(np.linalg.norm(rest + slopes @ (values - at)) * pull(values)[0])

    step = 1e-6 * np.eye(3)
    by_hand = [(rows(values + one, values) - rows(values - one, values)) / 2e-6 for one in step]
    np.testing.assert_allclose(pull.slopes(values, rest, slopes), np.column_stack(by_hand), rtol=1e-6, atol=1e-9)
    assert rows(values, values)[0] == pytest.approx(np.linalg.norm(rest) * np.log(1.5) / (20 * np.log(2)))
    assert rows(values, values)[1] == 0
    assert not pull.slopes(values, np.zeros(30), slopes).any()


# The least squares behind every fit: where it ends, how often it looks, bounds.

EVERYWHERE = (np.full(2, -np.inf), np.full(2, np.inf))
T = np.linspace(0, 3, 40)


def decay(x: np.ndarray) -> np.ndarray:
    """Residuals of x0 exp(-x1 t) against 2 exp(-t) with an error that no x removes."""
    return np.asarray(x[0] * np.exp(-x[1] * T) - 2 * np.exp(-T) + 0.1 * np.sin(20 * T))


def slopes(x: np.ndarray) -> np.ndarray:
    return np.column_stack([np.exp(-x[1] * T), -x[0] * T * np.exp(-x[1] * T)])


BEST = least_squares(decay, of_jacobian(slopes), np.array([0.5, 0.2]), EVERYWHERE, 50, 1e-12)


def test_it_finds_the_minimum_and_a_start_there_is_looked_at_once() -> None:
    found = least_squares(decay, of_jacobian(slopes), np.array([0.5, 0.2]), EVERYWHERE, 50)
    assert found == pytest.approx([2, 1], abs=0.03)
    assert slopes(found).T @ decay(found) == pytest.approx([0, 0], abs=1e-2)
    looked: list[np.ndarray] = []

    def seen(x: np.ndarray) -> np.ndarray:
        looked.append(x)
        return decay(x)

    assert np.array_equal(least_squares(seen, of_jacobian(slopes), BEST, EVERYWHERE, 50), BEST)
    assert len(looked) == 1


def test_a_step_is_done_while_it_promises_enough() -> None:
    lowest, aside = float(decay(BEST) @ decay(BEST)), BEST + np.array([0.02, 0.0])
    assert 1 - lowest / float(decay(aside) @ decay(aside)) > ENOUGH
    found = least_squares(decay, of_jacobian(slopes), aside, EVERYWHERE, 50)
    assert float(decay(found) @ decay(found)) == pytest.approx(lowest, rel=ENOUGH)


def test_a_step_that_a_bound_bends_uphill_is_no_end() -> None:
    bounds = (np.array([-np.inf, 0.0]), np.array([np.inf, 0.5]))
    found = least_squares(decay, of_jacobian(slopes), np.array([0.1, 0.4]), bounds, 60)
    assert found[1] == pytest.approx(0.5)
    assert slopes(found)[:, 0] @ decay(found) == pytest.approx(0, abs=2e-2)


# A structure from which an effect was taken is fitted once, whoever asks for it.


@pytest.fixture
def problem(tmp_path: Path) -> Problem:
    write_case(make_case(5000, (), duration=15.0), tmp_path)
    card, train, _ = given(str(tmp_path))
    prepared = prepare(train, 20.0)
    return Problem(card.plant(), prepared, weights(card.friction, prepared), train[0].sample_time)


def test_what_is_left_without_an_effect_is_fitted_once_and_anew_with_another_weight_or_number_of_evaluations(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[int] = []
    fit = problems.fit
    monkeypatch.setattr(problems, "fit", lambda *args, **more: made.append(1) or fit(*args, **more))
    whole = problem.fit(replace(problem.mount, effects=(*problem.mount.effects, TorqueOffset(torque=0.01))), 20)
    first = problem.without(whole, "torque_offset")
    assert problem.without(whole, "torque_offset") is first
    assert len(made) == 2
    assert first.mount.effects == problem.mount.effects
    found = problem.fit(problem.mount, 20)
    assert problem.fit(problem.mount, 20) is found
    assert problem.fit(problem.mount, 21) is not found
    half = replace(problem, weight=problem.weight * (problem.prepared.recording_of == 0))
    assert half.fit(problem.mount, 20) is not found


def test_fits_that_nobody_holds_take_no_memory(problem: Problem) -> None:
    kept: list[Fit] = [problem.fit(problem.mount, many) for many in range(1, 4)]
    assert len(problem._fits) == len(kept)
    kept.clear()
    for many in range(AT_HAND + 2):
        offset = TorqueOffset(torque=0.01 * (1 + many))
        found = problem.fit(replace(problem.mount, effects=(*problem.mount.effects, offset)), 1)
        problem.without(found, "torque_offset")
        del found
    assert len(problem._fits) <= AT_HAND
    assert np.isfinite(problem._last[0].residual).all()


# Priors of evidence: a number that is a place costs the same wherever the encoder has its zero.

AXIS = Mount(name="axis", axis=Axis(inertia=0.6), friction=Coulomb(Fc=1.1, sigma2=0.3))


@cache
def compared(zero: float) -> tuple[dict[str, float], float]:
    """Evidence of a cable and of a load off the axis, and how far the one is before the other.

    Half a minute of 3.4 degrees to either side, a load of 3 N m below the axis; the encoder's zero is elsewhere.
    """
    t = np.arange(6_000) / 200
    q, v, a = swing(t, [(0.06, 1.3, 0.0)], per=1)
    noise = 0.03 * np.random.default_rng(5).standard_normal(len(t))
    tau = 0.6 * a + 1.1 * np.sign(v) + 0.3 * v + 3 * np.sin(q) + noise
    problem = posed(AXIS, [recorded(tau, t, q + zero)], 10.0)
    comparison = Comparison.of(problem, problem.fit(AXIS, 15), POLICY)
    best = {one.effect.id: one for one in reversed(stage(comparison, problem.fit(AXIS, 15)).tried)}
    cable, load = best["cable_wrap"], best["gravity_unbalance"]
    return {name: one.evidence for name, one in best.items()}, margin(comparison, cable, load)


@pytest.mark.parametrize("zero", [0.0, 0.3, -2.0])
def test_two_effects_that_are_one_here_are_not_told_apart_by_their_priors_wherever_the_encoder_has_its_zero(zero):
    evidence, ahead = compared(zero)
    assert min(evidence["cable_wrap"], evidence["gravity_unbalance"]) > 100
    assert abs(ahead) < 3.5
    assert evidence["cable_wrap"] == pytest.approx(compared(0.0)[0]["cable_wrap"], abs=0.1)


BY_ITS_SIZE = [("cable_wrap.stiffness", 2.0), ("friction.Fc", -1.1), ("friction.sigma2", 0.3), ("axis.inertia", 2.0)]
BY_ITS_SIZE += [("friction.Vs.negative", 0.02), ("cogging.amplitude", -0.4), ("drag.Vs", 0.5)]
# A place may lie anywhere in the motion; the tangent of a shape of the law holds near the fit only.
OTHERWISE = [("cable_wrap.home", 1e-9, 0.4), ("spot.q_center", 0.0, 0.4), ("friction.Fs", 1.5, 0.15)]
OTHERWISE += [("friction.Vs", 0.02, 0.002), ("cogging.amplitude", 0.0, 1e-12), ("cogging.phase", 3.0, 1.0)]


@pytest.mark.parametrize(("name", "value", "trusted"), [*((n, v, abs(v)) for n, v in BY_ITS_SIZE), *OTHERWISE])
def test_a_number_may_be_off_by_its_size_a_shape_of_the_law_by_a_tenth(name: str, value: float, trusted: float) -> None:
    mount = replace(AXIS, friction=Stribeck(Fc=1.1, Fs=1.5, Vs=0.02, delta=2.0, sigma2=0.3))
    found: Any = SimpleNamespace(mount=mount, free=(name,), values=(value,))
    assert trust(found, 0.4) == pytest.approx([trusted])


# Tapes of structures are derived once and found on the disk from then on, and a cache that fails is none.


RIPPLED = replace(MOUNT, effects=(Cogging(cycles_per_rev=12, amplitude=0.3),))
FREE = ("friction.Fc", "axis.inertia")


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(tmp_path / "cache"))
    tape_cache._folder.cache_clear()
    yield tmp_path / "cache"
    tape_cache._folder.cache_clear()


def evaluated(mount: Mount = RIPPLED) -> list[np.ndarray]:
    """Torque and state of a structure at some rows, from expressions that are not in memory."""
    equations = Equations(mount, FREE, ("a structure", *map(type, mount.components().values())))
    columns = [np.linspace(0, 1, 50) + k for k in range(9)]
    numbers = np.array([variable.start for variable in mount.parameters()])
    affine = [one.rows([*columns, columns[0]], numbers) for one in equations._affine]
    return [equations.torque(columns[:6], numbers), *affine]


def test_what_is_on_the_disk_gives_the_same_bits(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = evaluated()
    files = {path: path.stat().st_mtime_ns for path in folder.rglob("*.tape")}
    assert files
    monkeypatch.setattr(Equations, "_symbols", property(lambda _: pytest.fail("it was derived again")))
    assert all(np.array_equal(*both) for both in zip(first, evaluated(), strict=True))
    assert files == {path: path.stat().st_mtime_ns for path in folder.rglob("*.tape")}


@pytest.mark.parametrize("damage", [b"", b"no tape", b"\xe9\x00\x00"])
def test_a_damaged_file_is_made_again(folder: Path, damage: bytes) -> None:
    first = evaluated()
    for path in folder.rglob("*.tape"):
        path.write_bytes(damage)
    assert all(np.array_equal(*both) for both in zip(first, evaluated(), strict=True))
    assert all(path.read_bytes() != damage for path in folder.rglob("*.tape"))


def test_a_folder_with_too_many_begins_anew(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = evaluated()
    old = sorted(folder.rglob("*.tape"))
    for path in old:
        path.rename(path.with_stem(f"another {path.stem}"))
    tape_cache._folder.cache_clear()
    monkeypatch.setattr(tape_cache, "MOST", 1)
    assert all(np.array_equal(*both) for both in zip(first, evaluated(), strict=True))
    assert sorted(folder.rglob("*.tape")) == old


def test_a_folder_that_cannot_be_made_is_done_without(folder: Path) -> None:
    folder.write_text("a file is in its place", "utf-8")
    assert np.isfinite(evaluated()[0]).all()


@dataclass(frozen=True)
class OwnRipple(Cogging):
    """An effect from a file of the user, whose equations may change."""


def test_an_effect_of_the_users_own_is_not_stored(folder: Path) -> None:
    evaluated(replace(MOUNT, effects=(OwnRipple(cycles_per_rev=12, amplitude=0.3),)))
    assert not list(folder.rglob("*.tape"))
