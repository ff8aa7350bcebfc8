"""What is behind a play coasts, rubs and is caught; a diagnosis finds it from afar, with the width of the gap."""

from dataclasses import replace

import numpy as np
import pytest
from problems import compared
from wandering import recorded, swing

from cosim.data.recording import Recording
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.diagnose import _problem
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.search.stages import admission, refitted
from cosim.estimation.inverse import Inverse
from cosim.estimation.play import SEARCHED, far_torques, stepped_torque
from cosim.estimation.prepare import prepare
from pyfmi_models.card import parse_card
from pyfmi_models.effects.backlash import Backlash

FAR, DT = 2.0, 1e-3


def torque(play: Backlash, v: np.ndarray) -> np.ndarray:
    """Torque passed on to the far side, the near one moving at v."""
    a = np.gradient(v, DT)
    return stepped_torque([play], [FAR], v, a, DT)[0] + FAR * a


@pytest.mark.parametrize("side", [-1, 1])
def test_pushed_on_for_long_the_far_side_follows_and_needs_its_inertia_and_its_friction(side: int) -> None:
    t = DT * np.arange(4000)
    play = Backlash(gap_rad=1e-3, load_friction=0.3, load_viscous=0.5)
    passed = torque(play, side * 0.4 * t)
    np.testing.assert_allclose(passed[-500:], side * (FAR * 0.4 + 0.3 + 0.5 * 0.4 * t[-500:]), rtol=0.01)


def test_a_near_side_that_stops_is_left_for_as_long_as_the_gap_is_wide() -> None:
    """At rest from 1 s on, it is left with 0.1 rad/s; friction takes 0.05 rad/s2, so 20 mrad are crossed in 212 ms."""
    t = DT * np.arange(3000)
    v = np.where(t < 1, 0.1, 0.0)
    passed = torque(Backlash(gap_rad=0.02, load_friction=0.05 * FAR), v)
    met = t[np.flatnonzero((t > 1.01) & (np.abs(passed) > 1e-3))[0]] - 1
    assert met == pytest.approx((0.1 - np.sqrt(0.1**2 - 2 * 0.05 * 0.02)) / 0.05, abs=5e-3)
    caught = t > 1.01
    # What it still had of speed goes; the contact is well damped, so that at most a fifth of it comes back.
    assert 1.0 < DT * passed[caught].sum() / (-FAR * (0.1 - 0.05 * met)) < 1.2


@pytest.mark.parametrize("rows", [1, 2, 5])
def test_the_momentum_that_is_told_hardly_depends_on_how_dense_the_rows_are(rows: int) -> None:
    t = 1e-3 * np.arange(20000)
    v, a = 0.2 * np.sin(3 * t), 0.6 * np.cos(3 * t)
    play = Backlash(gap_rad=5e-3, load_friction=0.2, load_viscous=0.3)
    fine = np.cumsum(stepped_torque([play], [FAR], v, a, 1e-3)) * 1e-3
    coarse = np.cumsum(stepped_torque([play], [FAR], v[::rows], a[::rows], rows * 1e-3)) * rows * 1e-3
    assert np.std(coarse - fine[::rows]) < 0.05 * np.std(fine)


def test_a_search_slows_the_far_side_by_dry_and_by_viscous_friction() -> None:
    """What the search offers for a gap is the play's own torque, its oil included, in the band of the diagnosis."""
    t = DT * np.arange(20000)
    prepared = prepare([recorded(0 * t, t, 0.1 * np.sin(3 * t))], 20.0)
    piece, dry, ratio = prepared.pieces[0], 0.02, 10.0
    step = max(1, int(1 / (SEARCHED * piece.dt)))
    play = Backlash(gap_rad=5e-3, load_friction=dry, load_viscous=ratio * dry)
    exact = stepped_torque([play], [1.0], piece.v[::step], piece.a[::step], step * piece.dt)[0]
    told = far_torques(prepared, ((5e-3, dry),), ratio)[:, 0]
    expected = piece.lowpass(np.interp(piece.t, piece.t[::step], exact))[piece.kept]
    np.testing.assert_allclose(told, expected, atol=1e-12)
    assert np.std(told - far_torques(prepared, ((5e-3, dry),), 0.0)[:, 0]) > 0.05 * np.std(told)


@pytest.mark.parametrize(("share", "degenerate"), [(0.08, True), (0.1, False)])
def test_behind_a_play_is_more_than_a_bristle(share: float, degenerate: bool) -> None:
    """Four nulls of two generators had up to .077 of the inertia there, a true play was found at .11."""
    play = Backlash(gap_rad=1e-3, load_share=share, load_friction=0.3)
    assert hypothesis_of(play).is_degenerate(None, play) is degenerate  # type: ignore[arg-type]


# A play with a stiff contact is found from afar: the grid that looks for it gets finer as its averages get shorter.

CARD = parse_card('[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 1.0\n', "card.toml")


def played(play: Backlash, seed: int) -> Recording:
    """Two slow tones, and what the axis needs for them with a play behind it, 100 Hz of band."""
    t, rng = np.arange(15000) / 1000, np.random.default_rng(seed)
    q, _, _ = swing(t, [(0.3, 1.5, 1.5 * seed), (0.03, 5.0, 5.0 * seed)], per=1)
    (piece,) = prepare([recorded(t, t, q)], 450.0).pieces
    tau = Inverse(replace(CARD.plant(), effects=(play,)), ()).torque(piece, np.zeros(0))[0]
    return recorded(tau + 0.02 * rng.standard_normal(len(tau)), piece.t, piece.q, f"run_{seed}")


@pytest.mark.parametrize(("gap", "friction"), [(5e-3, 0.4), (1e-3, 0.2)])
def test_from_the_likeliest_place_of_the_grid_a_fit_ends_at_the_truth(gap: float, friction: float) -> None:
    play = Backlash(gap_rad=gap, load_share=0.4, load_friction=friction)
    comparison, base = compared(_problem([played(play, seed) for seed in (1, 2)], CARD), 40)
    looked = [one for one in comparison.screen(base) if one.candidate.effect == "backlash"]
    best = max(looked, key=lambda one: one.evidence)
    found = refitted(comparison, base, best.candidate.start(best.coefficients), 1)
    assert isinstance(found.effect, Backlash)
    assert found.effect.gap_rad == pytest.approx(gap, rel=0.01)
    assert found.effect.load_share == pytest.approx(play.load_share, rel=0.05)
    assert found.evidence > 1000
    assert all_pass(admission(comparison, found))
