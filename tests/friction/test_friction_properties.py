"""What every friction law owes: it resists, wastes energy, forgets in sliding, and has honest, finite derivatives."""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from friction_laws import EXAMPLES, ONE_SIDED, STEP, VARIANTS, WITH_MEMORY, Array, numeric, work
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.api.show import describe
from pyfmi_models.card import parse_card, read_card
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.friction import LAWS, FrictionLaw, Stribeck
from pyfmi_models.friction.lugre_passive import FASTEST, PassiveLuGre


def laws(table: dict[str, FrictionLaw]) -> Any:
    return pytest.mark.parametrize("law", table.values(), ids=table.keys())


ALL = VARIANTS | {f"one-sided {key}": law for key, law in ONE_SIDED.items()}
SHAPES = {
    f"{key}, delta = {delta:g}": replace(law, delta=delta)
    for key, law in EXAMPLES.items()
    if hasattr(law, "delta")
    for delta in (0.5, 1.0, 2.0, 5.0)
}
"""Every shape of the Stribeck curve."""
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
    assert set(LAWS) >= {"none", "coulomb", "static", "dahl", "lugre", "maxwell_slip"}


@laws(VARIANTS)
@given(share=shares, v=moving)
@settings(max_examples=40, deadline=None)
def test_friction_is_odd_in_the_direction_of_motion(law: FrictionLaw, share: float, v: float) -> None:
    this = numeric(law)
    x = this.start(share)
    for name in ("torque", "rate", "advance"):
        np.testing.assert_array_equal(this(name, -x, -v), -this(name, x, v))
    assert this("level", -x, -v) == this("level", x, v) >= 0


@laws(ALL)
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


@laws(ALL)
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
def test_two_short_advances_are_one_long_one(law: Any, share: float, v: float, first: float, second: float) -> None:
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


@laws(ALL)
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


@laws(ALL | SHAPES)
def test_values_and_derivatives_are_finite_at_rest_and_at_any_speed(law: FrictionLaw) -> None:
    this, speeds, loads = numeric(law), (0.0, -1e-300, 1e-12, 50.0, -1e6), (0.0, 1.0, -1.0, 30.0)
    for name, v, share, dt in product(this.formulas, speeds, loads, (0.0, STEP, 10.0)):
        for values in this.slopes(name, this.start(share), v, dt):
            assert np.all(np.isfinite(values)), (name, v, share, dt)


# Passivity: no motion takes more energy out of a contact than it put in; with LuGre's shipped numbers one does.

LUGRE, SLIP, FADING = EXAMPLES["lugre"], EXAMPLES["maxwell_slip"], EXAMPLES["lugre_passive"]
STATIC = Stribeck(Fc=2.322, Fs=3.322, Vs=0.04129, delta=1.292, sigma2=32.77)
BEND = 2.322 / 9.23e4
"""Level over stiffness [rad]."""
PASSIVE = {
    "fading, at its own speed": FADING,
    "fading, Vd at its bound": replace(FADING, Vd=FASTEST * FADING.Fc / FADING.sigma1),
    "fading, much damping": replace(FADING, sigma1=5e4, sigma2=0.0),
    "lugre with viscous friction": replace(LUGRE, sigma2=1.001 * LUGRE.sigma1 * (LUGRE.Fs - LUGRE.Fc) / LUGRE.Fc),
    "lugre without stribeck": replace(LUGRE, Fs=None, Vs=None),
    "lugre without damping": replace(LUGRE, sigma1=0.0),
    "maxwell slip with viscous friction": replace(SLIP, sigma2=1.001 * SLIP.sigma1),
    "dahl": EXAMPLES["dahl"],
}
ACTIVE = {
    "lugre": LUGRE,
    "fading too late": replace(FADING, Vd=10.0, sigma2=0.0),
    "maxwell slip": SLIP,
    "presliding under a static law": Presliding(sigma0=9.23e4, sigma1=497.0).law(STATIC),
}


def fast_and_slow(speed: float, times: int = 20) -> tuple[Array, Array]:
    """Speeds and their seconds: short dashes, each after a creep that loads the bristles to break-away; slowly back."""
    dash, creep = 0.2 * BEND, 2 * BEND
    back = 10 * BEND
    rounds = -(-times * (dash + creep) // back)
    speeds = [speed, 1e-4] * times + [-1e-4] * int(rounds)
    seconds = [dash / speed, creep / 1e-4] * times + [times * (dash + creep) / rounds / 1e-4] * int(rounds)
    return np.array(speeds), np.array(seconds)


def wasted(law: FrictionLaw, speeds: Array, seconds: Array, cut: int = 200) -> tuple[float, float]:
    """Work done on a contact from rest, and the energy moved; each piece in `cut` parts of equal length."""
    this, total, moved = numeric(law), 0.0, 0.0
    state = this.start()
    for v, takes in zip(speeds, seconds, strict=True):
        walked, dt = np.full(cut, v), takes / cut
        states = this.along(walked, dt, state)
        one, size = work(law, walked, dt, np.column_stack([state, states[:, :-1]]))
        total, moved, state = total + one, moved + size, states[:, -1]
    return total, moved


@pytest.mark.parametrize("law", ACTIVE.values(), ids=ACTIVE.keys())
def test_dashes_between_creeps_take_energy_out_of_a_law_that_is_not_passive(law: FrictionLaw) -> None:
    """Barabanov and Ortega's condition is necessary: here is the closed motion, from rest to where it began."""
    speeds, seconds = fast_and_slow(speed=3.0)
    assert speeds @ seconds == pytest.approx(0.0, abs=1e-12)
    assert wasted(law, speeds, seconds)[0] < 0
    assert law.broken_passivity()


@pytest.mark.parametrize("law", PASSIVE.values(), ids=PASSIVE.keys())
@given(motion=st.lists(st.tuples(st.floats(-9, 1.5), st.floats(-2, 1), st.booleans()), min_size=1, max_size=30))
@settings(max_examples=60, deadline=None)
def test_from_a_relaxed_contact_no_motion_ever_gains_energy(law: FrictionLaw, motion: list[Any]) -> None:
    """Passivity in the strict sense, damping included: any speeds, each over a distance near that of presliding."""
    speeds = np.array([10**size * (1 if forward else -1) for size, _, forward in motion])
    seconds = np.array([10**share * BEND for _, share, _ in motion]) / np.abs(speeds)
    gained, moved = wasted(law, speeds, seconds, 20)
    assert gained >= -1e-9 * moved
    assert law.broken_passivity() == ""


@given(share=st.floats(-1, 1), size=st.floats(-9, 3), stretch=st.floats(-2, 1))
@settings(max_examples=300, deadline=None)
def test_fading_damping_wastes_power_in_every_state_at_any_speed(share: float, size: float, stretch: float) -> None:
    """Point by point: power in, less what the bristles store, whatever effects make of the level."""
    v, level = 10**size, LUGRE.Fs * 10**stretch
    law = replace(FADING, sigma2=0.0)
    state = share * level
    stored = state / law.sigma0 * float(law.rate(state, v, level))
    assert float(law.contact(state, v, level)) * v - stored >= -1e-12 * level * v


def test_a_card_with_a_law_that_is_not_passive_says_so() -> None:
    """The shipped numbers are the paper's; 214 = 497 (3.322 - 2.322) / 2.322."""
    facts, _ = describe("paper_mount")
    assert facts["note 1"] == (
        "[friction]: sigma2 = 32.8: it would need sigma1 (Fs - Fc) / Fc = 214 N.m.s/rad. Some fast motions would take "
        'more energy from the friction than they gave (it is not passive); model = "lugre_passive" without Vd has none.'
    )
    passive = read_card("paper_mount")
    assert replace(passive, friction=FADING).remarks() == ()
    assert "note 1" not in describe("emps")[0]
    numbers = "sigma0 = 1e5\nsigma1 = 500.0\nFc = 2.0\nVd = 0.1\n"
    late = parse_card(f'[mount]\ninertia = 30.0\n[friction]\nmodel = "lugre_passive"\n{numbers}', "c.toml")
    assert late.friction == PassiveLuGre(sigma0=1e5, sigma1=500.0, Fc=2.0, Vd=0.1)
    assert "Vd = 0.1: only up to 4 sqrt(2 e) Fc / sigma1 = 0.0373 rad/s" in late.remarks()[0]
