"""Identification gives back the numbers a machine was simulated with, says how sure it is, and shows known biases."""

import json
import re
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, ClassVar

import casadi as ca
import numpy as np
import pytest
from commands import call
from wandering import axis, recorded, swing

import cosim
from bench.identification import POSITIVE, multisine, the_card
from cosim.data.recording import Recording
from cosim.estimation.identify.deliver import summary
from cosim.estimation.identify.estimate import Outputs, estimate, explore, settle
from cosim.estimation.identify.friction_map import friction_map
from cosim.estimation.identify.identify import Options, free_names, identify, with_numbers
from cosim.estimation.identify.machine import Machine
from cosim.estimation.identify.presliding import presliding
from cosim.estimation.set_point import set_point
from cosim.support.errors import InputError
from cosim_studies.paper.benches import moved, step_response
from pyfmi_models.card import Card, read_card
from pyfmi_models.card_writer import card_text
from pyfmi_models.effects.thermal_viscosity import ThermalViscosity
from pyfmi_models.friction import Coulomb, FrictionLaw, Stribeck
from pyfmi_models.friction.base import MemorylessLaw
from pyfmi_models.friction.lugre_passive import PassiveLuGre
from pyfmi_models.model import Pair, Scalar, parameter


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Ten seconds in closed loop, 1e-7 rad of encoder noise."""
    return moved(the_card(), multisine(10.0), 1e-7, 3)


@pytest.fixture(scope="module")
def step() -> Recording:
    """A torque step of 1 N m that friction holds."""
    return step_response(the_card(**POSITIVE), 1.0, 1e-7, 3)


def half(card: Card, *names: str) -> Card:
    """The card with some numbers of its friction law at half their size."""
    return replace(card, friction=replace(card.friction, **{n: getattr(card.friction, n) / 2 for n in names}))


def test_derivatives_of_a_simulation_are_those_of_finite_differences() -> None:
    card = the_card()
    free = ("friction.sigma0", "friction.Fs", "axis.inertia")
    machine = Machine(card.plant().model(), card.controller_model(), free, 1e-4)
    t = np.arange(8000)[:, None] * 1e-4
    reference = 1e-3 * np.hstack([1 - np.cos(6 * t), 6 * np.sin(6 * t), 36 * np.cos(6 * t)])
    at = machine.numbers[machine.places]
    slopes = machine.run(at, reference, {})[1]
    for column, step_size in enumerate(1e-6 * at):
        shift = np.eye(3)[column] * step_size
        moved_by = machine.run(at + shift, reference, {})[0] - machine.run(at - shift, reference, {})[0]
        size = np.abs(slopes[:, :, column]).max(0)
        np.testing.assert_allclose(moved_by / (2 * step_size) / size, slopes[:, :, column] / size, atol=1e-3)


def test_inputs_that_a_recording_lacks_are_at_their_start() -> None:
    """At 20 degC, where the temperature starts, warm grease is as the card says: J v' = tau - sigma2 v."""
    warm = ThermalViscosity(viscous_per_degC=-0.1)
    plant = replace(axis(2.0), friction=Coulomb(Fc=0.0, sigma2=4.0), effects=(warm,))
    t = np.arange(4000) * 1e-4
    q = Machine(plant.model(), None, (), 1e-4).run(np.zeros(0), np.full((4000, 1), 3.0), {})[0][:, 0]
    np.testing.assert_allclose(q, 0.75 * (t - 0.5 * (1 - np.exp(-2 * t))), atol=1e-9)


def test_output_error_recovers_the_bristles_within_one_per_cent_from_starts_a_factor_of_two_off(recording):
    true = the_card().friction
    wrong = half(the_card(), "sigma0", "sigma1", "Fc", "Fs")
    found = identify([recording], wrong, Options(free=("sigma0", "sigma1", "sigma2", "Fc", "Fs", "Vs"), starts=1))
    assert found.card.friction.sigma0 == pytest.approx(true.sigma0, rel=0.01)
    assert found.card.friction.sigma1 == pytest.approx(true.sigma1, rel=0.01)
    truth = np.array([getattr(true, name.split(".")[1]) for name in found.best.names])
    assert np.all(np.abs(found.best.values - truth) < 5 * found.best.standard_errors)


def test_what_a_recording_does_not_excite_is_said_to_be_unknown() -> None:
    rate = 2 * np.pi * 0.2
    tracking = moved(the_card(), 3.6e-4 / rate * (1 - np.cos(rate * np.arange(6000) / 1000)), 1e-7, 3)
    found = identify([tracking], the_card(), Options(free=("sigma0", "Vs", "delta", "Fc"), starts=1))
    assert any("Vs" in warning for warning in found.best.warnings)
    assert not any("sigma0" in warning for warning in found.best.warnings)


def test_a_start_is_looked_at_and_only_the_best_is_settled() -> None:
    """Three starts of a Stribeck curve: the others stop early, the best ends at the truth of noiseless data."""
    v = np.linspace(0.01, 2.0, 500)
    truth = np.array([3.0, 4.0, 0.3])

    def model(p: np.ndarray) -> Outputs:
        true_fall, fall = np.exp(-v / truth[2]), np.exp(-v / p[2])
        off = truth[0] + (truth[1] - truth[0]) * true_fall - p[0] - (p[1] - p[0]) * fall
        slopes = np.stack([1 - fall, fall, (p[1] - p[0]) * fall * v / p[2] ** 2], axis=1)
        return Outputs(off[:, None], slopes[:, None, :])

    names, starts = ("Fc", "Fs", "Vs"), np.array([[2.0, 6.0, 0.9], [5.0, 5.5, 0.1], [1.0, 9.0, 1.5]])
    looked = [explore(names, start, model, None, 25) for start in starts]
    best = settle(min(looked, key=lambda one: one.rms[0]), model)
    assert all(one.evaluations <= 25 for one in looked)
    np.testing.assert_allclose(best.values, truth, rtol=1e-6)
    assert best.evaluations > min(one.evaluations for one in looked)


def test_the_linear_presliding_fit_is_biased_as_published_and_the_direct_one_is_not_also_of_damping_that_fades(step):
    card, true = the_card(**POSITIVE), [POSITIVE["sigma0"], POSITIVE["sigma1"]]
    found = presliding(half(card, "sigma0", "sigma1"), step)
    assert found.linear.values / true == pytest.approx([0.56, 3.5], rel=0.02)
    assert found.direct.values[:2] / true == pytest.approx([1, 1], rel=0.003)
    numbers = {one.name: getattr(card.friction, one.name) for one in fields(card.friction)}
    fading = replace(card, friction=PassiveLuGre(**numbers))
    found = presliding(half(fading, "sigma0", "sigma1"), step_response(fading, 1.0, 1e-7, 3))
    assert found.direct.values[:2] / true == pytest.approx([1, 1], rel=0.003)


@pytest.fixture(scope="module")
def quasi_static() -> Recording:
    """One period of the paper's quasi-static sine: 0.04 Hz, peak 0.056 rad/s."""
    rate = 2 * np.pi * 0.04
    return moved(the_card(**POSITIVE), 0.056 / rate * (1 - np.cos(rate * np.arange(25_000) / 1000)), 0.0, 0)


def test_the_friction_map_is_right_with_inertia_kept_and_wrong_without(quasi_static: Recording) -> None:
    v = np.linspace(4e-3, 0.055, 50)
    fall = np.exp(-((v / POSITIVE["Vs"]) ** POSITIVE["delta"]))
    true = POSITIVE["Fc"] + (POSITIVE["Fs"] - POSITIVE["Fc"]) * fall + POSITIVE["sigma2"] * v
    kept = friction_map([quasi_static], 30.0, 4e-3)
    dropped = friction_map([quasi_static], 30.0, 4e-3, keep_inertia=False)
    for direction in kept.fits:
        assert np.abs(kept.curve(direction, v)[0] - true).max() < 0.05
    assert np.abs(dropped.curve("positive", v)[0] - true).max() > 0.1


def test_a_step_in_the_friction_map_ends_at_the_steepest_curve_of_the_law(quasi_static: Recording) -> None:
    """No exponent is steep enough for a step; beyond the law's limit its powers overflow."""
    speed = np.gradient(quasi_static["q"], quasi_static.t)
    stepped = np.sign(speed) * np.where(np.abs(speed) < 0.03, 4.0, 3.0) + 0.1 * speed
    fits = friction_map([replace(quasi_static, table={**quasi_static.table, "tau": stepped})], 0.0, 4e-3).fits
    for fit in fits.values():
        assert np.isfinite(fit.values).all()
        assert 4 < fit.values[3] <= 5


def test_standard_errors_are_those_of_least_squares() -> None:
    rng, x = np.random.default_rng(0), np.linspace(1, 2, 5000)

    def model(values: np.ndarray) -> Outputs:
        return Outputs((y - values[0] * x)[:, None], x[:, None, None])

    estimates = []
    for _ in range(40):
        y = 3 * x + 0.1 * rng.standard_normal(5000)
        estimates.append(estimate(("slope",), np.array([1.0]), model))
    theory = 0.1 / np.linalg.norm(x)  # of least squares with white noise of 0.1
    assert np.mean([fit.standard_errors[0] for fit in estimates]) == pytest.approx(theory, rel=0.02)
    # The spread of 40 slopes is known to 11 %: three times that.
    assert np.std([fit.values[0] for fit in estimates]) == pytest.approx(theory, rel=0.33)


def test_names_may_leave_out_their_prefix_unknown_ones_are_refused_and_what_a_structure_lacks_is_left_out() -> None:
    card = read_card("paper_mount")
    assert free_names(card, ("Fc", "inertia")) == ("friction.Fc", "axis.inertia")
    with pytest.raises(InputError, match=r'"Fd" is no parameter .* friction\.Fc'):
        free_names(card, ("Fd",))
    assert with_numbers(card, {"friction.Fc": 2.0, "friction.Fc.positive": 3.0}).friction.Fc == 2.0


def test_the_summary_warns_of_numbers_that_depend_on_each_other_and_says_how_well_the_curve_is_known(quasi_static):
    card = the_card(**POSITIVE)
    found = identify([quasi_static], card, Options(free=("sigma0",), starts=1))
    text = summary(found, card)
    assert "Mind, positive: these numbers cannot be told apart here, their curve can: within 0.00" in text
    assert any("correlate" in warning for warning in found.map.fits["positive"].warnings)


def test_the_verb_writes_card_numbers_and_pictures(recording: Recording, step: Recording, tmp_path: Path) -> None:
    paths = [one.write(tmp_path / f"{name}.parquet") for name, one in (("loop", recording), ("step", step))]
    card = tmp_path / "axis.toml"
    card.write_text(card_text(the_card()), "utf-8")
    out = tmp_path / "out"
    arguments = ["identify", *map(str, paths), "--card", str(card), "--out", str(out), "--starts", "1"]
    assert call(*arguments, "--free", "sigma0", "--free", "sigma1") == 0
    found = json.loads((out / "identify.json").read_text("utf-8"))
    assert found["output_error"][0]["standard_errors"]["friction.sigma0"] > 0
    assert set(found["presliding"]) == {"step"}
    assert read_card(out / "card.toml").origin["recordings"][0]["name"] == "loop"
    assert {"friction_map.svg", "presliding.svg", "output_error.svg"} <= {path.name for path in out.iterdir()}
    assert call(*arguments) == 2


# The card's own law, at the rate of new readings, and which numbers nothing determines.


@dataclass(frozen=True, kw_only=True)
class Grease(MemorylessLaw):
    """A law of the user's own: it yields, then thins: [Fc + K |v|^n] sign(v)."""

    key: ClassVar[str] = "grease"
    linear: ClassVar[tuple[str, ...]] = ("Fc", "K")
    Fc: Scalar = parameter("N.m", "Level", low=0)
    K: Scalar = parameter("N.m", "Torque beyond the level at 1 rad/s", low=0)
    n: Scalar = parameter("1", "Exponent", default=0.5, low=0.1, high=1)
    tilt: Scalar = parameter("1", "Of no consequence here", default=0.3)

    def level(self, v: Scalar) -> Scalar:
        return self.Fc

    def viscous(self, v: Scalar) -> Scalar:
        return self.K * v * ca.exp((self.n - 1) / 2 * ca.log(v * v + 1e-12))


@dataclass(frozen=True, kw_only=True)
class Silent(FrictionLaw):
    """A law that does not say what it is in steady sliding."""

    key: ClassVar[str] = "silent"
    Fc: Scalar = parameter("N.m", "Level", low=0)


SLOW = Coulomb(Fc=2.0, sigma2=8.0)


def card_of(law: FrictionLaw) -> Card:
    """A card without a controller: the map alone."""
    return replace(read_card("paper_mount"), friction=law, controller=None, unbalance=None, effects=())


def slow(law: Any) -> Recording:
    """Three periods of a slow sine, without a set point."""
    t = np.arange(15_000) / 250
    q, v, a = swing(t, [(0.4 / (0.1 * np.pi), 0.05, -np.pi / 2)])
    friction = [float(law.level(one) + law.viscous(one)) for one in np.abs(v[::25]) + 1e-9]
    noise = np.random.default_rng(0).normal(0, 0.01, len(t))
    return recorded(np.interp(t, t[::25], friction) * np.sign(v) + 30 * a + noise, t, q)


@pytest.mark.parametrize(
    ("believed", "truth", "names"),
    [
        (Grease(Fc=1.0, K=4.0, n=0.5), Grease(Fc=2.0, K=3.0, n=0.7), ("Fc", "K", "n")),
        (Coulomb(Fc=5.0, sigma2=3.0), SLOW, ("Fc", "sigma2")),
        (Coulomb(Fc=5.0, sigma2=0.0), SLOW, ("Fc", "sigma2")),
        (Coulomb(Fc=Pair(5.0, 4.0), sigma2=3.0), SLOW, ("Fc.positive", "Fc.negative")),
        (Stribeck(Fc=5.0, sigma2=3.0), SLOW, ("Fc", "sigma2")),
        (Stribeck(Fc=3.0, Fs=5.0, Vs=0.1, sigma2=3.0), Stribeck(Fc=2.0, Fs=4.0, Vs=0.07, sigma2=8.0), ("Fc", "Vs")),
    ],
)
def test_the_cards_own_law_is_fitted(believed: FrictionLaw, truth: FrictionLaw, names: tuple[str, ...]) -> None:
    found = identify([slow(truth)], card_of(believed), Options(free=tuple(f"friction.{name}" for name in names)))
    assert type(found.card.friction) is type(believed)
    numbers = {one.name: one.start for one in found.card.plant().parameters()}
    for name in names:
        assert numbers[f"friction.{name}"] == pytest.approx(getattr(truth, name.split(".")[0]), rel=0.05), name
    assert found.kept == ()


def test_numbers_that_nothing_fits_are_said_and_stay(tmp_path: Path) -> None:
    card = card_of(Coulomb(Fc=5.0, sigma2=3.0))
    done = cosim.identify(slow(SLOW), card, tmp_path / "out")
    told = json.loads((tmp_path / "out" / "identify.json").read_text())["not_determined"]
    assert set(told) == {"axis.inertia"}
    assert told["axis.inertia"]["value"] == card.mount.inertia
    assert "Not determined by them, and as in the given card: axis.inertia." in (tmp_path / "out/card.toml").read_text()
    assert "Without a simulated loop no way here determines the inertia (axis.inertia)" in str(done)


def test_one_speed_leaves_a_number_at_the_cards_and_prints_none_that_its_error_swamps() -> None:
    t = np.arange(12_500) / 250
    v = np.where(np.floor(t / 5) % 2, -0.2, 0.2)
    tau = 4.0 * np.sign(v) + np.random.default_rng(1).normal(0, 0.05, len(t))
    given = Recording("one_speed", {"t": t, "tau": tau, "q": np.cumsum(v) / 250})
    card = card_of(Stribeck(Fc=3.0, Fs=5.0, Vs=0.01, sigma2=3.0))
    found = identify([given], card, Options())
    assert len([name for name in found.kept if name.startswith("friction.")]) >= 3
    new, old = ({one.name: one.start for one in c.plant().parameters()} for c in (found.card, card))
    assert all(new[name] == old[name] for name in found.kept)
    assert float(found.card.friction.level(0.2) + found.card.friction.viscous(0.2)) == pytest.approx(4.0, rel=0.05)
    text = summary(found, card)
    assert "not determined" in text
    assert not re.search(r"\de[+-]\d", text)


def test_a_law_that_cannot_be_fitted_writes_no_card(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has no torque in steady sliding"):
        cosim.identify(slow(SLOW), card_of(Silent(Fc=2.0)), tmp_path / "out", free=("Fc",))
    assert not (tmp_path / "out" / "card.toml").exists()


@pytest.mark.parametrize("column", ["tau", "q"])
def test_repeated_readings_are_taken_at_their_own_rate(column: str) -> None:
    """A torque or a position that is new every 60 ms in rows of 4 ms: late by 30 ms on average, in a quick motion."""
    t = np.arange(15_000) / 250
    v, a = 0.3 * np.sin(2.5 * t), 0.75 * np.cos(2.5 * t)
    table = {"t": t, "tau": 2 * np.sign(v) + 8 * v + 30 * a, "q": -0.12 * np.cos(2.5 * t)}
    table[column] = table[column][np.arange(len(t)) // 15 * 15]
    random = np.random.default_rng(0).normal(0, 1e-3, len(t))[np.arange(len(t)) // 15 * 15]
    table["tau"] = table["tau"] + random
    given = Recording("held", table)
    found = identify([given], card_of(Coulomb(Fc=5.0, sigma2=3.0)), Options(free=("Fc", "sigma2")))
    assert found.card.friction.sigma2 == pytest.approx(8.0, rel=0.1)
    assert found.card.friction.Fc == pytest.approx(2.0, rel=0.1)


def test_a_set_point_that_is_repeated_is_as_smooth_as_it_was() -> None:
    t = np.arange(5000) / 1000
    wanted = 0.1 * np.sin(2 * t)
    held = Recording("run", {"t": t, "tau": t, "q": wanted, "q_d": wanted[np.arange(5000) // 20 * 20]})
    got = set_point(held, 1e-3)
    inside = slice(200, 4700)
    assert np.abs(got["a_d"] + 0.4 * np.sin(2 * t[: len(got["a_d"])]))[inside].max() < 0.01
