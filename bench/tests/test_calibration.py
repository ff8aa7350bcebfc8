"""The commands that fit the curve between shares of the evidence and probabilities, and judge it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bench import calibration as benchmark
from cosim.diagnosis.decide.calibration import calibrated

BENCHMARK = Path(benchmark.__file__)


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
