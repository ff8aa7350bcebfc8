"""How much a row counts: rows that repeat one operating point count together, and what moves slowly is not at rest."""

from dataclasses import replace

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.effects import hypothesis_of
from cosim.estimation.prepare import Prepared, prepare
from cosim.estimation.row_weights import least_way, remembers, weights
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.friction import LAWS, Coulomb, LuGre
from pyfmi_models.mount import Axis, Mount

COULOMB, LUGRE = Coulomb(Fc=1.0), LuGre(Fc=1.0, Fs=1.2, Vs=0.01, sigma0=1e3)
SOFT, SECONDS = replace(LUGRE, sigma0=1e2), (3, 6, 12)


def recorded(speeds: list[np.ndarray]) -> Prepared:
    runs = [{"t": np.arange(len(v)) / 100, "v": v, "tau": np.sign(v)} for v in speeds]
    return prepare([Recording(f"run_{number}", one) for number, one in enumerate(runs)], 5.0)


def of_each(prepared: Prepared, law: Coulomb | LuGre) -> np.ndarray:
    """Sum of squared weights of each recording."""
    return np.bincount(prepared.recording_of, weights=weights(law, prepared) ** 2)


@pytest.mark.parametrize("law", [COULOMB, LUGRE])
def test_recordings_of_one_speed_count_alike_however_long_they_last(law: Coulomb | LuGre) -> None:
    prepared = recorded([np.full(100 * s, float(s)) for s in SECONDS])
    assert of_each(prepared, law) == pytest.approx(len(prepared.recording_of) / 3)


def test_rows_of_recordings_that_visit_all_speeds_count_alike() -> None:
    prepared = recorded([np.sin(np.arange(100 * s) * 2 * np.pi / 150) for s in SECONDS])
    weight = weights(SOFT, prepared)
    assert weight == pytest.approx(np.ones(len(weight)), abs=0.05)


def test_one_recording_is_weighed_by_nothing_but_rest() -> None:
    prepared = recorded([np.concatenate([np.full(600, 1.0), np.full(600, 0.001)])])
    assert set(np.unique(weights(COULOMB, prepared))) == {0.0, 1.0}
    assert set(np.unique(weights(SOFT, prepared))) == {1.0}


def test_a_recording_that_moves_slowly_counts_and_one_at_rest_does_not() -> None:
    noise = np.random.default_rng(1).standard_normal(600)
    prepared = recorded([np.full(600, 10.0), np.full(600, -10.0), np.full(600, 0.1), 1e-4 * noise])
    slow, still = of_each(prepared, COULOMB)[2:]
    assert slow > 0
    assert still == 0


def test_one_speed_in_all_recordings_is_no_group() -> None:
    assert weights(COULOMB, recorded([np.full(600, 1.0)] * 2)) == pytest.approx(1.0)


@pytest.mark.parametrize(("step", "rests"), [(1e-6, 1.0), (6e-4, 0.0)])
def test_a_bristle_that_slides_within_the_encoders_step_says_nothing_at_rest(step: float, rests: float) -> None:
    t = np.arange(1200) / 100
    way = np.where(t < 6, t, 6.0 + 2 * step * np.sin(8 * t))
    read = step * np.rint(way / step)
    prepared = prepare([Recording("run", {"t": t, "q": read, "tau": np.ones_like(t)})], 5.0)
    assert rests == 1.0 or least_way(prepared) == pytest.approx(2 * step)
    assert remembers(LUGRE, prepared) is (rests == 1.0)
    still = prepared.stacked("t") > 7
    assert np.median(weights(LUGRE, prepared)[still]) == rests


@pytest.mark.parametrize(("reach", "remembered"), [(1e-2, True), (1e-4, False)])
def test_a_bristle_that_slides_within_what_the_filter_smears_is_not_remembered(reach: float, remembered: bool) -> None:
    """Turns at 1 rad/s2 behind a filter of 5 Hz are smeared by 1 mrad; a quarter of it is the least way."""
    t = np.arange(1200) / 100
    turning = {"t": t, "q": np.sin(t), "tau": np.ones_like(t)}
    prepared = prepare([Recording("run", turning)], 5.0)
    assert least_way(prepared) == pytest.approx(0.25 * np.sqrt(0.5) / (2 * np.pi * 5) ** 2, rel=0.05)
    assert remembers(replace(LUGRE, sigma0=LUGRE.Fc / reach), prepared) is remembered


def test_what_a_bristle_bends_goes_by_what_it_holds_at_rest() -> None:
    """A Coulomb level that a fit has lost is none: before it slides the bristle holds Fs."""
    t = np.arange(1200) / 100
    prepared = prepare([Recording("run", {"t": t, "q": np.sin(t), "tau": np.ones_like(t)})], 5.0)
    lost = replace(LUGRE, sigma0=LUGRE.Fs / (2 * least_way(prepared)), Fc=1e-3 * LUGRE.Fs)
    assert remembers(lost, prepared)
    assert not remembers(replace(lost, Fc=0.4 * LUGRE.Fs), prepared), "a level that is there counts"
    assert not remembers(replace(lost, Fs=0.4 * LUGRE.Fs), prepared)
    contact, still = Presliding(sigma0=lost.sigma0), replace(COULOMB, Fc=lost.Fc)
    for law, shown in ((LAWS["static"](Fc=lost.Fc, Fs=LUGRE.Fs, Vs=0.1, sigma2=0.0), True), (still, False)):
        mount = Mount(name="axis", axis=Axis(inertia=1.0), friction=law, effects=(contact,))
        assert hypothesis_of(contact).shows(contact, mount, prepared) is shown


def test_a_law_without_memory_remembers_nothing() -> None:
    assert not remembers(COULOMB, recorded([np.full(600, 1.0)]))
    assert remembers(LUGRE, recorded([np.full(600, 1.0)]))
