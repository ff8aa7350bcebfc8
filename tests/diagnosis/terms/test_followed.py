"""What a learned term may follow along a motion: acceleration, way, and what has passed since the speed turned."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.diagnosis.terms.dictionary import followed
from cosim_formulas.find import since
from pyfmi_models.effects.learned_base import SEEN_WITHIN

DT = 1e-3
T = DT * np.arange(8001)


def moving(q: np.ndarray, v: np.ndarray) -> Any:
    return SimpleNamespace(t=T, dt=DT, q=q, v=v)


def test_the_acceleration_is_that_of_the_motion_behind_a_short_lag() -> None:
    """Of a speed that grows evenly it is exact once the lag is over; of a sine it is that of a first order."""
    assert followed("acceleration", moving(T**2, 2 * T))[-1] == pytest.approx(2.0, rel=1e-3)  # half a row early
    w = 3.0
    found = followed("acceleration", moving(-np.cos(w * T) / w, np.sin(w * T)))
    gain, late = 1 / np.hypot(1, w * SEEN_WITHIN), np.arctan(w * SEEN_WITHIN)
    np.testing.assert_allclose(found[2000:], w * gain * np.cos(w * T[2000:] - late), atol=0.005)


def test_the_way_grows_whichever_way_the_axis_moves() -> None:
    found = followed("way", moving(0.5 * np.sin(T), 0.5 * np.cos(T)))
    assert found[0] == 0
    assert np.all(np.diff(found) >= 0)
    quarter = np.searchsorted(T, np.pi / 2)
    assert found[quarter] == pytest.approx(0.5, abs=1e-4)
    assert found[np.searchsorted(T, 3 * np.pi / 2)] == pytest.approx(1.5, abs=1e-4)


def test_time_and_way_count_from_the_last_reversal_or_the_start() -> None:
    piece = moving(0.5 * np.sin(T), 0.5 * np.cos(T))
    turned = np.searchsorted(T, np.pi / 2)
    time, way = since("time since reversal", piece), since("way since reversal", piece)
    for k in (500, 1500):
        assert (time[k], way[k]) == (pytest.approx(T[k]), pytest.approx(0.5 * np.sin(T[k])))
    assert time[turned] == pytest.approx(0.0, abs=1.5 * DT)
    for k in (turned + 400, turned + 2500):
        assert time[k] == pytest.approx(T[k] - np.pi / 2, abs=1.5 * DT)
        assert way[k] == pytest.approx(0.5 * (1 - np.sin(T[k])), abs=1e-5)
