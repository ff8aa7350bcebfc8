"""A play with a stiff contact is found from afar: the grid that looks for it gets finer as its averages get shorter."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import _problem
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.stages import admission, refitted
from cosim.estimation.fit import Fit
from cosim.estimation.inverse import Inverse
from cosim.estimation.prepare import prepare
from pyfmi_models.card import parse_card
from pyfmi_models.effects.backlash import Backlash

CARD = parse_card('[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 1.0\n', "card.toml")
WIDE = Backlash(gap_rad=5e-3, load_share=0.4, load_friction=0.4)
NARROW = Backlash(gap_rad=1e-3, load_share=0.4, load_friction=0.2)
PLAYS = pytest.mark.parametrize("play", [WIDE, NARROW])


def recorded(play: Backlash, seed: int) -> Recording:
    """Two slow tones, and what the axis needs for them with a play behind it, 100 Hz of band."""
    t, rng = np.arange(15000) / 1000, np.random.default_rng(seed)
    q = 0.3 * np.sin(1.5 * (t + seed)) + 0.03 * np.sin(5 * (t + seed))
    (piece,) = prepare([Recording("still", {"t": t, "tau": t, "q": q})], 450.0).pieces
    tau = Inverse(replace(CARD.plant(), effects=(play,)), ()).torque(piece, np.zeros(0))[0]
    return Recording(f"run_{seed}", {"t": piece.t, "q": piece.q, "tau": tau + 0.02 * rng.standard_normal(len(tau))})


@cache
def compared(play: Backlash) -> tuple[Comparison, Fit]:
    problem = _problem([recorded(play, seed) for seed in (1, 2)], CARD)
    base = problem.fit(problem.mount, 40)
    return Comparison.of(problem, base, POLICY), base


def likeliest(play: Backlash) -> Backlash:
    comparison, base = compared(play)
    looked = [one for one in comparison.screen(base) if one.candidate.effect == "backlash"]
    best = max(looked, key=lambda one: one.evidence)
    start = best.candidate.start(best.coefficients)
    assert isinstance(start, Backlash)
    return start


@PLAYS
def test_the_likeliest_candidate_has_the_gap_and_what_stops_the_far_side(play: Backlash) -> None:
    start = likeliest(play)
    assert start.gap_rad == pytest.approx(play.gap_rad, rel=0.05)
    assert start.load_friction / start.load_share == pytest.approx(play.load_friction / play.load_share, rel=0.1)


@PLAYS
def test_from_there_a_fit_ends_at_the_truth(play: Backlash) -> None:
    comparison, base = compared(play)
    found = refitted(comparison, base, likeliest(play), 1)
    assert isinstance(found.effect, Backlash)
    assert found.effect.gap_rad == pytest.approx(play.gap_rad, rel=0.01)
    assert found.effect.load_share == pytest.approx(play.load_share, rel=0.05)
    assert found.evidence > 1000
    assert all_pass(admission(comparison, found))
