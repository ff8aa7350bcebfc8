"""What cannot be tested has one reason, and what to record is said apart from it, and only where a recording helps."""

from dataclasses import replace

import numpy as np
import pytest
from wandering import axis

from cosim.data.recording import Recording
from cosim.diagnosis.effects import TRIED, candidates, named
from cosim.diagnosis.effects.base import HELD, NO_FRICTION, NO_POSITION, UNSEEN
from cosim.estimation.prepare import Prepared, prepare
from pyfmi_models.effects import CATALOGUE, ActuatorLag, Cogging, Effect, FrictionAsymmetry, GravityUnbalance
from pyfmi_models.friction import Frictionless, LuGre
from pyfmi_models.mount import Mount

T = np.arange(8000) / 200
BARE = axis()


def taken(q: np.ndarray, of: str = "q") -> Prepared:
    return prepare([Recording("run", {"t": T, "tau": np.cos(T), of: q, "q_d": q})], 20.0)


BOTH_WAYS, ONE_WAY = 0.3 * np.sin(T), 0.3 * T + 0.05 * np.sin(T)


@pytest.mark.parametrize("effect", TRIED)
def test_what_to_record_is_said_of_every_effect(effect: str) -> None:
    assert all(form.to_record.startswith("record ") for form in CATALOGUE[effect])


BOTH = (GravityUnbalance(mgl=1.0, phase=0.0), FrictionAsymmetry(level_asymmetry=0.1))


@pytest.mark.parametrize(
    ("effect", "mount", "prepared", "reason"),
    [
        ("gravity_unbalance", replace(BARE, effects=BOTH), taken(BOTH_WAYS), HELD),
        ("friction_asymmetry", replace(BARE, effects=BOTH), taken(BOTH_WAYS), HELD),
        ("gravity_unbalance", replace(BARE, motion="linear"), taken(BOTH_WAYS), "a linear axis has no unbalance"),
        ("friction_asymmetry", BARE, taken(ONE_WAY), "these recordings hold no reversals"),
        ("friction_asymmetry", replace(BARE, friction=Frictionless()), taken(BOTH_WAYS), NO_FRICTION),
        ("cable_wrap", BARE, taken(np.cos(T), "v"), NO_POSITION),
        ("quadratic_drag", BARE, taken(np.cos(T), "v"), UNSEEN),
    ],
)
def test_the_reason_is_the_one_that_holds(effect: str, mount: Mount, prepared: Prepared, reason: str) -> None:
    assert named(effect).why_not(mount, prepared) == reason


def test_an_effect_that_the_law_or_the_card_holds_needs_no_recording() -> None:
    lugre = replace(BARE, friction=LuGre(sigma0=1e4, sigma1=10.0, sigma2=1.0, Fc=2.0, Fs=2.5, Vs=0.01))
    settled = [name for name in TRIED if named(name).is_settled(lugre)]
    assert sorted(settled) == ["constant_force", "presliding", "stribeck"], "a constant force is of a linear axis"
    assert [name for name in TRIED if named(name).is_settled(BARE)] == ["constant_force"]


def asked(mount: Mount) -> set[str]:
    """Effects for which a search has candidates, where every row is some residual."""
    prepared = taken(BOTH_WAYS)
    residual = np.cos(3 * prepared.stacked("t"))
    return {one.effect for one in candidates(mount, prepared, residual, np.ones_like(residual))}


@pytest.mark.parametrize(
    ("had", "again"),
    [((*BOTH, Cogging(cycles_per_rev=3, amplitude=0.1)), {"cogging"}), ((ActuatorLag(time_constant_ms=5.0),), set())],
)
def test_no_effect_comes_again_but_further_waves_and_a_delay(had: tuple[Effect, ...], again: set[str]) -> None:
    names = {effect.id for effect in had}
    assert names | {"delay"} <= asked(BARE)
    assert (names | {"delay"}) & asked(replace(BARE, effects=had)) == again | {"delay"}


def test_no_effect_of_friction_is_a_candidate_where_there_is_none() -> None:
    of_friction = {name for name in TRIED if any(form.place == "Friction" for form in CATALOGUE[name])}
    assert of_friction & asked(BARE)
    assert not of_friction & asked(replace(BARE, friction=Frictionless()))
