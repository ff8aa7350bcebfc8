"""Identification gives back the numbers a machine was simulated with, says how sure it is, and shows known biases."""

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from commands import call

from bench.identification import POSITIVE, multisine, the_card
from cosim.data.recording import Recording
from cosim.estimation.identify.deliver import summary
from cosim.estimation.identify.estimate import Outputs, estimate, explore, settle
from cosim.estimation.identify.friction_map import friction_map
from cosim.estimation.identify.identify import Options, free_names, identify, with_numbers
from cosim.estimation.identify.machine import Machine
from cosim.estimation.identify.presliding import presliding
from cosim.support.errors import InputError
from cosim_studies.paper.benches import moved, step_response
from pyfmi_models.card import Card, read_card
from pyfmi_models.effects.thermal_viscosity import ThermalViscosity
from pyfmi_models.friction import Coulomb
from pyfmi_models.friction.lugre_passive import PassiveLuGre
from pyfmi_models.mount import Axis, Mount


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
    plant = Mount(
        name="m",
        axis=Axis(inertia=2.0),
        friction=Coulomb(Fc=0.0, sigma2=4.0),
        effects=(ThermalViscosity(viscous_per_degC=-0.1),),
    )
    t = np.arange(4000) * 1e-4
    q = Machine(plant.model(), None, (), 1e-4).run(np.zeros(0), np.full((4000, 1), 3.0), {})[0][:, 0]
    np.testing.assert_allclose(q, 0.75 * (t - 0.5 * (1 - np.exp(-2 * t))), atol=1e-9)


def test_output_error_recovers_the_bristles_within_one_per_cent_from_starts_a_factor_of_two_off(
    recording: Recording,
) -> None:
    true = the_card().friction
    wrong = half(the_card(), "sigma0", "sigma1", "Fc", "Fs")
    found = identify([recording], wrong, Options(free=("sigma0", "sigma1", "sigma2", "Fc", "Fs", "Vs"), starts=1))
    assert found.best is not None
    assert found.card.friction.sigma0 == pytest.approx(true.sigma0, rel=0.01)  # type: ignore[attr-defined]
    assert found.card.friction.sigma1 == pytest.approx(true.sigma1, rel=0.01)  # type: ignore[attr-defined]
    truth = np.array([getattr(true, name.split(".")[1]) for name in found.best.names])
    assert np.all(np.abs(found.best.values - truth) < 5 * found.best.standard_errors)


def test_what_a_recording_does_not_excite_is_said_to_be_unknown() -> None:
    rate = 2 * np.pi * 0.2
    tracking = moved(the_card(), 3.6e-4 / rate * (1 - np.cos(rate * np.arange(6000) / 1000)), 1e-7, 3)
    found = identify([tracking], the_card(), Options(free=("sigma0", "Vs", "delta", "Fc"), starts=1))
    assert found.best is not None
    assert any("Vs" in warning for warning in found.best.warnings)
    assert not any("sigma0" in warning for warning in found.best.warnings)


def test_a_start_is_looked_at_and_only_the_best_is_settled() -> None:
    """Three starts of a Stribeck curve: the others stop early, the best ends at the truth of noiseless data."""
    v = np.linspace(0.01, 2.0, 500)
    truth = np.array([3.0, 4.0, 0.3])

    def curve(p: np.ndarray) -> np.ndarray:
        return np.asarray(p[0] + (p[1] - p[0]) * np.exp(-v / p[2]))

    def model(p: np.ndarray) -> Outputs:
        fall = np.exp(-v / p[2])
        slopes = np.stack([1 - fall, fall, (p[1] - p[0]) * fall * v / p[2] ** 2], axis=1)
        return Outputs((curve(truth) - curve(p))[:, None], slopes[:, None, :])

    names, starts = ("Fc", "Fs", "Vs"), np.array([[2.0, 6.0, 0.9], [5.0, 5.5, 0.1], [1.0, 9.0, 1.5]])
    looked = [explore(names, start, model, None, 25) for start in starts]
    best = settle(min(looked, key=lambda one: one.rms[0]), model)
    assert all(one.evaluations <= 25 for one in looked)
    np.testing.assert_allclose(best.values, truth, rtol=1e-6)
    assert best.evaluations > min(one.evaluations for one in looked)


def test_the_linear_presliding_fit_is_biased_as_published_and_the_direct_one_is_not(step: Recording) -> None:
    wrong = half(the_card(**POSITIVE), "sigma0", "sigma1")
    found = presliding(wrong, step)
    assert found.linear.values / [POSITIVE["sigma0"], POSITIVE["sigma1"]] == pytest.approx([0.56, 3.5], rel=0.02)
    assert found.direct.values[:2] / [POSITIVE["sigma0"], POSITIVE["sigma1"]] == pytest.approx([1, 1], rel=0.003)


def test_a_law_whose_damping_fades_is_identified_from_a_step_as_its_own_kind() -> None:
    base = the_card(**POSITIVE)
    numbers = {one.name: getattr(base.friction, one.name) for one in fields(base.friction)}
    card = replace(base, friction=PassiveLuGre(**numbers))
    step = step_response(card, 1.0, 1e-7, 3)
    found = presliding(half(card, "sigma0", "sigma1"), step)
    assert found.direct.values[:2] / [POSITIVE["sigma0"], POSITIVE["sigma1"]] == pytest.approx([1, 1], rel=0.003)


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


def test_names_may_leave_out_their_prefix_and_unknown_ones_are_refused() -> None:
    card = read_card("paper_mount")
    assert free_names(card, ("Fc", "inertia")) == ("friction.Fc", "axis.inertia")
    with pytest.raises(InputError, match=r'"Fd" is no parameter .* friction\.Fc'):
        free_names(card, ("Fd",))


def test_numbers_that_a_structure_lacks_are_left_out() -> None:
    card = read_card("paper_mount")
    assert with_numbers(card, {"friction.Fc": 2.0, "friction.Fc.positive": 3.0}).friction.Fc == 2.0  # type: ignore[attr-defined]


def test_the_summary_warns_of_numbers_that_depend_on_each_other_and_says_how_well_the_curve_is_known(
    quasi_static: Recording,
) -> None:
    card = the_card(**POSITIVE)
    found = identify([quasi_static], card, Options(free=("sigma0",), starts=1))
    text = summary(found, card)
    assert "Mind, positive: these numbers cannot be told apart here, their curve can: within 0.00" in text
    assert any("correlate" in warning for warning in found.map.fits["positive"].warnings)  # type: ignore[union-attr]


def test_the_verb_writes_card_numbers_and_pictures(recording: Recording, step: Recording, tmp_path: Path) -> None:
    paths = [one.write(tmp_path / f"{name}.parquet") for name, one in (("loop", recording), ("step", step))]
    plain = read_card("paper_mount")
    assert plain.controller is not None
    from pyfmi_models.card_writer import card_text

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
