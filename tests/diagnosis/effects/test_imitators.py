"""A contact that bends, a delay and a play look alike about turns: which stays a rival, and which tells a size."""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import _problem
from cosim.diagnosis.effects import candidates
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.sizes import is_told, numbers_of, standard_errors
from cosim.diagnosis.search.stages import CandidateFit, admission, margin, refitted
from cosim.estimation.blocks import Blocks
from cosim.estimation.fit import recorded_by
from cosim.estimation.inverse import Inverse
from cosim.estimation.prepare import Prepared, prepare
from pyfmi_models.card import parse_card
from pyfmi_models.effects import Delay, Effect, FrictionAsymmetry, TorqueOffset
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.friction import Coulomb, FrictionLaw, LuGre
from pyfmi_models.mount import Axis, Mount

CARD = parse_card('[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 1.0\n', "card.toml")
CONTACT, LATE = Presliding(sigma0=1000.0), Delay(delay_ms=5.0)
STARTS = (Presliding(sigma0=100.0), Delay(delay_ms=3.0), Backlash(gap_rad=1e-3, load_share=0.3, load_friction=0.1))


class Tried(NamedTuple):
    """All three beside one base."""

    comparison: Comparison
    fits: dict[str, CandidateFit]


def recorded(effect: Effect, noise: float, seed: int, ripple: float) -> Recording:
    """A machine with an effect, 0.3 rad to and fro, and a faster motion over it."""
    t, rng = np.arange(3000) / 200, np.random.default_rng(seed)
    q = 0.3 * np.sin(1.5 * (t + seed)) + ripple * np.sin(5 * (t + seed))
    (piece,) = prepare([Recording("still", {"t": t, "tau": t, "q": q})], 90.0).pieces
    tau = Inverse(replace(CARD.plant(), effects=(effect,)), ()).torque(piece, np.zeros(0))[0]
    return Recording(f"run_{seed}", {"t": piece.t, "q": piece.q, "tau": tau + noise * rng.standard_normal(len(tau))})


@cache
def tried(effect: Effect, noise: float, ripple: float) -> Tried:
    problem = _problem([recorded(effect, noise, seed, ripple) for seed in (1, 2)], CARD)
    base = problem.fit(problem.mount, 40)
    comparison = Comparison.of(problem, base, POLICY)
    return Tried(comparison, {one.id: refitted(comparison, base, one, 1) for one in STARTS})


BENT, DELAYED = (CONTACT, 0.1, 0.0), (LATE, 0.02, 0.03)


def told(this: Tried, name: str) -> tuple[bool, dict[str, float]]:
    """Whether the size of one is told, and the errors of its numbers."""
    one, problem = this.fits[name], this.comparison.problem
    errors = standard_errors(one.fit, Blocks.of(problem.prepared), problem.weight)
    numbers = numbers_of(one.effect, one.fit.mount, errors)
    return is_told(one.effect, numbers, one.fit.mount, recorded_by(problem.prepared.pieces)), numbers.errors


@pytest.mark.parametrize(("case", "name"), [(BENT, "presliding"), (DELAYED, "delay")])
def test_of_the_three_only_the_one_that_is_there_is_admissible_and_near(
    case: tuple[Effect, float, float], name: str
) -> None:
    this = tried(*case)
    own = this.fits[name]
    assert own.evidence > POLICY.clear
    near = {
        rival
        for rival, one in this.fits.items()
        if all_pass(admission(this.comparison, one)) and margin(this.comparison, own, one) < POLICY.fair
    }
    assert near == {name}


def test_a_play_without_a_gap_is_the_contact_that_bends_in_all_but_its_name_and_no_rival_of_it() -> None:
    this = tried(*BENT)
    contact, play = this.fits["presliding"], this.fits["backlash"]
    assert contact.plain_gain > 0.8
    assert play.plain_gain == pytest.approx(contact.plain_gain, abs=0.02)
    assert contact.evidence - play.evidence > 100, "each with what laws lack at stops beside the play alone"
    assert margin(this.comparison, contact, play) < 10, "and none of it beside either"
    assert play.effect.gap_rad < 1e-4  # type: ignore[attr-defined]
    assert not all_pass(admission(this.comparison, play))


def test_the_range_of_the_one_that_is_there_holds_its_size_and_that_of_an_imitator_tells_none() -> None:
    bent, late = tried(*BENT), tried(*DELAYED)
    is_size, errors = told(bent, "presliding")
    assert is_size
    stiffness = float(bent.fits["presliding"].effect.sigma0)  # type: ignore[attr-defined]
    assert abs(stiffness - CONTACT.sigma0) < 1.96 * errors["sigma0"] < 0.1 * CONTACT.sigma0
    assert not told(bent, "delay")[0], "its 95 % range holds no delay at all"
    assert told(bent, "delay")[1]["delay_ms"] > 20 * told(late, "delay")[1]["delay_ms"]
    assert told(late, "delay")[0]


# A constant torque and friction of two directions: two numbers of an axis that moves, not three.

COULOMB = Coulomb(Fc=2.0, sigma2=1.0)
LUGRE = LuGre(sigma0=1e5, sigma1=300.0, sigma2=1.0, Fc=2.0, Fs=2.5, Vs=0.01)
OFFSET, ASYMMETRY = TorqueOffset(torque=0.3), FrictionAsymmetry(level_asymmetry=0.1, viscous_asymmetry=0.0)


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    t = np.arange(4_000) / 200
    v = 0.2 * np.cos(0.9 * t)
    return prepare([Recording("run", {"t": t, "tau": 2 * np.sign(v) + v, "q": np.cumsum(v) / 200})], 10.0)


def offered(prepared: Prepared, law: FrictionLaw, *effects: Effect) -> set[str]:
    mount = Mount(name="axis", axis=Axis(inertia=5.0), friction=law, effects=effects)
    rows = len(prepared.recording_of)
    return {one.effect for one in candidates(mount, prepared, np.ones(rows), np.ones(rows))}


@pytest.mark.parametrize(("law", "both"), [(COULOMB, False), (LUGRE, True)])
def test_one_is_offered_beside_the_other_only_where_rest_tells_them_apart(
    prepared: Prepared, law: FrictionLaw, both: bool
) -> None:
    assert {"torque_offset", "friction_asymmetry"} <= offered(prepared, law)
    assert ("friction_asymmetry" in offered(prepared, law, OFFSET)) is both
    assert ("torque_offset" in offered(prepared, law, ASYMMETRY)) is both
