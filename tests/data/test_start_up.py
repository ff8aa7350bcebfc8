"""Rows in which a loop is switched on are left out; a start that moves the axis, or only a rough one, stays."""

import numpy as np
import pytest

from cosim.data.own_rate import as_analysed
from cosim.data.recording import Recording
from cosim.estimation.prepare import prepare

RATE, INERTIA = 1000, 0.1


def run(speed: float, kick: float = 0.0, rise: float = 0.4) -> Recording:
    """An axis that speeds up within `rise` seconds and goes on with a ripple; the command alternates while it settles.

    The drive does not follow an alternating command: the motion knows nothing of it.
    """
    t = np.arange(3 * RATE) / RATE
    v = speed * (1 - np.exp(-3 * t / rise)) + 0.02 * speed * np.sin(2 * np.pi * 1.7 * t)
    a = np.gradient(v, 1 / RATE)
    tau = INERTIA * a + 1.3 + 0.7 * v
    tau = tau + kick * np.exp(-t / 0.004) * (-1.0) ** np.arange(len(t))
    noise = np.random.default_rng(round(10 * speed)).normal(0, 1, (2, len(t)))
    table = {"t": t, "tau": tau + 0.02 * noise[0], "q": np.cumsum(v) / RATE + 1e-5 * noise[1]}
    return Recording.of(table, f"at {speed:g}")


def test_a_loop_that_is_switched_on_is_left_out_and_said() -> None:
    taken = as_analysed(run(1.0, kick=60.0))
    assert taken.t[0] == pytest.approx(0.1)
    assert "in the first 0.1 s the torque alternates" in taken.notes[-1]
    assert np.abs(taken["tau"]).max() < 5


def there_and_back() -> Recording:
    slow = run(0.3)
    move = 8.0 * np.sin(2 * np.pi * slow.t / 0.1) * (slow.t < 0.1)
    return Recording.of({**slow.table, "tau": slow["tau"] + move}, "move")


def test_a_rough_start_and_one_that_moves_the_axis_stay() -> None:
    fast, quick = run(3.0, rise=0.01), there_and_back()
    for one in (fast, quick):
        assert np.abs(one["tau"][:100]).max() > 3 * np.abs(one["tau"][100:]).max(), "the torque alone would be enough"
    for one in (run(1.0), run(1.0, kick=4.0), run(3.0, rise=0.05), fast, quick):
        assert len(as_analysed(one)) == len(one)


def filtered(one: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Time and torque of the rows that count, at 8 Hz."""
    piece = prepare([one], 8.0).pieces[0]
    return piece.t[piece.inside], piece.tau[piece.inside]


def test_what_is_left_out_spreads_over_no_row_that_counts() -> None:
    (t, clean), (late, kicked) = filtered(run(1.0)), filtered(as_analysed(run(1.0, kick=300.0)))
    spoiled = filtered(run(1.0, kick=300.0))[1]
    assert np.abs(spoiled - clean)[t > 0.3].max() > 0.1, "the filter spreads the kick over half a second"
    assert np.abs(kicked - np.interp(late, t, clean)).max() < 0.01
