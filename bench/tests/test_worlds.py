"""The generator of concealed physics on other machines, and the score of any world."""

import ast
import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from mutants_choice import PRODUCT

from bench.worlds.machines import assess, cases, plant
from bench.worlds.machines.compose import compose
from bench.worlds.machines.effects import EFFECTS
from bench.worlds.machines.files import write
from bench.worlds.machines.machines import CLASSES, LAWS
from bench.worlds.machines.outside import OUTSIDE
from bench.worlds.machines.users_card import card_text
from bench.worlds.marking import bounds, calibration, score, score_case, summary, wilson
from bench.worlds.score import markdown
from cosim.data.recording import Recording
from pyfmi_models.card import parse_card
from pyfmi_models.effects import CATALOGUE

WORLDS = Path(__file__).parents[2] / "bench" / "worlds"


def drawn(seed, *effects, kind="", **changes):
    """Draw a case with short recordings and little noise."""
    case = compose(np.random.default_rng(seed), "family", effects, kind) | {"seconds": (11, 12), **changes}
    cases.settle(case)
    return case


def test_generator_imports_nothing_of_the_project():
    modules = set()
    for path in (WORLDS / "machines").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                modules |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                modules.add(node.module.split(".")[0])
    assert not modules & set(PRODUCT)


def test_every_effect_of_the_catalogue_can_be_concealed():
    of_cards = {
        "altitude_inertia",
        "azimuth_centrifugal",
        "bouc_wen",
        "concave_viscous",
        "dead_band",
        "friction_wander",
    }
    of_drives = {"gear_friction", "rough_spot", "torque_droop"}
    without_a_diagnosis = of_cards | of_drives | {"known_load", "learned"}
    of_other_signals = {
        "axis_coupling",
        "constant_force",
    }  # a neighbour's motion, a weight on a linear axis: not drawn here
    assert set(EFFECTS) == set(CATALOGUE) - without_a_diagnosis - of_other_signals
    assert len(OUTSIDE) >= 6


def test_case_is_the_same_for_the_same_seed(tmp_path):
    made = []
    for name in ("a", "b"):
        case = drawn(11, "gravity_unbalance", target=0.5)
        recordings = cases.simulate(case, (0, 1, 2))
        numbers, _ = assess.assess(case, assess.Judgement(case, recordings))
        write(tmp_path / name, tmp_path, name, (case, recordings, numbers), 11)
        made.append([(tmp_path / name / name / file).read_bytes() for file in ("model.toml", "heldout.csv.gz")])
    assert made[0] == made[1]
    assert card_text(drawn(12, "gravity_unbalance")) != card_text(case)


def test_files_read_as_card_and_recording(tmp_path):
    case = drawn(11, target=0.0) | {"recorded_temperature": True, "user_columns": ["humidity"], "renamed": True}
    recordings = cases.simulate(case, (0, 1, 2))
    numbers, _ = assess.assess(case, assess.Judgement(case, recordings))
    truth = write(tmp_path, tmp_path, "case_0000", (case, recordings, numbers), 11)
    card = parse_card((tmp_path / "case_0000" / "model.toml").read_text("utf-8"), "model.toml")
    read = Recording.read(tmp_path / "case_0000" / "train_1.csv.gz", columns=card.columns)
    assert {"tau", "q", "temperature", "humidity"} <= set(read.columns)
    assert read["tau"] == pytest.approx(recordings[0]["tau"], rel=1e-5)
    assert truth == json.loads((tmp_path / "case_0000.json").read_text("utf-8"))


@pytest.mark.parametrize("seed", range(24))
def test_cards_read(seed):
    effects = [(), ("presliding",), ("stribeck",), ("load_dependent_friction",)][seed % 4]
    case = drawn(seed, *effects)
    card = parse_card(card_text(case), "model.toml")
    assert card.friction.key == case["card"]["law"]
    assert card.mount.motion == ("linear" if case["machine"]["linear"] else "rotary")


def test_all_machines_laws_and_cards_are_drawn():
    found = [drawn(seed) for seed in range(200)]
    assert {case["machine"]["kind"] for case in found} == set(CLASSES)
    pairs = {(case["truth"], case["card"]["law"]) for case in found}
    assert pairs >= set(product(LAWS, ["lugre"])) | set(product(("lugre", "tanh", "dahl"), ["static", "coulomb"]))
    assert {case["machine"]["rate"] for case in found} >= {100, 200, 500, 1000, 2000, 5000}


CLEAN = {"wander": 1e-4, "torque_noise": 1e-4, "ground": 0.0}


SEEDS = {
    **dict.fromkeys(("friction_asymmetry", "cogging", "position_friction", "gravity_unbalance", "torque_offset"), 7),
    **dict.fromkeys(("dwell_breakaway", "actuator_lag", "delay", "quadratic_drag", "cable_wrap"), 7),
    **dict.fromkeys(("inertia_variation", "load_dependent_friction", "periodic_disturbance"), 7),
    **dict.fromkeys(("encoder_eccentricity", "clock_skew", "presliding"), 7),
    **{"thermal_viscosity": 18, "compliance": 2, "backlash": 1, "torque_saturation": 9},
    **{kind: 9 if kind == "filter_switches" else 7 for kind in OUTSIDE if kind != "running_in"},  # that one is slow
}
"""Seeds whose machine moves freely, with a friction law that the card can say and an effect that is not tiny."""


@pytest.mark.parametrize("name", SEEDS)
def test_true_torque_is_what_a_plain_model_lacks(name):
    effect, kind = ("unknown", name) if name in OUTSIDE else (name, "")
    case = drawn(SEEDS[name], effect, kind=kind, **CLEAN)
    judgement = assess.Judgement(case, cases.simulate(case, (0, 1)))
    assert judgement.share > 0.3
    assert next(iter(judgement.factors.values()), 1) == pytest.approx(1, abs=0.08)  # friction law and backlash: 7 %


@pytest.mark.parametrize("varies", [0.0, 0.3])
def test_pendulum_without_friction_keeps_its_energy(varies):
    J, mgl, start, n = 2.0, 5.0, 1.0, 4000
    still = {name: np.zeros(n) for name in ("qd", "vd", "ad", "noise", "shake", "tone", "temp")} | {"level": np.ones(n)}
    off = {"J": J, "kn": mgl, "law": LAWS.index("tanh"), "Fc": 1e-12, "Fs": 1e-12, "s2": 0.0, "start": start}
    off |= {"in_A": varies, "in_N": 2.0, "in_p": 0.5, "in_kind": 1.0}
    _, q, _, _ = plant.simulate(off, 1e-3, 20, still, (np.zeros(0), np.zeros(0)), ())
    v = np.gradient(q, 1e-3)[1:-1]
    inertia = J * (1 + varies * np.cos(2 * q[1:-1] + 0.5))
    assert inertia * v**2 / 2 - mgl * np.cos(q[1:-1]) == pytest.approx(-mgl * np.cos(start), abs=0.01 * mgl)
    assert np.min(q) == pytest.approx(-start, abs=1e-2)


def test_command_of_a_row_is_the_mean_around_it():
    from bench.worlds.machines.recorder import _means

    ramp = np.repeat(np.arange(40.0), 1)
    rows = np.array([3, 4])
    assert _means(ramp, 4, rows) == pytest.approx([11.5, 15.5])  # ticks 10..13, 14..17
    assert _means(ramp, 1, rows) == pytest.approx([2.5, 3.5])  # half of the tick before, half of the one after


def test_search_finds_the_size_of_a_share():
    search, size = cases.Search(0.4), 3.0
    for _ in range(6):
        share = size**2 / (1 + size**2)
        size *= np.exp(search.next(share))
    assert size**2 / (1 + size**2) == pytest.approx(0.4, abs=0.02)


TRUTH = {"case": "case_0000", "family": "delay", "effects": ["delay"], "level": "strong",
         "parameters": {"delay": {"delay_ms": 3.0}},
         "oracle": {"heldout_base_rms": 2.0, "heldout_oracle_libfriction_rms": 1.0}}  # fmt: skip
FOUND = {"verdict": ["delay"], "rivals": [["delay", "actuator_lag"]], "before": 4.0, "after": 3.0,
         "effects": {"delay": {"effect": "delay", "answer": "found", "probability": 0.9}}}  # fmt: skip


def test_marks_of_a_case():
    row = score_case(TRUTH, FOUND)
    assert row["right"]
    assert row["set"] == ["actuator_lag", "delay"]
    assert row["closed"] == pytest.approx(0.5)  # a quarter removed of the half that can be
    other = score_case(TRUTH, FOUND | {"verdict": ["actuator_lag"]})
    assert (other["right"], other["in_set"]) == (False, True)
    assert not score_case(TRUTH, None)["right"]


def test_bound_holds_where_the_true_size_is_below():
    unseen = {"effect": "delay", "answer": "not_seen", "probability": 0.0}
    for entry, holds in (
        ({"visible_from": 4.0}, True),
        ({"visible_from": 2.0}, False),
        ({"bound": {"value": 3.5}}, True),
    ):
        (one,) = bounds(TRUTH, FOUND | {"effects": {"delay": unseen | entry}})
        assert one["holds"] == holds
    assert bounds(TRUTH, FOUND) == []


def test_wilson_and_calibration_are_the_textbook_ones():
    found = wilson(8, 10)
    assert (found["low"], found["high"]) == pytest.approx((0.4902, 0.9433), abs=1e-4)
    rows = [{"p": 0.95, "right": right, "verdict": ["delay"]} for right in (True, True, True, False)]
    assert calibration(rows)["ece"] == pytest.approx(0.2)


def test_summary_tells_nulls_unknowns_and_pairs_apart(tmp_path):
    truths, results = tmp_path / "truth", tmp_path / "results"
    answers = {"delay": (["delay"], ["delay"]), "none": ([], ["cogging"]), "unknown": (["unknown"], ["unknown"]),
               "pairs": (["delay", "cogging"], ["delay", "stribeck"])}  # fmt: skip
    for folder in (truths, results):
        folder.mkdir()
    for k, (family, (effects, verdict)) in enumerate(answers.items()):
        case = TRUTH | {"case": f"case_{k}", "family": family, "effects": effects, "parameters": {}}
        (truths / f"case_{k}.json").write_text(json.dumps(case))
        told = {"verdict": verdict, "effects": [{"effect": verdict[0], "probability": 0.8, "answer": "found"}]}
        (results / f"case_{k}.json").write_text(json.dumps(told))
    s = summary(score(truths, results))
    assert (s["single"]["hits"], s["single"]["n"]) == (1, 1)
    assert (s["false_alarms"]["share"], s["unknown"]["share"]) == (1, 1)
    assert (s["several_precision"]["share"], s["several_recall"]["share"]) == (0.5, 0.5)
    assert "| nulls: false alarms | 1.00" in markdown(s)
