"""What is behind a play coasts, rubs and is caught; a diagnosis names it, with the width of the gap."""

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.effects import hypothesis_of
from cosim.estimation.play import SEARCHED, far_torques, stepped_torque
from cosim.estimation.prepare import prepare
from pyfmi_models.effects.backlash import Backlash

FAR, DT = 2.0, 1e-3


def torque(play: Backlash, v: np.ndarray) -> np.ndarray:
    """Torque passed on to the far side, the near one moving at v."""
    a = np.gradient(v, DT)
    return stepped_torque([play], [FAR], v, a, DT)[0] + FAR * a


def test_a_far_side_in_its_gap_takes_no_torque() -> None:
    v = 0.01 * np.sin(np.linspace(0, 20, 2000))  # 2 s: 6 mrad, less than half of the gap
    assert np.abs(torque(Backlash(gap_rad=0.02), v)).max() == 0


@pytest.mark.parametrize("side", [-1, 1])
def test_pushed_on_for_long_the_far_side_follows_and_needs_its_inertia_and_its_friction(side: int) -> None:
    t = DT * np.arange(4000)
    play = Backlash(gap_rad=1e-3, load_friction=0.3, load_viscous=0.5)
    passed = torque(play, side * 0.4 * t)
    np.testing.assert_allclose(passed[-500:], side * (FAR * 0.4 + 0.3 + 0.5 * 0.4 * t[-500:]), rtol=0.01)


def test_a_far_side_bends_its_friction_before_it_slides() -> None:
    """Pushed slowly over twice the deflection it takes `F (1 - exp(-x / deflection))`, and a little to be pressed."""
    play = Backlash(gap_rad=0.0, load_friction=0.3, load_deflection=1e-3)
    x = 1e-4 * DT * np.arange(20000)
    passed = torque(play, np.full_like(x, 1e-4))
    np.testing.assert_allclose(passed[2000:], 0.3 * (1 - np.exp(-x[2000:] / 1e-3)), atol=3e-3)


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
    prepared = prepare([Recording("r", {"t": t, "tau": np.zeros_like(t), "q": 0.1 * np.sin(3 * t)})], 20.0)
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
