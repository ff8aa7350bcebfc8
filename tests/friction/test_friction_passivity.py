"""Passivity: no motion takes more energy out of a contact than it put in; with LuGre's shipped numbers one does."""

from dataclasses import replace

import numpy as np
import pytest
from friction_laws import EXAMPLES, Array, numeric, work
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.api.show import describe
from pyfmi_models.card import parse_card, read_card
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.friction import FrictionLaw, LuGre, MaxwellSlip, Stribeck
from pyfmi_models.friction.lugre_passive import FASTEST, PassiveLuGre
from pyfmi_models.model import Pair

LUGRE, SLIP, FADING = EXAMPLES["lugre"], EXAMPLES["maxwell_slip"], EXAMPLES["lugre_passive"]
assert isinstance(LUGRE, LuGre)
assert isinstance(SLIP, MaxwellSlip)
assert isinstance(FADING, PassiveLuGre)
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
@pytest.mark.parametrize("speed", [0.003, 0.04, 0.3, 3.0, 30.0])
def test_the_same_motion_costs_energy_where_the_law_is_passive(law: FrictionLaw, speed: float) -> None:
    gained, moved = wasted(law, *fast_and_slow(speed, 5))
    assert gained > 1e-3 * moved
    assert law.broken_passivity() == ""


@pytest.mark.parametrize("law", PASSIVE.values(), ids=PASSIVE.keys())
@given(motion=st.lists(st.tuples(st.floats(-9, 1.5), st.floats(-2, 1), st.booleans()), min_size=1, max_size=30))
@settings(max_examples=60, deadline=None)
def test_from_a_relaxed_contact_no_motion_ever_gains_energy(
    law: FrictionLaw, motion: list[tuple[float, float, bool]]
) -> None:
    """Passivity in the strict sense, damping included: any speeds, each over a distance near that of presliding."""
    speeds = np.array([10**size * (1 if forward else -1) for size, _, forward in motion])
    seconds = np.array([10**share * BEND for _, share, _ in motion]) / np.abs(speeds)
    gained, moved = wasted(law, speeds, seconds, 20)
    assert gained >= -1e-9 * moved


@given(share=st.floats(-1, 1), size=st.floats(-9, 3), stretch=st.floats(-2, 1))
@settings(max_examples=300, deadline=None)
def test_fading_damping_wastes_power_in_every_state_at_every_speed_and_level(
    share: float, size: float, stretch: float
) -> None:
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


def test_the_direction_that_is_not_passive_is_found_in_a_pair() -> None:
    good = PASSIVE["lugre with viscous friction"]
    assert replace(good, sigma1=Pair(497.0, 497.0)).broken_passivity() == ""
    assert "= 1.07e+03 N.m.s/rad" in replace(good, sigma1=Pair(497.0, 2485.0)).broken_passivity()
    assert "only up to" in replace(FADING, Vd=Pair(0.01, 0.1)).broken_passivity()


def test_a_card_takes_fading_damping_and_its_speed() -> None:
    numbers = "sigma0 = 1e5\nsigma1 = 500.0\nFc = 2.0\n"
    head = '[mount]\ninertia = 30.0\n[friction]\nmodel = "lugre_passive"\n'
    assert parse_card(head + numbers, "c.toml").friction == PassiveLuGre(sigma0=1e5, sigma1=500.0, Fc=2.0)
    late = parse_card(head + numbers + "Vd = 0.1\n", "c.toml")
    assert "Vd = 0.1: only up to 4 sqrt(2 e) Fc / sigma1 = 0.0373 rad/s" in late.remarks()[0]
