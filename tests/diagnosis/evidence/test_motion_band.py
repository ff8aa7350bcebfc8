"""The motion that goes into the models is read in the band in which friction is neither smeared nor made to creep."""

from dataclasses import replace

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.diagnose import _problem
from cosim.diagnosis.evidence.band import in_band
from cosim.estimation.prepare import Band, choose_cutoff, prepare
from pyfmi_models.card import Card, parse_card

RATE, FINE = 1000, 20
INERTIA, STIFFNESS, DAMPING, VISCOUS, LEVEL, REST, SPEED = 30.0, 9e4, 500.0, 25.0, 2.0, 3.5, 0.05


def card(friction: str) -> Card:
    return parse_card(f'[mount]\nname = "m"\ninertia = {INERTIA}\n[friction]\n{friction}', "a.toml")


LUGRE = card(
    f'model = "lugre"\nsigma0 = {STIFFNESS}\nsigma1 = {DAMPING}\nsigma2 = {VISCOUS}\n'
    f"Fc = {LEVEL}\nFs = {REST}\nVs = {SPEED}\n"
)


def recorded(seed: int, noise: float = 3e-7, seconds: float = 20.0) -> Recording:
    """Quick turns of an axis with stiff bristles, whose equations are integrated here anew, read with some noise."""
    draw, h = np.random.default_rng(seed), 1 / (RATE * FINE)
    t = np.arange(int(seconds * RATE * FINE)) * h
    q = sum(a * np.sin(2 * np.pi * f * t + seed) for a, f in ((0.02, 0.3), (0.005, 1.1), (0.0008, 4.0)))
    v, a = np.gradient(q, h), np.gradient(np.gradient(q, h), h)
    held, z = (LEVEL + (REST - LEVEL) * np.exp(-((v / SPEED) ** 2))) / STIFFNESS, np.zeros(len(t))
    for k in range(1, len(t)):  # implicit in the bristle, so no step is too long
        z[k] = (z[k - 1] + h * v[k]) / (1 + h * abs(v[k]) / held[k])
    torque = INERTIA * a + STIFFNESS * z + DAMPING * (v - np.abs(v) * z / held) + VISCOUS * v
    rows = slice(None, None, FINE)
    read = q[rows] + noise * draw.standard_normal(len(t[rows]))
    return Recording(f"run{seed}", {"t": t[rows], "tau": torque[rows], "q": read})


RUNS = [recorded(1), recorded(2)]


def test_a_base_whose_motion_is_not_smeared_has_the_numbers_of_the_machine() -> None:
    problem, cutoff = _problem(RUNS, LUGRE), choose_cutoff(RUNS, INERTIA)
    assert problem.prepared.band.motion >= 1.4 * cutoff == pytest.approx(1.4 * problem.prepared.cutoff)
    base = problem.fit(LUGRE.plant(), 50)
    prepared = prepare(RUNS, cutoff)
    narrow = replace(problem, prepared=prepared, weight=np.ones(len(prepared.recording_of)))
    smeared = narrow.fit(LUGRE.plant(), 50)
    assert problem.error(base) < 0.5 * narrow.error(smeared)
    assert base.parameters()["friction.Fc"] == pytest.approx(LEVEL, rel=0.05)
    assert base.parameters()["friction.sigma1"] == pytest.approx(DAMPING, rel=0.1)


def test_what_is_linear_in_the_motion_needs_no_wider_band() -> None:
    noisy = [recorded(seed, noise=3e-6) for seed in (1, 2)]
    for run in noisy:
        smooth = np.gradient(run["q"], run.t)
        run.table["tau"] = INERTIA * np.gradient(smooth, run.t) + VISCOUS * smooth  # type: ignore[index]
    assert in_band(noisy, card('model = "none"').plant()).band.motion == 0.0


@pytest.mark.parametrize("hertz", [3.0, 8.0, 12.0])
def test_a_tone_passes_all_filters_as_its_gain_says(hertz: float) -> None:
    t = np.arange(20 * RATE) / RATE
    tone = Recording("tone", {"t": t, "q": 0.1 * np.sin(t), "tau": np.sin(2 * np.pi * hertz * t)})
    (piece,) = prepare([tone], Band(10.0, 20.0)).pieces
    assert piece.motion == 20.0
    assert np.sqrt(2) * piece.tau[piece.inside].std() == pytest.approx(piece.gain(hertz), rel=0.01)


def test_the_band_of_the_torque_is_that_of_two_passes_wherever_the_motion_is_read() -> None:
    narrow, wide = (prepare(RUNS, Band(10.0, motion)).pieces[0] for motion in (0.0, 28.0))
    assert narrow.gain(10.0) == pytest.approx(0.25, rel=0.01)
    assert wide.gain(10.0) == pytest.approx(0.25, rel=0.01)
    assert 0.88 * len(narrow.kept) < len(wide.kept) < len(narrow.kept), (
        "a tenth more lies beside the ends of a filter more"
    )
