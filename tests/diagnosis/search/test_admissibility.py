"""When a fitted effect is none: on motions of which every number is known."""

import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from motions import Array, Motion
from scipy.signal import lfilter
from wandering import posed

from cosim.data.recording import Recording
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.search import admissibility
from cosim.diagnosis.search.admissibility import in_time, is_degenerate, name_rules, needs_turns
from cosim.diagnosis.search.candidate_fit import weighed
from cosim.diagnosis.search.instrumental_variable import is_asked_for
from cosim.diagnosis.search.stages import admission, refitted
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from cosim.estimation.residuals import away_from_turns, gets_memory, removed_at_rest
from cosim.estimation.row_weights import weights
from pyfmi_models.effects import Delay, TorqueOffset
from pyfmi_models.effects.compliance import LoadSideCompliance
from pyfmi_models.effects.dwell_breakaway import DwellBreakaway
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

EFFECT: Any = SimpleNamespace(broken_rule=lambda: "")
BROKEN: Any = SimpleNamespace(broken_rule=lambda: "a rule")
Declared = Callable[..., None]


@pytest.fixture
def declared(monkeypatch: pytest.MonkeyPatch) -> Declared:
    """What the hypothesis of an effect declares, as a table."""

    def declare(at_bound: bool = False, is_timing: bool = True, **more: Any) -> None:
        said = {"is_plausible": True, "shows": True, "is_degenerate": False, "way_back": 0.0} | more
        asked = {name: lambda *_, answer=answer: answer for name, answer in said.items()}
        hypothesis = SimpleNamespace(sizes=(), may_end=(), is_timing=is_timing, **asked)
        monkeypatch.setattr(admissibility, "hypothesis_of", lambda _: hypothesis)
        monkeypatch.setattr(admissibility, "at_bound", lambda *_: at_bound)
        monkeypatch.setattr(admissibility, "recorded_by", lambda _: None)

    return declare


def replace_at(values: Array, place: int, value: float) -> Array:
    changed = values.copy()
    changed[place] = value
    return changed


def to_and_fro(*reach: float) -> Motion:
    """Each recording goes from 0 to 1 and back by so much; its first and last row are not inside."""
    q = [np.array([-9.0, 0.0, 0.5, 1.0, 1.0 - back, 9.0]) for back in reach]
    return Motion({"v": [np.ones(6) for _ in reach], "q": q})


@pytest.mark.parametrize(("back", "needed"), [(0.29, False), (0.3, False), (0.31, True)])
def test_friction_is_told_by_the_longest_way_back_of_any_recording(back, needed, declared):
    declared(way_back=back)
    down = Motion({"v": [np.ones(6)], "q": [-one for one in to_and_fro(0.3).columns["q"]]})
    for motion in (to_and_fro(0.3, 0.1), to_and_fro(0.1, 0.3), down):
        assert needs_turns(EFFECT, None, motion) is needed


@pytest.mark.parametrize(
    ("effect", "said", "degenerate", "admissible"),
    [
        (EFFECT, {}, False, True),
        (BROKEN, {}, True, False),
        (EFFECT, {"at_bound": True}, True, False),
        (EFFECT, {"is_degenerate": True}, True, False),
        (EFFECT, {"is_plausible": False}, False, False),
        (EFFECT, {"shows": False}, False, False),
        (EFFECT, {"way_back": 0.5}, False, False),
    ],
)
def test_an_effect_is_admissible_if_nothing_speaks_against_it(effect, said, degenerate, admissible, declared):
    declared(**said)
    problem: Any = SimpleNamespace(prepared=to_and_fro(0.3))
    one: Any = SimpleNamespace(effect=effect, fit=SimpleNamespace(mount=SimpleNamespace(motion="rotary")))
    assert is_degenerate(problem, effect) is degenerate
    assert all_pass(name_rules(problem, one)) is admissible


STEPS = np.array([0.0, 2.0, 0.0, 2.0, 100.0, 102.0, 100.0, 102.0])
WILD = np.concatenate([STEPS[:4] * 0.1, STEPS[4:] * 5 + 1e6])
ONE_ROW = replace_at(0.1 * STEPS, 2, 1e3)


@pytest.mark.parametrize(
    ("residual", "more", "told"),
    [
        pytest.param(STEPS * 0.7, {}, True, id="0.49 of the energy of its changes is left"),
        pytest.param(STEPS * 0.71, {}, False, id="0.504 of it"),
        pytest.param(STEPS * np.repeat([1.0, 0.0], 4), {}, False, id="exactly half"),
        pytest.param(0.1 * STEPS + np.repeat([0.0, 1e3], 4), {}, True, id="the step between recordings is no change"),
        pytest.param(WILD, {}, False, id="more in the second recording"),
        pytest.param(WILD, {"asked": [True, False]}, True, id="nothing is asked in the second recording"),
        pytest.param(STEPS * 9, {"timing": False}, True, id="no effect of timing"),
        pytest.param(ONE_ROW, {}, False, id="all in one row"),
        pytest.param(ONE_ROW, {"weight": replace_at(np.ones(8), 2, 0.0)}, True, id="in a row without weight"),
    ],
)
def test_timing_is_told_where_half_of_the_torques_changes_are_explained(residual, more, told, declared):
    declared(is_timing=more.get("timing", True))
    motion = Motion({"v": [np.ones(4)] * 2, "tau": [STEPS[:4], STEPS[4:]]}, more.get("asked", []))
    problem: Any = SimpleNamespace(prepared=motion, weight=more.get("weight", np.ones(8)))
    one: Any = SimpleNamespace(effect=EFFECT, fit=SimpleNamespace(residual=residual))
    assert in_time(problem, one) is told


# A spring must be asked for by the set point, and what is late must be late away from turns too.

J, DT, SECONDS = 2.0, 2e-3, 60.0
MOUNT = Mount(name="axis", axis=Axis(inertia=J), friction=Coulomb(Fc=0.5, sigma2=0.5))
SPRING = LoadSideCompliance(resonance_hz=12.0, encoder_share=0.5)


def motion(noise: float, asked: float, seed: int) -> tuple[Any, Any, Any]:
    """Time, set point and position of an axis that a slow loop holds: torque noise moves it, the loop answers."""
    rng, t = np.random.default_rng(seed), np.arange(0, SECONDS, DT)
    q_d = 0.5 * np.sin(2 * np.pi * 0.2 * t) + asked * np.sin(2 * np.pi * 5 * t) / (2 * np.pi * 5) ** 2
    w, e = 2 * np.pi * 4, rng.standard_normal(len(t)) * noise
    # e'' + 1.4 w e' + w^2 e = noise, by semi-implicit Euler
    moved = lfilter([DT**2], [1, -2 + 1.4 * w * DT + (w * DT) ** 2, 1 - 1.4 * w * DT], e)
    return t, q_d, q_d + moved


def recordings(noise: float, asked: float, spring: bool) -> list[Recording]:
    """Two recordings: the torque of the loop, without the noise that moved the axis, or of a machine with a spring."""
    out = []
    for seed in (1, 2):
        t, q_d, q = motion(noise, asked, seed)
        v, a = np.gradient(q, DT), np.gradient(np.gradient(q, DT), DT)
        desired = np.gradient(np.gradient(q_d, DT), DT)
        w = 2 * np.pi * 4
        answer = desired - 1.4 * w * np.gradient(q - q_d, DT) - w**2 * (q - q_d)
        tau = J * (a if spring else answer) + 0.5 * v + 0.5 * np.sign(v)
        if spring:
            tau = tau + J * np.gradient(np.gradient(a, DT), DT) / (2 * np.pi * 12.0) ** 2
        out.append(Recording(f"run_{seed}", {"t": t, "q": q, "q_d": q_d, "tau": tau}))
    return out


@pytest.mark.parametrize(
    ("noise", "asked", "spring", "columns", "told"),
    [
        pytest.param(0.0, 2.0, True, ("t", "q", "q_d", "tau"), True, id="a spring that the set point moves"),
        pytest.param(0.5, 2.0, True, ("t", "q", "q_d", "tau"), True, id="beside noise"),
        pytest.param(5.0, 0.0, False, ("t", "q", "q_d", "tau"), False, id="a loop that answers noise"),
        pytest.param(5.0, 0.0, False, ("t", "q", "tau"), True, id="without a set point nobody can be asked"),
    ],
)
def test_a_spring_is_asked_for_by_the_set_point(noise, asked, spring, columns, told):
    made = [Recording(one.name, {n: one.table[n] for n in columns}) for one in recordings(noise, asked, spring)]
    problem = posed(MOUNT, made, 8.0)
    base = problem.fit(MOUNT, 25)
    found = problem.fit(replace(base.mount, effects=(SPRING,)), 15)
    assert is_asked_for(Comparison.of(problem, base, POLICY), found, found.mount.effects[-1]) is told


def test_what_is_late_about_turns_alone_is_not_named() -> None:
    """An axis that sticks within a step of its encoder is read late as it turns: the friction is 20 ms ahead, alone."""
    made = []
    for seed in (1, 2):
        t = np.arange(0, SECONDS, DT)
        v = np.cos(2 * np.pi * 0.3 * t + seed) + 0.3 * np.cos(2 * np.pi * 0.11 * t)
        ahead = np.sign(np.interp(t + 0.02, t, v))
        a = np.gradient(v, DT)
        noise = 0.02 * np.random.default_rng(seed).standard_normal(len(t))
        tau = 0.01 * a + 0.5 * v + 2 * ahead + noise
        made.append(Recording(f"run_{seed}", {"t": t, "q": np.cumsum(v) * DT, "tau": tau}))
    mount = replace(MOUNT, axis=Axis(inertia=0.01), friction=Coulomb(Fc=2.0, sigma2=0.5))
    problem = posed(mount, made, 8.0)
    base = problem.fit(problem.mount, 25)
    comparison = Comparison.of(problem, base, POLICY)
    found = problem.fit(replace(base.mount, effects=(Delay(delay_ms=5.0),)), 15)
    one = weighed(comparison, found, base)
    assert one.evidence > POLICY.clear
    assert one.away < POLICY.small
    assert not all_pass(admission(comparison, one))
    assert all_pass(admission(comparison, replace(one, away=1.0)))


# A contact that bends says what is held at rest and must be right; one that settles rises by less than itself.

FC, SIGMA0 = 2.0, 400.0
PLAIN = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=FC, sigma2=1.0))


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


BENT = replace(PLAIN, effects=(Presliding(sigma0=SIGMA0),))


@pytest.mark.parametrize("bends", [True, False])
def test_a_contact_that_bends_is_told_by_what_it_holds_at_rest(bends: bool) -> None:
    whole, base = comparison(bends)
    found = refitted(whole, base, Presliding(sigma0=SIGMA0), 1)
    assert (found.at_rest > POLICY.half) is bends
    assert all_pass(admission(whole, found)) is bends


def test_a_contact_alone_gives_memory_which_is_judged_held_out_too() -> None:
    whole, base = comparison(True)
    there = prepare([recording(3, True)], 30.0)
    held = Predictive.of(whole, there, base, there)
    assert held.at_rest(PLAIN, BENT) > 0.9
    assert held.at_rest(PLAIN, replace(PLAIN, effects=(TorqueOffset(torque=0.1),))) == held.at_rest(BENT, BENT) == 0.0
    assert gets_memory(BENT, PLAIN)
    assert not gets_memory(BENT, BENT)
    assert not gets_memory(PLAIN, BENT)


@pytest.mark.parametrize(
    ("rise", "settles"),
    [(0.01, False), (0.015, False), (0.03, True), (0.1, True), (1.01, True), (1.9, True), (2.1, False)],
)
def test_a_contact_settles_by_less_than_twice_its_level_and_more_than_that_wanders(rise: float, settles: bool) -> None:
    prepared = prepare([recording(1, True)], 30.0)
    problem = Problem(PLAIN, prepared, weights(PLAIN.friction, prepared), 1 / 200)
    effect = DwellBreakaway(torque_per_efold=rise * FC, memory_rad=0.01)
    assert is_degenerate(problem, effect) is not settles


# What formulas of admissibility are, by hand.


@pytest.mark.parametrize("rows", [9, 10])
def test_at_rest_counts_from_ten_rows_on_and_only_where_the_law_says_nothing(rows: int) -> None:
    weight = np.concatenate([np.ones(30), np.zeros(rows)])
    left, without = np.full(30 + rows, 0.5), np.full(30 + rows, 2.0)
    assert removed_at_rest(weight, left, without) == (1 - 0.25 / 4 if rows == 10 else 1.0)
    assert removed_at_rest(weight, without, left) == (1 - 4 / 0.25 if rows == 10 else 1.0)


@pytest.mark.parametrize(("removed", "told"), [(0.019, False), (0.021, True)])
def test_where_a_fiftieth_of_the_energy_goes_it_is_asked_where(removed, told, monkeypatch):
    """Of a hundred rows the last half are about turns; all is removed there."""
    far = np.repeat([1.0, 0.0], 50)
    monkeypatch.setattr("cosim.estimation.residuals.far_from_turns", lambda _: far)
    problem: Any = SimpleNamespace(prepared=None)
    without, left = np.ones(100), np.ones(100)
    left[50:] = math.sqrt(1 - 2 * removed)
    assert away_from_turns(problem, left, without) == pytest.approx(0.0 if told else 1.0, abs=1e-9)
    if told:
        left[:50] = math.sqrt(1 - removed)
        assert away_from_turns(problem, left, without) == pytest.approx(1 / 3, rel=1e-9)
