"""Friction of any machine is a little uneven over position: that is no physics a card lacks, ten per cent are."""

from dataclasses import replace

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.answer.scores import EffectScores, ResidualScores, Scores, TermScores
from cosim.diagnosis.decide.decision import decide
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.effects import hypothesis_of
from pyfmi_models.card import parse_card
from pyfmi_models.effects import LocalFriction, PeriodicFriction

CARD = parse_card('[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 3.0\n', "card.toml")


def recorded(uneven: float, seed: int) -> Recording:
    """An axis, 1.3 rad either way, whose friction rises and falls by so much eight times a turn."""
    t = np.arange(2000) / 100
    slow, fast = 0.5 + 0.05 * seed, 1.3 + 0.1 * seed
    q = 1.2 * np.sin(slow * t + seed) + 0.1 * np.sin(fast * t + 1)
    v = 1.2 * slow * np.cos(slow * t + seed) + 0.1 * fast * np.cos(fast * t + 1)
    a = -1.2 * slow**2 * np.sin(slow * t + seed) - 0.1 * fast**2 * np.sin(fast * t + 1)
    noise = 0.01 * np.random.default_rng(seed).standard_normal(len(t))
    tau = 2 * a + (1 + uneven * np.cos(8 * q)) * np.sign(v) + 3 * v + noise
    return Recording(f"run_{seed}", {"t": t, "q": q, "tau": tau})


@pytest.mark.parametrize(("uneven", "said"), [(0.02, ()), (0.1, ("position_friction",))])
def test_a_name_needs_more_than_any_machine_is_uneven_by(uneven: float, said: tuple[str, ...]) -> None:
    runs = [recorded(uneven, seed) for seed in (1, 2, 3)]
    assert diagnose(runs[:2], runs[2:], CARD).diagnosis.verdict == said


def test_a_small_further_wave_of_a_large_one_stays() -> None:
    large, small = (
        PeriodicFriction(cycles_per_rev=k, relative_amplitude=r, phase=0.0) for k, r in ((8, 0.2), (16, 0.01))
    )
    own = hypothesis_of(small)
    assert own.is_plausible(small, replace(CARD.plant(), effects=(large, small)))
    assert not own.is_plausible(small, replace(CARD.plant(), effects=(small,)))


@pytest.mark.parametrize(("rise", "named"), [(-0.03, False), (0.05, True)])
def test_a_spot_is_rough_from_there_on(rise: float, named: bool) -> None:
    spot = LocalFriction(q_center=0.1, width=0.2, relative_amplitude=rise)
    assert hypothesis_of(spot).is_plausible(spot, CARD.plant()) == named


@pytest.mark.parametrize(("uneven", "unknown"), [(0.028, False), (0.029, True)])
def test_nor_is_it_something_unknown(uneven: float, unknown: bool) -> None:
    term = TermScores("friction level over position", 200.0, 0.5, uneven=uneven)
    assert decide(Scores([], ResidualScores(0.0, 0.0, [term])), POLICY).is_unknown == unknown


@pytest.mark.parametrize(("uneven", "unknown"), [(0.01, False), (0.1, True)])
def test_nor_does_it_make_a_name_doubtful(uneven: float, unknown: bool) -> None:
    """A name that explains little stands against 45 nats of another cause, unless as much as itself is left."""
    name = EffectScores("cogging", 200.0, {}, {"cogging": 0.5}, predicted=100.0)
    level = TermScores("friction level over position", 200.0, -0.5, uneven=uneven)
    rest = ResidualScores(0.0, 0.0, [level, TermScores("temperature", 45.0, 0.1)])
    assert decide(Scores([name], rest), POLICY).is_unknown == unknown
