"""From shares of the evidence to probabilities, and the command that fits the curve between them."""

import itertools
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bench import calibration as benchmark
from cosim.diagnosis.decide.calibration import OFFSET, SLOPE, calibrated

BENCHMARK = Path(benchmark.__file__)
RESULTS = Path(__file__).parents[2] / "results"


def test_the_curve_rises_keeps_its_order_and_can_be_turned_back() -> None:
    shares = np.linspace(0.001, 0.999, 50)
    told = [calibrated(share) for share in shares]
    assert all(low < high for low, high in itertools.pairwise(told))
    assert [benchmark.share_of(one) for one in told] == pytest.approx(list(shares), rel=1e-9)
    assert all(0 < calibrated(edge) < 1 for edge in (0.0, 1.0))


def test_what_explains_little_is_doubtful_and_what_explains_nearly_all_is_not() -> None:
    assert calibrated(0.1) < 0.5 < 0.9 < calibrated(0.9)
    assert calibrated(0.5) == pytest.approx(1 / (1 + np.exp(-OFFSET)))
    assert SLOPE > 0


def refuted(pairs: list[tuple[float, bool]], offset: float, slope: float) -> float:
    """Twice the log-likelihood that a curve lacks to the best one for these cases; chi-squared of 2 if it is true."""

    def likelihood(*curve: float) -> float:
        return sum(np.log(p if true else 1 - p) for p, true in ((calibrated(s, *curve), t) for s, t in pairs))

    return 2 * (likelihood(*benchmark.fitted(pairs)) - likelihood(offset, slope))


def test_fresh_cases_do_not_refute_the_curve_and_would_refute_another() -> None:
    """On 57 effects that the curve was not fitted to: 9.2 is exceeded by chance once in a hundred."""
    told = json.loads((RESULTS / "abroad" / "pairs.json").read_text("utf-8"))["pairs"]
    pairs = [(share, bool(true)) for share, true in told]
    assert refuted(pairs, OFFSET, SLOPE) < 9.2
    assert refuted(pairs, OFFSET, 2 * SLOPE) > 9.2
    assert refuted(pairs, OFFSET - 1.2, SLOPE) > 9.2


def test_what_explains_half_of_the_error_is_right_in_eight_to_nine_tenths() -> None:
    """So it came true in the decks of both generators; a curve that is one too high says .94."""
    assert 0.8 < calibrated(0.5) < 0.9


def test_the_command_finds_the_curve_that_made_the_truth(tmp_path: Path) -> None:
    rng, rows = np.random.default_rng(3), []
    for share in rng.uniform(0.02, 0.98, 1500):
        true = bool(rng.random() < calibrated(share, 0.5, 0.4))
        effect = {"effect": "cogging", "answer": "found", "probability": share}
        truth = {"effects": [{"effect": "cogging" if true else "delay", "listed": True}]}
        rows.append({"status": "ok", "truth": truth, "answer": {"effects": [effect]}})
    deck = {"rows": rows, "seed": 1, "code": "0" * 64}
    (tmp_path / "proof.json").write_text(json.dumps(deck), "utf-8")
    command = [sys.executable, str(BENCHMARK), str(tmp_path / "proof.json"), "--played", "0", "1"]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    offset, slope = (float(one) for one in said.split("OFFSET, SLOPE = ")[1].splitlines()[0].split(", "))
    assert offset == pytest.approx(0.5, abs=0.15)
    assert slope == pytest.approx(0.4, abs=0.1)


def test_a_world_is_judged_by_the_curve_of_the_other(tmp_path: Path) -> None:
    """In one world probabilities come true as they are, in the other half as far from even odds."""
    rng, files = np.random.default_rng(4), []
    for world, slope in (("honest", 1.0), ("boasting", 0.5)):
        rows = []
        for printed in rng.uniform(0.5, 0.98, 500):
            truth = ["cogging"] if rng.random() < calibrated(printed, 0.0, slope) else ["delay"]
            effect = {"effect": "cogging", "answer": "found", "probability": printed}
            rows.append({"effects": truth, "answer": {"effects": [effect]}})
        rows.append({"effects": ["delay"], "status": "crashed", "answer": None})
        files.append(tmp_path / world / "deck.json")
        files[-1].parent.mkdir()
        files[-1].write_text(json.dumps({"rows": rows, "seed": 1, "code": "0" * 64}), "utf-8")
    command = [sys.executable, str(BENCHMARK.parent / "calibration_crossed.py"), *map(str, files)]
    subprocess.run([*command, "--out", str(tmp_path)], capture_output=True, check=True)
    lines = (tmp_path / "crossed.md").read_text("utf-8").splitlines()
    told = {cells[1].strip(): cells[2:5] for line in lines if len(cells := line.split("|")) == 6}
    assert float(told["honest"][0].split()[0]) < 0.05 < float(told["honest"][2].split()[0])
    assert float(told["boasting"][0].split()[0]) > 0.08
    assert float(told["boasting"][1].split(": ")[1].split(",")[1]) == pytest.approx(1.0, abs=0.2)
