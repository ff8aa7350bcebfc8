"""A floor that trembles all the time is told with its level and band; what goes with the motion is not."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.delivery.deliver import as_json
from cosim.diagnosis.answer.ledger import Trial
from cosim.diagnosis.answer.why import reasons as why
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.evidence.broadband import shaken
from cosim.estimation.prepare import Array, Prepared, prepare
from cosim_studies.proof.generator import make_case, write_given
from pyfmi_models.card import read_card

BANDS = (2.0, 8.0, 32.0)
T = np.arange(0, 40, 0.002)
TAU = 1 + 0.01 * np.sin(T)


def prepared(noise: float = 0.0, torque: float = 0.0) -> Prepared:
    """Strokes of constant speed, read with white noise."""
    random = np.random.default_rng(1)
    q = 0.5 * np.abs((T / 4) % 2 - 1) + noise * random.standard_normal(len(T))
    tau = TAU + torque * random.standard_normal(len(T))
    return prepare([Recording.of({"t": T, "q": q, "tau": tau}, "strokes")], 30.0)


def band_limited(given: Prepared, low: float, high: float, seed: int = 2) -> Array:
    """Noise of unit RMS between two frequencies, at the kept rows."""
    t = given.stacked("t")
    wave = np.fft.rfft(np.random.default_rng(seed).standard_normal(len(t)))
    hertz = np.fft.rfftfreq(len(t), t[1] - t[0])
    found = np.fft.irfft(np.where((hertz > low) & (hertz < high), wave, 0), len(t))
    return np.asarray(found / found.std())


def test_a_trembling_floor_is_told_with_level_and_band() -> None:
    given = prepared()
    found = shaken(given, 0.3 * band_limited(given, 3, 6), 1.0, BANDS)
    assert found.level == pytest.approx(0.3, rel=0.1)
    assert 0.5 * found.level < found.least < found.level
    assert (found.low, found.high) == (pytest.approx(3, abs=0.5), pytest.approx(6, abs=0.7))


def test_what_comes_again_at_the_same_place_is_the_machine() -> None:
    given = prepared()
    teeth = np.sin(2 * np.pi * 40 * given.stacked("q")) * np.sin(2 * np.pi * 3 * given.stacked("q"))
    assert shaken(given, teeth, 1.0, BANDS).least < 0.3 * shaken(given, band_limited(given, 3, 6), 1.0, BANDS).least


def test_what_comes_with_some_motion_only_is_not_there_all_the_time() -> None:
    given = prepared()
    now_and_then = band_limited(given, 3, 6) * (np.floor(given.stacked("t") / 4) % 3 > 0)
    assert shaken(given, now_and_then, 1.0, BANDS).least < 0.1


def test_noise_of_both_readings_is_none() -> None:
    given = prepared(noise=1e-5, torque=0.2)
    noise = given.stacked("tau") - 1 - 2.0 * given.stacked("a")
    as_if_read_without = shaken(prepared(), noise, 2.0, BANDS).least
    assert shaken(given, noise, 2.0, BANDS).least < 0.5 * as_if_read_without


def test_too_little_motion_tells_nothing() -> None:
    short = prepare([Recording.of({"t": T[:4000], "q": 0.1 * T[:4000], "tau": TAU[:4000]}, "short")], 30.0)
    assert shaken(short, band_limited(short, 3, 6), 1.0, BANDS).level == 0


def test_a_diagnosis_calls_it_unknown(tmp_path: Path) -> None:
    """Nothing of the kind is told of nulls: the stored answers, test_net.py."""
    write_given(make_case(4, ["vibration"], duration=30.0, rate_hz=500), tmp_path)
    card = read_card(str(tmp_path / "card.toml"))
    read = [Recording.read(tmp_path / f"{name}.parquet") for name in ("train_1", "train_2", "heldout")]
    answer: Any = as_json(diagnose(read[:2], read[2:], card).diagnosis)
    assert "broadband_disturbance" in [one["effect"] for one in answer["effects"]]
    assert "unknown" in answer["verdict"]
    assert answer["broadband_disturbance"]
    reasons = dict(why(answer, [Trial.of_json(one) for one in answer["ledger"]]))
    assert "random disturbance at any motion relative to friction" in reasons["unknown"]
    assert reasons["broadband_disturbance"].startswith("possible, p ")
