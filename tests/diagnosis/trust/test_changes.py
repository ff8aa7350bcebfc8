"""A change in the middle of a recording is told with time and size; what changes slowly or with the motion is none."""

import numpy as np
import pytest
from learned_cases import FC, MOUNT, NOISE, Array, night

from cosim.data.recording import Recording
from cosim.diagnosis.trust.changes import changes
from cosim.estimation.prepare import prepare

AFTER = 25.0


def said(more: Array, now: dict[str, Array], seed: int = 1) -> list[str]:
    """What is said of an axis whose torque holds something more."""
    noise = np.random.default_rng(seed).normal(0, NOISE, len(now["t"]))
    tau = 5.0 * now["a"] + FC * np.tanh(now["v"] / 1e-3) + now["v"] + more + noise
    prepared = prepare([Recording("run", {"t": now["t"], "q": now["q"], "tau": tau})], 10.0)
    return [one.statement for one in changes((prepared,), MOUNT)]


@pytest.mark.parametrize(
    ("words", "load"),
    [
        ("a constant torque of 0.8 N·m more", lambda now: 0.8),
        ("a constant torque of 0.8 N·m less", lambda now: -0.8),
        ("a friction level of 0.6 N·m more", lambda now: 0.6 * np.tanh(now["v"] / 1e-3)),
        ("an inertia of 2 kg·m² more", lambda now: 2.0 * now["a"]),
        ("a weight of 4 N·m more", lambda now: 4.0 * np.sin(now["q"] + 0.3)),
    ],
)
def test_what_comes_at_a_time_is_told_with_time_and_size(words: str, load) -> None:
    now = night(1)
    (text,) = said((now["t"] >= AFTER) * load(now), now)
    assert words.split(" of ")[0] in text
    assert float(text.split(" of ")[1].split()[0]) == pytest.approx(float(words.split(" of ")[1].split()[0]), rel=0.1)
    assert float(text.split("t = ")[1].split()[0]) == pytest.approx(AFTER, abs=0.5)
    assert words.split()[-1] in text


def test_what_is_there_all_the_time_or_changes_slowly_is_no_change_at_a_time() -> None:
    now = night(2)
    t, level = now["t"], np.tanh(now["v"] / 1e-3)
    for more in (0 * t, 0.8 + 0 * t, 4.0 * np.sin(now["q"]), 0.8 * np.exp(-t / 15), 0.6 * level * t / 60, 0.5 * level):
        assert said(more, now) == []


def test_a_change_that_is_small_beside_the_rest_is_not_told() -> None:
    now = night(4)
    shaken = 0.6 * np.sin(9.1 * now["t"] + 3 * np.sin(0.9 * now["t"]))
    assert said(0.4 * (now["t"] >= AFTER) + shaken, now) == []


def test_a_law_that_is_off_over_speed_is_no_change_where_the_motion_gets_faster() -> None:
    t = night(3)["t"]
    faster = t >= AFTER
    time = np.where(faster, 6 * t - 5 * AFTER, t)
    now = {"t": t, "q": 0.4 * np.sin(0.7 * time) + 0.1 * np.sin(1.9 * time)}
    now["v"] = np.gradient(now["q"], now["t"])
    now["a"] = np.gradient(now["v"], now["t"])
    assert np.abs(now["v"][faster]).max() > 2 * np.abs(now["v"][~faster]).max()
    for more in (1.5 * now["v"] * np.abs(now["v"]), -3.0 * np.tanh(now["v"] / 0.3)):
        assert said(more, now) == []
