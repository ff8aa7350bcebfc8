"""Recordings of which nothing can be said are refused before anything is fitted, fitted or held out alike."""

from typing import Any

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.trust.admission import check_recordings
from cosim.support.errors import RecordingError


def swung(seconds: float, hertz: float = 0.2, rate: float = 200.0, size: float = 1.0, name: str = "swung") -> Recording:
    """A motion to and fro; of size 0 it rests away from zero."""
    t = np.arange(round(seconds * rate) + 1) / rate
    return Recording(name, {"t": t, "tau": np.sin(t), "q": 0.3 + size * np.sin(2 * np.pi * hertz * t)})


def spun(seconds: float, speed: float) -> Recording:
    """An axis of which only the speed was read."""
    t = np.arange(round(seconds * 200) + 1) / 200
    return Recording("spun", {"t": t, "tau": np.sin(t), "v": np.full(len(t), speed)})


@pytest.mark.parametrize(
    ("heldout", "says"),
    [
        (swung(10.0, size=0.0, name="still"), "still: q never moves, so there is nothing to diagnose"),
        (spun(10.0, 0.0), "spun: v never moves"),
        (swung(1.9, name="short"), "short: only 1.9 s long; a recording needs 2 s"),
    ],
)
@pytest.mark.parametrize("is_heldout", [True, False])
def test_what_rests_or_is_short_is_refused_by_its_name(heldout: Recording, says: str, is_heldout: bool) -> None:
    good = swung(10.0)
    with pytest.raises(RecordingError, match=says):
        check_recordings([good] if is_heldout else [good, heldout], [heldout] if is_heldout else [good])


@pytest.mark.parametrize(
    ("train", "enough"),
    [
        ([swung(8.0)], True),
        ([swung(7.9)], False),
        ([swung(4.0), swung(4.0)], True),
        ([spun(8.0, 1.0)], True),
        ([spun(7.9, 1.0)], False),  # a constant speed has no cycles
        ([swung(4.0, hertz=0.6)], True),  # 2.4 cycles in 4 s
        ([swung(4.0, hertz=0.4)], False),
        ([swung(3.9, hertz=0.6)], False),
        ([swung(4.0, hertz=0.6, rate=130.0)], True),  # 520 rows
        ([swung(4.0, hertz=0.6, rate=120.0)], False),  # 480 rows
    ],
)
def test_what_is_fitted_is_eight_seconds_or_four_with_two_cycles_in_500_rows(train: Any, enough: bool) -> None:
    if enough:
        check_recordings(train, [swung(2.1, hertz=2.0)])
        return
    with pytest.raises(RecordingError, match="fitting needs 8 s, or 4 s with 2 cycles in 500 rows"):
        check_recordings(train, [swung(2.1, hertz=2.0)])
