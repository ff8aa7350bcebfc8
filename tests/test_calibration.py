"""From shares of the evidence to probabilities, and the command that fits the curve between them."""

import itertools
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cosim.diagnosis.calibration import OFFSET, SLOPE, calibrated, share_of

BENCHMARK = Path(__file__).parent / "benchmarks" / "calibration.py"


def test_the_curve_rises_keeps_its_order_and_can_be_turned_back() -> None:
    shares = np.linspace(0.001, 0.999, 50)
    told = [calibrated(share) for share in shares]
    assert all(low < high for low, high in itertools.pairwise(told))
    assert [share_of(one) for one in told] == pytest.approx(list(shares), rel=1e-9)
    assert all(0 < calibrated(edge) < 1 for edge in (0.0, 1.0))


def test_what_is_nearly_certain_is_told_less_certainly() -> None:
    assert calibrated(0.999) < 0.999
    assert calibrated(0.5) == pytest.approx(1 / (1 + np.exp(-OFFSET)))
    assert SLOPE < 1


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
