"""A table whose rows hold one channel each, as an outer join of topics writes it, is put on one time base."""

from pathlib import Path

import numpy as np
import pytest

from cosim.data.preview import preview
from cosim.data.recording import Recording

T = np.arange(1200) / 1000


def written(
    path: Path, rows: dict[float, dict[str, float]], names: tuple[str, ...], time: str = "t", size: float = 1
) -> Path:
    lines = [
        ",".join([f"{t / size:.9g}", *(f"{rows[t][n]:.9g}" if n in rows[t] else "" for n in names)])
        for t in sorted(rows)
    ]
    path.write_text("\n".join([",".join([time, *names]), *lines]) + "\n")
    return path


def outer(**channels: tuple[np.ndarray, np.ndarray]) -> dict[float, dict[str, float]]:
    rows: dict[float, dict[str, float]] = {}
    for name, (t, x) in channels.items():
        for one, value in zip(t.tolist(), x.tolist(), strict=True):
            rows.setdefault(round(one, 9), {})[name] = value
    return rows


@pytest.mark.parametrize("samples", [120, 300, 1200])
def test_two_topics_in_turn_are_joined_however_long_the_table_is(tmp_path: Path, samples: int) -> None:
    t = T[:samples]
    rows = outer(tau=(t, np.cos(9 * t)), q=(t + 3e-4, 0.1 * np.sin(9 * t + 0.0027)))
    seen = preview(written(tmp_path / "run.csv", rows, ("tau", "q")))
    one = seen.recording
    assert seen.refused == ""
    assert (len(one), one.sample_time) == (samples - 1, pytest.approx(1e-3, rel=1e-6))
    np.testing.assert_allclose(one["q"], 0.1 * np.sin(9 * one.t), atol=1e-9)
    np.testing.assert_allclose(one["tau"], np.cos(9 * one.t), atol=2e-5)
    assert '"tau" (1,000 Hz, ' in one.notes[0]


def test_a_slow_column_in_full_rows_keeps_its_own_rate_and_a_third_topic_its_names(tmp_path: Path) -> None:
    late = T[20:] + 3e-4
    rows = outer(tau=(T, np.cos(9 * T)), q=(T[::10], np.sin(9 * T[::10])), temperature=(late[::50], 20 + late[::50]))
    one = Recording.read(written(tmp_path / "run.csv", rows, ("tau", "q", "temperature")))
    assert one.sample_time == pytest.approx(0.01)
    np.testing.assert_allclose(one["q"], np.sin(9 * one.t), atol=1e-9)
    np.testing.assert_allclose(one["temperature"], 20 + np.clip(one.t, late[0], late[::50][-1]), atol=1e-6)
    assert one.t[0] == pytest.approx(0.01)


def test_topics_below_each_other_in_ms_are_joined(tmp_path: Path) -> None:
    """First all rows of one, then all of the other: time falls, and that is no other recording."""
    path = tmp_path / "run.csv"
    rows = [f"{1e3 * t:.1f},{np.cos(9 * t):.6f}," for t in T] + [f"{1e3 * t:.1f},,{np.sin(9 * t):.6f}" for t in T]
    path.write_text("\n".join(["stamp,torque,angle", *rows]) + "\n")
    for options in ({}, {"columns": {"t": "stamp"}, "units": {"t": "ms"}}):
        one = Recording.read(path, **options)
        assert (len(one), one.duration) == (len(T), pytest.approx(T[-1]))
        np.testing.assert_allclose(one["q"], np.sin(9 * T), atol=1e-6)


def test_a_table_of_one_kind_of_values_in_memory_is_joined_too() -> None:
    t = np.sort(np.concatenate([T, T + 4e-4]))
    tau = np.where(np.arange(len(t)) % 2 == 0, np.cos(9 * t), np.nan)
    q = np.where(np.arange(len(t)) % 2 == 1, np.sin(9 * t), np.nan)
    one = Recording.of({"t": t, "tau": tau, "q": q})
    np.testing.assert_allclose(one["q"], np.sin(9 * one.t), atol=1e-12)
