"""Priors of evidence: a number that is a place costs the same wherever the encoder has its zero."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.stages import margin, stage
from cosim.estimation.prepare import prepare
from cosim.estimation.priors import trust
from cosim.estimation.problem import Problem
from pyfmi_models.friction import Coulomb, FrictionLaw, Stribeck
from pyfmi_models.mount import Axis, Mount

AXIS = Mount(name="axis", axis=Axis(inertia=0.6), friction=Coulomb(Fc=1.1, sigma2=0.3))


def swinging(zero: float) -> Recording:
    """Half a minute of 3.4 degrees to either side, a load of 3 N m below the axis; the encoder's zero is elsewhere."""
    t = np.arange(6_000) / 200
    q, v, a = (0.06 * w * np.sin(1.3 * t + k * np.pi / 2) for k, w in ((0, 1), (1, 1.3), (2, 1.69)))
    noise = 0.03 * np.random.default_rng(5).standard_normal(len(t))
    return Recording(
        "run", {"t": t, "tau": 0.6 * a + 1.1 * np.sign(v) + 0.3 * v + 3 * np.sin(q) + noise, "q": q + zero}
    )


def compared(zero: float) -> tuple[dict[str, float], float]:
    """Evidence of a cable and of a load off the axis, and how far the one is before the other."""
    prepared = prepare([swinging(zero)], 10.0)
    problem = Problem(AXIS, prepared, np.ones(len(prepared.recording_of)), 0.005)
    comparison = Comparison.of(problem, problem.fit(AXIS, 15), POLICY)
    best = {one.effect.id: one for one in reversed(stage(comparison, problem.fit(AXIS, 15)).tried)}
    cable, load = best["cable_wrap"], best["gravity_unbalance"]
    return {name: one.evidence for name, one in best.items()}, margin(comparison, cable, load)


@pytest.mark.parametrize("zero", [0.0, 0.3, -2.0])
def test_two_effects_that_are_one_here_are_not_told_apart_by_their_priors(zero: float) -> None:
    evidence, ahead = compared(zero)
    assert min(evidence["cable_wrap"], evidence["gravity_unbalance"]) > 100
    assert abs(ahead) < 3.5


def test_what_a_cable_is_worth_has_nothing_to_do_with_the_encoders_zero() -> None:
    worth = [compared(zero)[0]["cable_wrap"] for zero in (0.0, 0.7)]
    assert worth[0] == pytest.approx(worth[1], abs=0.1)


def test_a_place_may_lie_anywhere_in_the_motion() -> None:
    class Found:
        mount, free, values = AXIS, ("cable_wrap.home", "cable_wrap.stiffness", "spot.q_center"), (1e-9, 2.0, 0.0)

    assert trust(Found(), 0.4).tolist() == [0.4, 2.0, 0.4]  # type: ignore[arg-type]


def trusted(law: FrictionLaw, **values: float) -> list[float]:
    mount = Mount(name="axis", axis=Axis(inertia=0.6), friction=law)
    found: Any = SimpleNamespace(mount=mount, free=tuple(values), values=tuple(values.values()))
    return [float(one) for one in trust(found, 0.4)]


def test_a_level_may_be_as_far_off_as_it_is_large_and_a_shape_of_the_law_by_a_tenth() -> None:
    """Where the torque is linear in a number its tangent holds anywhere; that of a shape, only near the fit."""
    law = Stribeck(Fc=1.1, Fs=1.5, Vs=0.02, delta=2.0, sigma2=0.3)
    found = trusted(law, **{"friction.Fc": -1.1, "friction.Fs": 1.5, "friction.Vs": 0.02, "friction.sigma2": 0.3})
    assert found == pytest.approx([1.1, 0.15, 0.002, 0.3])


def test_a_number_of_one_direction_is_a_level_and_one_of_an_effect_is_trusted_by_its_size() -> None:
    law = Stribeck(Fc=1.1, Fs=1.5, Vs=0.02, delta=2.0, sigma2=0.3)
    found = trusted(
        law, **{"friction.Vs.negative": 0.02, "cogging.amplitude": -0.4, "drag.Vs": 0.5, "axis.inertia": 2.0}
    )
    assert found == pytest.approx([0.02, 0.4, 0.5, 2.0])


def test_a_phase_may_be_off_by_a_radian_and_a_number_that_is_nothing_by_next_to_nothing() -> None:
    found = trusted(Coulomb(Fc=1.1), **{"cogging.phase": 3.0, "cogging.amplitude": 0.0})
    assert found == [1.0, 1e-12]
