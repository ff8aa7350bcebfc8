"""What each friction law says: its equation, its closed forms, its limits, and what makes it a word of a card."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from fmpy import simulate_fmu
from friction_laws import EXAMPLES, numeric
from scipy.integrate import solve_ivp

from pyfmi_models.card import parse_card, read_card
from pyfmi_models.card_writer import card_text
from pyfmi_models.errors import CardError
from pyfmi_models.export import export_fmu
from pyfmi_models.friction import LAWS, Dahl, FrictionLaw, LuGre, MaxwellSlip, Stribeck
from pyfmi_models.model import Model, Pair, parameters_of, symbols_of, with_symbols
from pyfmi_models.mount import Axis, Mount

LUGRE, MAXWELL = EXAMPLES["lugre"], EXAMPLES["maxwell_slip"]
SPEEDS = np.array([1e-7, 1e-4, 3e-3, 0.04, 0.7])
BEND = 2.322 / 9.23e4
"""Level over stiffness [rad]: the scale of presliding."""


@pytest.mark.parametrize("elements", [2, 4, 16])
def test_another_number_of_elements_is_a_subclass_with_the_same_limits(elements: int) -> None:
    kind = type("Other", (MaxwellSlip,), {"elements": elements})
    law = kind(sigma0=9.23e4, Fc=2.322)
    assert len(law.states()) == elements
    assert numeric(law)("advance", np.zeros(elements), 1e-10, 1.0).sum() == pytest.approx(9.23e-6, rel=1e-9)
    far = numeric(law).along(np.full(2000, 100 * BEND / 2000), 1.0)
    assert far[:, -1].sum() == pytest.approx(2.322, rel=1e-9)


def test_an_element_that_slips_forgets_what_it_was() -> None:
    """At its level, too, where the step of its torque has no kink: d F_i(dt) / d F_i = exp(-attraction distance)."""
    this = numeric(replace(MAXWELL, Fs=None, Vs=None))
    k, distance = ca.DM(MAXWELL.stiffness()).full().ravel(), 1e-7
    slopes = np.diag(this.slopes("advance", this.start(1.0), 1.0, distance)[1][:, : this.size])
    np.testing.assert_allclose(slopes, np.exp(-50.0 * k * distance / (2.322 / 8)), rtol=1e-9)


@pytest.mark.parametrize("law", [LUGRE, LUGRE.steady(), MAXWELL], ids=lambda law: law.key)
def test_without_break_away_level_there_is_no_stribeck_term(law: LuGre | Stribeck | MaxwellSlip) -> None:
    plain = replace(law, Fs=None, Vs=None)
    assert all(float(plain.level(v)) == law.Fc for v in (0.0, *SPEEDS))
    assert {"Fs", "Vs"}.isdisjoint(variable.name for variable in parameters_of(plain))
    assert float(law.level(0.0)) == pytest.approx(law.Fs, rel=1e-12)
    assert float(law.level(10.0)) == pytest.approx(law.Fc, rel=1e-12)


def test_a_pair_is_two_parameters_and_the_direction_picks_one() -> None:
    law = replace(LUGRE, Fc=Pair(2.0, 2.5), Fs=Pair(3.0, 4.0))
    variables = parameters_of(law, "friction")
    starts = {variable.name: variable.start for variable in variables}
    assert starts["friction.Fc.positive"] == 2.0
    assert starts["friction.Fc.negative"] == 2.5
    assert "friction.Fc" not in starts
    assert starts["friction.sigma0"] == LUGRE.sigma0
    p, symbols = symbols_of(variables)
    w = ca.SX.sym("w")
    level = ca.Function("level", [w, p], [with_symbols(law, symbols, w, "friction").level(w)])
    for v, side in ((5.0, 0), (-5.0, 1), (1e-9, 0), (-1e-9, 1)):
        expected = law.Fc[side] if abs(v) > 1 else law.Fs[side]
        assert float(level(v, list(starts.values()))) == pytest.approx(expected, rel=1e-6)


def card(model: str, numbers: str) -> Any:
    return parse_card(f'[mount]\ninertia = 30\n[friction]\nmodel = "{model}"\n{numbers}', "c.toml")


@pytest.mark.parametrize("law", EXAMPLES.values(), ids=EXAMPLES.keys())
def test_a_card_says_every_law_and_reads_it_back(law: Any) -> None:
    written = replace(read_card("paper_mount"), friction=law)
    assert parse_card(card_text(written), "again.toml").friction == law


def test_a_card_needs_only_stiffness_and_level_of_a_law_with_memory() -> None:
    assert card("dahl", "sigma0 = 1e4\nFc = 2.0").friction == Dahl(sigma0=1e4, Fc=2.0, n=1.0, sigma2=0.0)
    slip = card("maxwell_slip", "sigma0 = 1e4\nFc = 2.0\nFs = 2.0\nVs = 0.1").friction
    assert slip == MaxwellSlip(sigma0=1e4, Fc=2.0)  # Fs = Fc: no Stribeck term
    sided = card("maxwell_slip", "sigma0 = { positive = 1e4, negative = 2e4 }\nFc = 2").friction
    assert sided.sigma0 == Pair(1e4, 2e4)


SENTENCES = {
    ("dahl", "sigma0 = 1e4"): "Fc is missing.",
    ("dahl", "sigma0 = 1e4\nFs = 2"): '"Fs" is not a key here; keys are: sigma0, Fc, n, sigma2.',
    ("dahl", "sigma0 = 1e4\nFc = 2\nn = 0"): "n = 0 is outside 0.5 .. 5.",
    ("maxwell_slip", "sigma0 = 1e4\nFc = 2\nFs = 3"): "Fs needs Vs, the speed over which friction falls.",
    ("maxwell_slip", "sigma0 = 1e4\nFc = 2\nspread = 0.5"): "spread = 0.5 is outside 1 .. 1e+06.",
    ("maxwell_slip", "sigma0 = 1e4\nFc = 2\nattraction = inf"): "attraction = inf is not a number.",
    ("maxwell_slip", "sigma0 = 1e4\nFc = 2\nelements = 4"): '"elements" is not a key here; keys are: sigma0, ',
    ("maxwell_slip", "sigma0 = 1e4\nFc = {positive = 2}"): "Fc = {'positive': 2} is no pair; a pair is { positive =",
}


@pytest.mark.parametrize(("model", "numbers"), SENTENCES)
def test_a_bad_card_of_a_law_with_memory_is_one_sentence(model: str, numbers: str) -> None:
    with pytest.raises(CardError) as caught:
        card(model, numbers)
    assert str(caught.value).startswith(f"c.toml: [friction]: {SENTENCES[model, numbers]}")
    assert "\n" not in str(caught.value)


def test_a_word_that_is_no_law_is_answered_with_the_laws() -> None:
    with pytest.raises(CardError, match=r"model = \'dhal\' is unknown; models are: coulomb, none, dahl, lugre, "):
        card("dhal", "Fc = 2")
    assert set(LAWS) >= {"none", "coulomb", "static", "dahl", "lugre", "maxwell_slip"}


# Every friction law as an FMU: co-simulation and model exchange find what a tight solver finds.

PUSHED, TIMES = (4.0, -0.01), (0.02, 0.05, 0.06, 0.1)
"""Pushed back (torque, speed) from a slow motion: sliding, about to stop, just turned and bending, sliding again."""
EACH = pytest.mark.parametrize("law", EXAMPLES.values(), ids=EXAMPLES.keys())
Archive = Callable[[FrictionLaw], Path]
Times = tuple[float, ...]


@cache
def plant(law: FrictionLaw) -> Model:
    return Mount(name=f"{law.key}_mount", axis=Axis(inertia=30.0), friction=law).model()


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    folder = tmp_path_factory.mktemp("laws")
    return cache(lambda law: export_fmu(plant(law), folder / f"{law.key}.fmu"))


@cache
def tight(law: FrictionLaw, tau: float, speed: float, times: Times) -> np.ndarray:
    """States at some times, a row each."""
    model, x = plant(law), ca.SX.sym("x", len(plant(law).states))
    rates = model.equations(0, x, [tau, 0.0], [variable.start for variable in model.parameters])[0]
    both = [ca.Function("f", [x], [ca.densify(one)]) for one in (rates, ca.jacobian(rates, x))]
    found = [np.array([speed if state.name == "speed" else 0.0 for state in model.states])]
    rate, slope = (lambda t, x, f=f: f(x).full() for f in both)
    for ends in pairwise((0.0, *times)):
        exact = solve_ivp(lambda t, x: rate(t, x)[:, 0], ends, found[-1], "Radau", rtol=1e-12, atol=1e-14, jac=slope)
        found.append(exact.y[:, -1])
    return np.array(found[1:])


def moved(path: Path, law: FrictionLaw, kind: str, step: float, start: tuple[float, float], times: Times) -> np.ndarray:
    """States of the FMU at some times, a row each."""
    names = [state.name for state in plant(law).states]
    result = simulate_fmu(
        str(path), fmi_type=kind, stop_time=times[-1], output_interval=step, output=names,
        start_values={"tau": start[0], "speed": start[1]}, relative_tolerance=1e-9,
    )  # fmt: skip
    rows = np.searchsorted(result["time"], np.array(times) - 1e-9)
    return np.column_stack([result[name][rows] for name in names])


@EACH
@pytest.mark.parametrize(("kind", "tolerance"), [("CoSimulation", 1e-9), ("ModelExchange", 1e-7)])
def test_the_plant_of_every_law_moves_as_a_tight_solver_says(
    archive: Archive, law: FrictionLaw, kind: str, tolerance: float
) -> None:
    """Both ask for 1e-9 a step, relative to the state and 0.01 of its nominal; CVode lets its errors add up."""
    exact, nominals = tight(law, *PUSHED, TIMES), np.array([state.nominal for state in plant(law).states])
    size = np.abs(exact).max(axis=0) + 0.01 * nominals
    assert (np.abs(moved(archive(law), law, kind, 1e-4, PUSHED, TIMES) - exact) / size).max() < tolerance


@pytest.mark.parametrize("motion", ["rotary", "linear"])
@pytest.mark.parametrize("law", [law for law in EXAMPLES.values() if law.states()], ids=lambda law: law.key)
def test_the_contact_keeps_its_torques_as_states_of_the_plant(law: FrictionLaw, motion: str) -> None:
    model = Mount(name="m", axis=Axis(inertia=30.0), friction=law, motion=motion).model()
    found = [state for state in model.states if state.name.startswith("friction.")]
    assert [state.name for state in found] == [f"friction.{state.name}" for state in law.states()]
    assert {state.unit for state in found} == {"N.m" if motion == "rotary" else "N"}
