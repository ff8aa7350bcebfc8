"""The 95 % ranges of a diagnosis hold: over many seeded machines with coloured noise they cover what is true."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from wandering import swing

from cosim.data.recording import Recording
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.search.sizes import standard_errors
from cosim.estimation.blocks import Blocks
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from cosim.estimation.row_weights import weights
from cosim.support.statistics import Z95
from pyfmi_models.card import parse_card
from pyfmi_models.effects import GravityUnbalance, TorqueOffset
from pyfmi_models.effects.quadratic_drag import QuadraticDrag
from pyfmi_models.mount import Mount

HERTZ, SECONDS, MACHINES = 100, 60.0, 20
TEXT = '[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 3.0\n'
CARD = parse_card(TEXT, "c.toml")
TRUE = {
    "axis.inertia": 2.1,
    "friction.Fc": 1.1,
    "friction.sigma2": 2.8,
    "gravity_unbalance.mgl": 0.6,
    "gravity_unbalance.phase": 0.7,
    "torque_offset.torque": -0.2,
    "quadratic_drag.coefficient": 0.4,
}


def recorded(rng: np.random.Generator, name: str, seconds: float = SECONDS) -> Recording:
    """A motion of two tones and the torque of the true machine, with noise that forgets itself in 0.3 s."""
    t = np.arange(int(seconds * HERTZ)) / HERTZ
    tones = ((0.8, 0.15, 0.25), (0.15, 0.4, 0.6))
    q, v, a = swing(t, [(size, rng.uniform(low, high), rng.uniform(0, 2 * np.pi)) for size, low, high in tones])
    keep = np.exp(-1 / HERTZ / 0.3)
    noise = 0.05 * lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal(t.size))
    friction = 1.1 * np.sign(v) + 2.8 * v + 0.4 * v * np.abs(v)
    return Recording(name, {"t": t, "tau": 2.1 * a + friction + 0.6 * np.sin(q + 0.7) - 0.2 + noise, "q": q})


def of_fit(train: Sequence[Recording], mount: Mount) -> tuple[Fit, dict[str, float]]:
    """A structure fitted to recordings, and its standard errors."""
    prepared = prepare(train, 20.0)
    problem = Problem(CARD.plant(), prepared, weights(CARD.friction, prepared), 1 / HERTZ)
    found = problem.fit(mount, 25)
    return found, standard_errors(found, Blocks.of(prepared), problem.weight)


def test_ranges_of_95_per_cent_hold_what_is_true_in_95_per_cent() -> None:
    """Of 140 ranges 133 should; errors half as large would hold 95, errors twice as large all."""
    effects = (GravityUnbalance(mgl=0.5, phase=0.5), TorqueOffset(torque=0.1), QuadraticDrag(coefficient=0.1))
    inside = []
    for seed in range(MACHINES):
        rng = np.random.default_rng([seed, 15])
        train = [recorded(rng, name) for name in ("one", "two")]
        found, errors = of_fit(train, replace(CARD.plant(), effects=effects))
        assert set(errors) == set(TRUE) == set(found.free)
        inside += [abs(value - TRUE[name]) < Z95 * errors[name] for name, value in found.parameters().items()]
    assert len(inside) == 7 * MACHINES
    assert 0.91 < np.mean(inside) < 0.99


KNOWN = """
[[effects]]
effect = "torque_offset"
torque = -0.2
[[effects]]
effect = "quadratic_drag"
coefficient = 0.4
"""


def test_the_ranges_that_are_printed_are_made_of_these_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever they are: here 0.01 each. The card knows all but the weight."""
    rng, card = np.random.default_rng(3), parse_card(TEXT + KNOWN, "c.toml")
    one, two, three = (recorded(rng, name, 20.0) for name in ("one", "two", "three"))
    monkeypatch.setattr("cosim.diagnosis.diagnose.standard_errors", lambda fit, *_: dict.fromkeys(fit.free, 0.01))
    found = [each for each in diagnose([one, two], [three], card).diagnosis.findings if each.answer == "found"]
    assert [each.effect for each in found] == ["gravity_unbalance"]
    assert found[0].standard_errors == {"mgl": 0.01, "phase": 0.01}
    for low, high in found[0].ranges.values():
        assert high - low == pytest.approx(2 * 1.96 * 0.01)
