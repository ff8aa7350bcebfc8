"""What a diagnosis is compared with: black boxes, sparse regression over a library, the true structure refitted."""

import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from prove_rows import row

from cosim.diagnosis.measure.protocol import heldout_rms
from cosim.estimation.prepare import prepare
from cosim_studies.proof import baselines, marks
from cosim_studies.proof.ceiling import _refitted, ceiling, in_card_words, judged, true_effect
from cosim_studies.proof.generator import make_case, write_given
from cosim_studies.proof.tool import given


def test_true_numbers_become_an_effect_of_the_library() -> None:
    wave = {"cycles_per_rev": 3, "relative_amplitude": 0.3, "phase": 1.0}
    periodic = true_effect({"effect": "position_friction", "parameters": wave})
    assert type(periodic).__name__ == "PeriodicFriction"
    assert in_card_words({"effect": "position_friction", "parameters": wave})["phase"] == pytest.approx(1 - np.pi / 2)
    spot = {"q_center": 0.1, "relative_amplitude": 0.3, "width": 0.2}
    assert type(true_effect({"effect": "position_friction", "parameters": spot})).__name__ == "LocalFriction"
    for name in ("delay", "stribeck", "clock_skew"):
        assert true_effect(make_case(4, [name], duration=10.0).truth["effects"][0]).id == name


def concealing(folder: Path, *effects: str) -> list[dict[str, Any]]:
    """Write a case of 12 s into a folder, as the tool is given it, and return what is true of its effects."""
    case = make_case(8, effects, duration=12.0)
    write_given(case, folder)
    found: list[dict[str, Any]] = case.truth["effects"]
    return found


def test_the_true_structure_refitted_leaves_less_than_the_base(tmp_path: Path) -> None:
    true, folder = concealing(tmp_path, "torque_offset"), str(tmp_path)
    best, base = (ceiling(folder, entries)["heldout_rms"] for entries in (true, []))
    assert ceiling(folder, true, band=(8.0, 11.0))["heldout_rms"] < 0.99 * best, "less of the reading's noise"
    assert best < 0.8 * base
    assert "no structure" in ceiling(folder, [{"effect": "rubbing", "listed": False, "parameters": {}}])["reason"]
    assert len(given(folder)[1]) == 2


def test_of_two_effects_the_one_that_matters_is_missed_where_it_is_left_out(tmp_path: Path) -> None:
    best = ceiling(str(tmp_path), concealing(tmp_path, "torque_offset", "stribeck"))
    assert set(best["without"]) == {"torque_offset", "stribeck"}
    assert best["heldout_rms"] < 0.8 * best["without"]["torque_offset"]


def test_a_ceiling_that_is_worse_than_the_base_it_contains_is_rejected(tmp_path: Path) -> None:
    """In training or held out: it is then no excuse for a miss, and the case is counted as one without a gap."""
    (true,) = concealing(tmp_path, "torque_offset")
    card, train, held = given(str(tmp_path))
    base, best = _refitted([card.plant()], [true_effect(true)], prepare(train, 20.0))
    assert best.cost < base.cost
    judge = partial(heldout_rms, [held])
    good = judged(judge, base, best)
    assert good["heldout_rms"] < good["base_rms"]
    assert "worse than that of the base" in judged(judge, base, best._replace(cost=2 * base.cost))["reason"]
    assert "predicts less than the base" in judged(judge, best, base._replace(cost=0.5 * best.cost))["reason"]
    rejected = row("one", ["torque_offset"], []) | {"ceiling": {"reason": "refitted it predicts less"}}
    assert (marks.gap_closed(rejected), marks.has_gap(rejected), marks.removable(rejected)) == (None, False, None)


class Shown:
    """A recording with a wave of position in what the base leaves, or noise alone."""

    def __init__(self, name: str, seed: int, size: float) -> None:
        rng = np.random.default_rng(seed)
        self.name, self.heldout = name, name == "heldout"
        self.t = np.arange(3000) * 8e-3
        self.q = 0.8 * np.sin(0.7 * self.t + seed)
        self.v = 0.56 * np.cos(0.7 * self.t + seed)
        self.missing = size * np.sin(3 * self.q) + 0.1 * rng.standard_normal(self.t.size)
        self.tau = np.gradient(self.v, self.t) + self.missing
        self.extras: dict[str, np.ndarray] = {}


@pytest.mark.parametrize("name", ["kernel", "boosting", "gp", "sindy"])
def test_what_depends_on_position_is_learned_and_noise_raises_no_alarm_or_it_says_what_to_install(name: str) -> None:
    names = ("train_1", "train_2", "heldout")
    wave, noise = ([Shown(name, k, size) for k, name in enumerate(names)] for size in (1.0, 0.0))
    learned, quiet = (baselines.compared(traces, names=("refit", name)) for traces in (wave, noise))
    assert quiet["refit"] == {"heldout_rms": baselines.rms(noise[2].missing), "alarm": False}
    if "skipped" in learned[name]:
        assert re.search(r"(scikit-learn|pysindy) is not installed: pip install", learned[name]["skipped"])
        return
    assert learned[name]["alarm"]
    assert learned[name]["heldout_rms"] < 0.3 * learned["refit"]["heldout_rms"]
    assert name == "sindy" or not quiet[name]["alarm"]


def test_the_library_holds_waves_up_to_80_cycles_a_turn_and_what_a_delay_looks_like() -> None:
    trace = Shown("train_1", 0, 0.0)
    top = float(np.abs(trace.v).max())
    for torque in (np.cos(80 * trace.q), np.sign(trace.v) * np.sin(12 * trace.q), np.gradient(trace.tau, trace.t)):
        columns = baselines.terms(trace, top)
        left = torque - columns @ np.linalg.lstsq(columns, torque, rcond=None)[0]
        assert np.std(left) < 1e-6 * np.std(torque)
    metre = Shown("train_1", 0, 0.0)
    metre.q = trace.q / (2 * np.pi)
    np.testing.assert_allclose(
        baselines.terms(metre, top, 2 * np.pi)[:, 20:], baselines.terms(trace, top)[:, 20:], atol=1e-9
    )
