"""Recordings as loggers leave them: a column that changes only later, a friction that is not seen. No traceback."""

import numpy as np
import pytest

from cosim.api.diagnose import diagnose
from cosim.data.recording import Recording
from cosim.diagnosis.terms.dictionary import user_columns
from cosim.estimation.prepare import prepare

STEP = 0.03


def moving(name: str, seed: int, level: float, **columns: np.ndarray) -> Recording:
    """.02 kg m2 at 33 Hz with viscous friction, a level of Coulomb friction, and a ripple that no card has."""
    t = np.arange(0, 35, STEP)
    q = 0.5 * np.sin(1.3 * t + seed) + 0.2 * np.sin(2.9 * t)
    v = np.gradient(q, STEP)
    noise = 0.004 * np.random.default_rng(seed).standard_normal(len(t))
    tau = 0.02 * np.gradient(v, STEP) + level * np.tanh(v / 0.01) + 0.15 * v + 0.03 * np.sin(11 * q) + noise
    return Recording(name, {"t": t, "tau": tau, "q": q} | columns)


def test_a_column_that_changes_only_later_is_no_cause() -> None:
    still = np.full(len(np.arange(0, 35, STEP)), 26.0)
    later = np.where(np.arange(len(still)) > 600, 27.0, 26.0)
    train, held = moving("a", 1, 0.2, temperature=still), moving("b", 2, 0.2, temperature=later)
    assert user_columns(prepare([train], 8.0)) == {}
    assert set(user_columns(prepare([held], 8.0))) == {"temperature"}
    found = diagnose([train], [held]).diagnosis
    assert found.heldout.before_rms > 0


@pytest.mark.parametrize("level", [0.0, 0.006])
def test_friction_that_is_not_seen_has_no_forms(level: float) -> None:
    found = diagnose([moving("a", 1, level)], [moving("b", 2, level)]).diagnosis
    assert found.heldout.after_rms <= found.heldout.before_rms
