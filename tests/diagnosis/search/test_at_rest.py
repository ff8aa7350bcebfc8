"""A contact that bends says what is held at rest and must be right; one that settles rises by less than itself."""

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.search.admissibility import is_degenerate
from cosim.diagnosis.search.stages import admission, refitted
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from cosim.estimation.residuals import gets_memory, removed_at_rest
from cosim.estimation.row_weights import weights
from pyfmi_models.effects import TorqueOffset
from pyfmi_models.effects.dwell_breakaway import DwellBreakaway
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

FC, SIGMA0 = 2.0, 400.0
PLAIN = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=FC, sigma2=1.0), effects=())


def recording(seed: int, bends: bool) -> Recording:
    """Moves and rests in turn; what is held at rest is a bent contact's torque, or none that motion tells."""
    t = np.arange(5_000) / 200
    goes = (np.sin(2 * np.pi * t / 6 + seed) > -0.3).astype(float)
    goes = np.convolve(goes, np.hanning(60) / np.hanning(60).sum(), "same")
    v = goes * (0.4 * np.sin(2 * np.pi * t / 2.3 + seed) + 0.2 * np.sin(2 * np.pi * t / 0.9))
    q, z, held = np.cumsum(v) / 200, 0.0, np.zeros_like(t)
    for k, speed in enumerate(v):
        z = float(np.clip(z + SIGMA0 * speed / 200, -FC, FC))
        held[k] = z
    rng = np.random.default_rng(seed)
    if not bends:
        rest = np.abs(v) < 0.01
        held = np.where(rest, FC * np.sin(40 * t), np.sign(v) * FC)
    tau = 5 * np.gradient(v, t) + held + v + 0.02 * rng.standard_normal(len(t))
    return Recording(f"run_{seed}", {"t": t, "tau": tau, "q": q})


def comparison(bends: bool) -> tuple[Comparison, Fit]:
    prepared = prepare([recording(1, bends), recording(2, bends)], 30.0)
    problem = Problem(PLAIN, prepared, weights(PLAIN.friction, prepared), 1 / 200)
    base = problem.fit(PLAIN, 15)
    return Comparison.of(problem, base, POLICY), base


def test_a_contact_that_bends_is_told_by_what_it_holds_at_rest() -> None:
    for bends in (True, False):
        whole, base = comparison(bends)
        found = refitted(whole, base, Presliding(sigma0=SIGMA0), 1)
        assert (found.at_rest > POLICY.half) is bends
        assert all_pass(admission(whole, found)) is bends


def test_held_out_too() -> None:
    whole, base = comparison(True)
    there = prepare([recording(3, True)], 30.0)
    held = Predictive.of(whole, there, base, there)
    bent = Mount(name="axis", axis=PLAIN.axis, friction=PLAIN.friction, effects=(Presliding(sigma0=SIGMA0),))
    pushed = Mount(name="axis", axis=PLAIN.axis, friction=PLAIN.friction, effects=(TorqueOffset(torque=0.1),))
    assert held.at_rest(PLAIN, bent) > 0.9
    assert held.at_rest(PLAIN, pushed) == held.at_rest(bent, bent) == 0.0


def test_where_an_axis_hardly_rests_nothing_is_asked() -> None:
    weight, left, without = np.ones(50), np.ones(50), np.ones(50)
    weight[:9] = 0
    assert removed_at_rest(weight, 3 * left, without) == 1
    weight[9] = 0
    assert removed_at_rest(weight, 3 * left, without) == pytest.approx(-8)
    assert removed_at_rest(weight, 0.5 * left, without) == pytest.approx(0.75)


def test_memory_is_got_from_a_contact_and_from_nothing_else() -> None:
    bent = Mount(name="axis", axis=PLAIN.axis, friction=PLAIN.friction, effects=(Presliding(sigma0=SIGMA0),))
    assert gets_memory(bent, PLAIN)
    assert not gets_memory(bent, bent)
    assert not gets_memory(PLAIN, bent)


@pytest.mark.parametrize(
    ("rise", "settles"),
    [(0.01, False), (0.015, False), (0.03, True), (0.1, True), (1.01, True), (1.9, True), (2.1, False)],
)
def test_a_contact_settles_by_less_than_twice_its_level_and_more_than_that_wanders(rise: float, settles: bool) -> None:
    prepared = prepare([recording(1, True)], 30.0)
    problem = Problem(PLAIN, prepared, weights(PLAIN.friction, prepared), 1 / 200)
    effect = DwellBreakaway(torque_per_efold=rise * FC, memory_rad=0.01)
    assert is_degenerate(problem, effect) is not settles
