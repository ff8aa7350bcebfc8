"""The machines of a deck: every class obeys physics, and nothing about them gives away what is concealed."""

from collections import Counter

import numpy as np
import pandas as pd
import pytest
from scipy.signal import butter, filtfilt
from test_truth import FRICTION, SMOOTH, still

from cosim_studies.proof import truth
from cosim_studies.proof.beyond import SHAPELESS
from cosim_studies.proof.generator import ANY, FAMILIES, OUTSIDE, conceal, make_case, to_toml
from cosim_studies.proof.machines import MACHINES, suited
from cosim_studies.proof.motion import Pace
from cosim_studies.proof.outside import SHAPED
from cosim_studies.proof.strokes import STROKES
from cosim_studies.proof.truth import TICK
from cosim_studies.proof.workshop import CARDS, draw_workshop
from pyfmi_models.card import parse_card


@pytest.mark.parametrize("name", MACHINES)
def test_every_class_has_a_card_that_reads_a_loop_that_follows_and_a_null_that_is_one(name: str) -> None:
    case = make_case(list(MACHINES).index(name), [], duration=12.0, machine=name)
    card = parse_card(to_toml(case.card), "card.toml")
    setup, mount = case.truth["setup"], case.truth["mount"]
    assert (card.mount.motion, setup["machine"]) == (MACHINES[name].motion, name)
    for table, hidden in zip([*case.train, case.heldout], case.oracle, strict=True):
        dt = float(np.median(np.diff(table.t)))
        assert 1 / dt == pytest.approx(setup["rate_hz"])
        b, a = butter(4, min(0.9, 2 * dt * 12.0))
        smooth = [filtfilt(b, a, column) for column in (table.tau, hidden.angle, hidden.friction)]
        acceleration = np.gradient(np.gradient(smooth[1], dt), dt)
        known = mount.get("payload", 0.0) * np.sin(hidden.angle + mount.get("payload_phase", 0.0))
        rest = smooth[0] - mount["inertia"] * acceleration - smooth[2] - filtfilt(b, a, known)
        inside = (table.t > 1) & (table.t < table.t.iloc[-1] - 0.5)
        assert np.std(rest[inside]) < 0.15 * case.truth["friction_rms"]
        if "q_d" in table:
            assert np.abs(table.q - table.q_d).max() < 0.25 * case.truth["pace"]["amplitude"]


def test_cards_and_payloads_are_dealt_alike_with_and_without_something_concealed() -> None:
    """A static card says nothing of presliding, a payload nothing of load-dependent friction."""
    for effects in ((), ("cogging",), ("presliding",), ("delay",), ("rubbing",)):
        setups = [draw_workshop(seed, effects, 1.0).setup for seed in range(30)]
        cards = Counter(setup["card"] for setup in setups)
        assert {name: cards[name] / 30 for name in CARDS} == pytest.approx(CARDS, abs=0.15)
        assert {setup["payload"] for setup in setups} == {True, False}
        assert {setup["loop"] for setup in setups} == {"adrc", "pid", "cascade"}
        assert {setup["machine"] for setup in setups} == set(MACHINES)


def test_a_weight_that_turns_is_concealed_on_rotary_machines_only_and_alone() -> None:
    assert set(suited(())) == set(MACHINES)
    assert {MACHINES[name].motion for name in suited(("cogging", "gravity_unbalance"))} == {"rotary"}
    assert not any(draw_workshop(seed, ("gravity_unbalance",), 1.0).setup["payload"] for seed in range(30))


@pytest.mark.parametrize("name", STROKES)
def test_set_points_start_at_rest_at_home_and_are_their_own_derivatives(name: str) -> None:
    pace = Pace(home=0.4, amplitude=0.5, hertz=0.2, duration=30.0)
    q, v, a = STROKES[name](pace, np.random.default_rng(3))
    assert (q[0], v[0]) == pytest.approx((0.4, 0.0), abs=1e-6)
    assert np.abs(np.gradient(q, TICK) - v)[5:-5].max() < 2e-3 * np.abs(v).max()
    assert np.abs(np.gradient(v, TICK) - a)[5:-5].max() < 2e-2 * np.abs(a).max()
    assert 0.2 * pace.speed < np.abs(v).max() < 1.6 * pace.speed
    assert name == "turning" or np.abs(q - 0.4).max() < 1.05 * 0.5


@pytest.mark.parametrize("controller", [1.0, 2.0])
def test_pid_and_cascade_bring_the_axis_to_its_set_point_against_a_load(controller: float) -> None:
    loop = {"controller": controller, "kp": 100.0, "kd": 20.0, "ki": 3.0}
    loop |= {"speed_filter": 300.0, "loop_inertia": 2.0, "loop_every": 10.0}
    out = truth.simulate(SMOOTH | loop, still(40_000, push=1.0))
    assert out["angle"][2000] < -1e-4  # pushed away at first
    assert abs(out["angle"][-1]) < 1e-4  # and brought back: the integral holds the load
    assert out["command"][-1] == pytest.approx(1.0, rel=1e-2)
    assert np.all(np.diff(out["command"].reshape(-1, 10)[:, 1:], axis=1) == 0)  # new every tenth tick


def test_a_regularised_contact_is_a_smooth_sign_and_never_gives_energy() -> None:
    mount = FRICTION | {"regular": 1e-3, "viscous": 0.0, "breakaway": 2.0}
    path = 0.01 * np.sin(np.linspace(0, 20, 40_000))
    torque = truth.rub(mount, path, 1e-4)
    assert np.all(torque[1:] * np.diff(path) >= 0)
    slow = truth.rub(mount, 1e-3 * np.arange(1000) * 1e-4, 1e-4)
    assert slow[-1] == pytest.approx(2.0 * np.tanh(1.0), rel=1e-9)


def test_a_late_stribeck_curve_follows_behind_its_lag_and_a_lorentzian_falls_by_half_at_its_speed() -> None:
    still_late = FRICTION | {"friction_lag": 0.05, "viscous": 0.0, "damping": 0.0}
    path = np.concatenate([1e-5 * np.arange(5000), 0.05 + 0.2e-4 * np.arange(1, 5001)])  # 0.1, then 0.2 rad/s
    steps = truth.rub(still_late | {"stribeck_speed": 0.1, "stribeck_power": 1.0}, path, 1e-4)
    ratio = 2 - np.exp(-0.05 / 0.05)  # one lag after the speed doubled
    assert steps[5500] == pytest.approx(2 + np.exp(-ratio), rel=2e-3)
    half = truth.rub(FRICTION | {"lorentz": 1.0, "viscous": 0.0}, 0.02e-4 * np.arange(20_000), 1e-4)
    assert half[-1] == pytest.approx(2.5, rel=1e-6)


def test_effects_without_a_shape_do_what_they_say() -> None:
    assert sorted([*SHAPELESS, *SHAPED]) == sorted(OUTSIDE)
    way = 1e-4 * np.arange(20_000)
    polished = truth.rub(FRICTION | {"run_in": 0.5, "run_in_length": 0.5, "breakaway": 2.0, "viscous": 0.0}, way, 1e-3)
    assert polished[[5000, -1]] == pytest.approx([2 * (1 + 0.5 * np.exp(-1)), 2 * (1 + 0.5 * np.exp(-4))], rel=1e-3)
    oil = FRICTION | {"viscous_swing": 0.5, "viscous_cycles": 2.0, "viscous_phase": 0.3, "breakaway": 2.0}
    wave = truth.rub(oil, way, 1e-3)
    assert wave[-1] == pytest.approx(2 + 0.5 * (1 + 0.5 * np.sin(2 * way[-1] + 0.3)), rel=1e-3)


def test_every_family_but_weights_can_be_concealed_in_a_linear_machine() -> None:
    linear = [name for name in FAMILIES if name not in ("gravity_unbalance", "load_dependent_friction")]
    for name in linear:
        bench = draw_workshop(7, (name,), 6.0, "ball screw")
        assert conceal(bench, name, 7, 0.5)["parameters"]
        assert (bench.belief["mount"]["motion"], bench.turn) == ("linear", 2 * np.pi)
    case = make_case(7, ["cogging"], duration=12.0, machine="ball screw")
    found, mount = case.truth["effects"][0]["parameters"], case.truth["mount"]
    assert mount["cogging_cycles"] == pytest.approx(2 * np.pi * found["cycles_per_rev"])  # per metre


def apart(one: pd.Series, other: pd.Series) -> float:
    """How much two differ, of the first."""
    return float(np.sqrt(np.mean((one - other) ** 2) / np.mean(one**2)))


def test_a_rough_machine_is_off_its_equation_by_some_per_cent_and_a_rough_null_has_other_friction() -> None:
    given = {"machine": "robot joint", "duration": 12.0, "decoy_columns": False}
    case, null = (make_case(11, effects, rough=True, **given) for effects in (["gravity_unbalance"], []))
    weight, hidden = case.truth["effects"][0]["parameters"], case.oracle[0]
    equation = weight["mgl"] * np.sin(hidden["angle"] + weight["phase"])
    assert 0.02 < apart(equation, hidden["extra"]) < 0.3
    assert null.oracle[0]["extra"].to_numpy() == pytest.approx(0.0), "a null has no torque of its own"
    assert 0.001 < apart(make_case(11, [], **given).train[0]["tau"], null.train[0]["tau"]) < 0.2


def test_a_loop_that_swings_up_is_no_machine_and_another_is_drawn() -> None:
    """Of this seed a robot joint whose torque comes 3 ms late to a loop that is too fast for that: 1e72 N m."""
    concealed = ["gravity_unbalance", "delay"]
    case = make_case(545360700, concealed, 0.6017380760297837, duration=60.0, machine=ANY, rough=True)
    assert (case.truth["seed"], case.truth["verdict"]) == (545360700, concealed)
    assert max(np.abs(table["q"]).max() for table in (*case.train, case.heldout)) < 5 * case.truth["pace"]["amplitude"]
