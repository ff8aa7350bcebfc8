"""Friction that falls with use is thermal only where the lubricant is seen to thin; else something without a name."""

import numpy as np
import pytest
from wandering import swing

from cosim.data.recording import Recording
from cosim.diagnosis.answer.result import Diagnosis
from cosim.diagnosis.diagnose import diagnose
from pyfmi_models.card import parse_card

CARD = '[mount]\nname = "axis"\ninertia = 5.0\n[friction]\nmodel = "coulomb"\nFc = 2.0\nsigma2 = 2.0\n'


def recorded(name: str, phase: float, level: float, viscosity: float, seconds: float = 8.0) -> Recording:
    """40 s of motion; level and viscosity fall by these shares, with a time constant."""
    t = np.arange(4_000) / 100
    rng = np.random.default_rng(int(10 * phase) + 1)
    q, v, a = swing(t, [(0.6, 0.11, phase), (0.25, 0.37, 1 + phase), (0.02, 0.9, 2.0)])
    gone = 1 - np.exp(-t / seconds)
    friction = 2 * np.sign(v) * (1 - level * gone) + 2 * v * (1 - viscosity * gone)
    return Recording(name, {"t": t, "tau": 5 * a + friction + 0.02 * rng.standard_normal(len(t)), "q": q})


def diagnosed(level: float, viscosity: float) -> Diagnosis:
    runs = [recorded(f"run {k}", 0.7 * k, level, viscosity) for k in range(3)]
    return diagnose(runs[:2], runs[2:], parse_card(CARD, "axis.toml")).diagnosis


@pytest.mark.parametrize(("level", "viscosity", "said"), [(0.3, 0.0, "unknown"), (0.1, 0.5, "thermal_viscosity")])
def test_friction_is_thermal_without_a_thermometer_where_viscosity_surely_falls(
    level: float, viscosity: float, said: str
) -> None:
    found = diagnosed(level, viscosity)
    assert found.verdict == (said,)
    rows = [row for row in found.ledger if row.effect == "thermal_viscosity"]
    ways = [rule.outcome for row in rows for rule in row.rules if "surely have the sign" in rule.name]
    assert ways == [said == "thermal_viscosity"]
