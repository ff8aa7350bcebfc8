"""What every friction law owes: it resists, wastes energy, forgets in sliding, and has honest, finite derivatives."""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from friction_laws import EXAMPLES, ONE_SIDED, STEP, VARIANTS, WITH_MEMORY, Array, numeric, work
from hypothesis import given, settings
from hypothesis import strategies as st

from pyfmi_models.friction import LAWS, FrictionLaw
from pyfmi_models.model import parameters_of


def laws(table: dict[str, FrictionLaw]) -> Any:
    return pytest.mark.parametrize("law", table.values(), ids=table.keys())


SPEEDS = np.array([1e-7, 1e-4, 3e-3, 0.04, 0.7])
moving = st.floats(-1, 1).filter(lambda v: abs(v) > 1e-9)
shares = st.floats(-1, 1)
cycles = st.lists(st.tuples(st.floats(-6, -1), st.floats(0, 6.3)), min_size=1, max_size=4)


def closed(harmonics: list[tuple[float, float]], ticks: int) -> Array:
    """Speeds of a cycle of 1 s that ends where it started: harmonics of given amplitude (decades of rad) and phase."""
    t = (np.arange(ticks) + 0.5) / ticks
    waves = [
        2 * np.pi * k * 10**size * np.sin(2 * np.pi * k * t + phase) for k, (size, phase) in enumerate(harmonics, 1)
    ]
    v = np.sum(waves, axis=0)
    return v - v.mean()


def test_every_word_of_a_card_is_a_law_that_is_tested_here() -> None:
    assert {key: law.key for key, law in EXAMPLES.items()} == {key: key for key in LAWS}
    assert set(WITH_MEMORY) >= {"dahl", "lugre", "maxwell_slip"}


@laws(VARIANTS)
@given(share=shares, v=moving)
@settings(max_examples=40, deadline=None)
def test_friction_is_odd_in_the_direction_of_motion(law: FrictionLaw, share: float, v: float) -> None:
    this = numeric(law)
    x = this.start(share)
    for name in ("torque", "rate", "advance"):
        np.testing.assert_array_equal(this(name, -x, -v), -this(name, x, v))
    assert this("level", -x, -v) == this("level", x, v) >= 0


@laws(VARIANTS | {f"one-sided {key}": law for key, law in ONE_SIDED.items()})
@given(cycle=cycles)
@settings(max_examples=25, deadline=None)
def test_a_closed_cycle_never_creates_energy(law: FrictionLaw, cycle: list[tuple[float, float]]) -> None:
    """From presliding to sliding, with inner loops: the work over a cycle that has become periodic is not negative."""
    ticks, this = 200, numeric(law)
    v = closed(cycle, ticks)
    path = float(np.abs(v).mean())
    repeats = int(np.clip(1e-3 / path, 2, 150))  # together 30 times what the contact bends
    states = this.along(np.tile(v, repeats + 1), 1 / ticks)
    wasted, moved = work(law, v, 1 / ticks, states[:, repeats * ticks - 1 : -1])
    assert wasted >= -1e-9 * moved
    assert law.key == "none" or wasted > 1e-6 * moved


@laws(VARIANTS | {f"one-sided {key}": law for key, law in ONE_SIDED.items()})
@pytest.mark.parametrize("v", [*SPEEDS, *-SPEEDS])
def test_steady_sliding_forgets_the_past_and_is_the_laws_static_map(law: FrictionLaw, v: float) -> None:
    this, still = numeric(law), numeric(law.steady())
    slid = 1e9 / abs(v)  # far: a ductile contact approaches its level only as one over the distance
    after = [this("torque", this("advance", this.start(share), v, slid), v)[0] for share in (-0.9, 0.0, 0.7)]
    assert after == pytest.approx([after[0]] * 3, rel=1e-9)
    assert np.sign(v) * after[0] >= 0
    smoothing = getattr(law.steady(), "smoothing", 0.0)
    if law.states() and abs(v) > 20 * smoothing:  # below, the map's smoothed sign is no sign
        assert after[0] == pytest.approx(still("torque", [], v)[0], rel=1e-9)


@laws(WITH_MEMORY)
def test_no_state_of_a_contact_touches_another(law: FrictionLaw) -> None:
    """The diagnosis counts on it when it carries derivatives along a recording."""
    this = numeric(law)
    for name in ("rate", "advance"):
        slopes = this.slopes(name, this.start(0.3), 0.01)[1][:, : this.size]
        np.testing.assert_array_equal(slopes, np.diag(np.diag(slopes)))


@laws(WITH_MEMORY)
@given(share=shares, v=moving)
@settings(max_examples=40, deadline=None)
def test_advance_starts_with_the_rate(law: FrictionLaw, share: float, v: float) -> None:
    """Its derivative by time at 0 is the rate; with the next test it is the exact solution at constant speed."""
    this = numeric(law)
    x = this.start(share)
    value, slopes = this.slopes("advance", x, v, 0.0)
    np.testing.assert_allclose(value, x, rtol=1e-13, atol=1e-13)
    rate = this("rate", x, v)
    np.testing.assert_allclose(slopes[:, this.size + 1], rate, rtol=1e-7, atol=1e-12 * this.values[0] * abs(v))


@laws(WITH_MEMORY)
@given(share=shares, v=moving, first=st.floats(0, 3), second=st.floats(0, 3))
@settings(max_examples=40, deadline=None)
def test_two_short_advances_are_one_long_one(
    law: FrictionLaw, share: float, v: float, first: float, second: float
) -> None:
    this, unit = numeric(law), 1e-5 / abs(v)  # up to 60 urad, twice what the contact bends
    half = this("advance", this.start(share), v, first * unit)
    whole = this("advance", this.start(share), v, (first + second) * unit)
    np.testing.assert_allclose(this("advance", half, v, second * unit), whole, rtol=1e-8, atol=1e-8)


@laws(WITH_MEMORY)
@given(motion=st.lists(moving, min_size=1, max_size=30))
@settings(max_examples=25, deadline=None)
def test_the_contact_never_carries_more_than_break_away(law: FrictionLaw, motion: list[float]) -> None:
    this = numeric(law)
    most = this("level", this.start(), 0.0)[0]
    states = this.along(np.array(motion), 1e-3)
    assert np.abs(states).max() <= most / this.size * (1 + 1e-12)


@laws(WITH_MEMORY)
def test_small_displacements_meet_a_spring_of_stiffness_sigma0(law: FrictionLaw) -> None:
    distance = 1e-10  # 3e-6 of the break-away displacement
    assert numeric(law)("advance", numeric(law).start(), distance, 1.0).sum() == pytest.approx(
        law.sigma0 * distance, rel=2e-5
    )


@laws(VARIANTS | {f"one-sided {key}": law for key, law in ONE_SIDED.items()})
@pytest.mark.parametrize("name", ["torque", "rate", "advance"])
@pytest.mark.parametrize("v", [-0.3, -2e-3, 3e-5, 0.05])
def test_casadis_derivatives_are_finite_differences(law: FrictionLaw, name: str, v: float) -> None:
    this, share = numeric(law), 0.6
    x, dt = this.start(share), 2e-6 / abs(v)
    value, slopes = this.slopes(name, x, v, dt)
    point = np.concatenate([x, [v, dt], this.values])
    split = [this.size, this.size + 1, this.size + 2]
    for column, middle in enumerate(point):
        size, ends = abs(middle) * 1e-6 or 1e-9, []
        for side in (-1, 1):
            moved = point.copy()
            moved[column] += side * size
            state, speed, seconds, p = np.split(moved, split)
            ends.append(this.functions[name](state, speed, seconds, p).full().ravel())
        change = (ends[1] - ends[0]) / 2
        scale = np.abs(value).max(initial=1e-12)
        np.testing.assert_allclose(slopes[:, column] * size, change, rtol=1e-5, atol=3e-10 * scale)


@laws(VARIANTS | {f"one-sided {key}": law for key, law in ONE_SIDED.items()})
def test_values_and_derivatives_are_finite_at_rest_and_at_any_speed(law: FrictionLaw) -> None:
    this, speeds, loads = numeric(law), (0.0, -1e-300, 1e-12, 50.0, -1e6), (0.0, 1.0, -1.0, 30.0)
    for name, v, share, dt in product(this.formulas, speeds, loads, (0.0, STEP, 10.0)):
        for values in this.slopes(name, this.start(share), v, dt):
            assert np.all(np.isfinite(values)), (name, v, share, dt)


@pytest.mark.parametrize("delta", [0.5, 1.0, 2.0, 5.0])
@laws({key: law for key, law in EXAMPLES.items() if hasattr(law, "delta")})
def test_every_shape_of_the_stribeck_curve_has_finite_derivatives(law: FrictionLaw, delta: float) -> None:
    this = numeric(replace(law, delta=delta))
    for name, v in product(this.formulas, (0.0, -1e-300, 1e-9, 50.0, 1e6)):
        assert all(np.all(np.isfinite(values)) for values in this.slopes(name, this.start(0.5), v)), (name, v)


@laws(EXAMPLES)
def test_every_parameter_has_a_unit_a_meaning_and_bounds_around_its_number(law: FrictionLaw) -> None:
    for variable in parameters_of(law):
        assert variable.unit
        assert variable.description
        assert variable.low <= variable.start <= variable.high
