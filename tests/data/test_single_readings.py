"""Single false readings are found, bridged and said; what a machine can do is left as it is."""

from dataclasses import replace

import numpy as np
import pytest
from wandering import swing

from cosim.data.recording import Recording
from cosim.data.single_readings import cleaned
from cosim.diagnosis.measure.protocol import heldout_rms
from cosim.diagnosis.trust.doubts import single_readings
from cosim.estimation.prepare import prepare
from cosim_studies.proof.generator import make_case
from pyfmi_models.card import parse_card
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

RATE = 500.0
MOUNT = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=1.0))


def motion(step: float = 0.0, noise: float = 1e-6, rate: float = RATE) -> Recording:
    """A multisine of 20 s that friction and inertia answer; `step` [rad] of the encoder, `noise` [rad] rms."""
    t = np.arange(int(20 * rate)) / rate
    q, v, a = swing(t, [(0.2, 0.11, 0.0), (0.1, 0.37, 1.0), (0.03, 0.9, 2.0)])
    q = q + noise * np.random.default_rng(1).standard_normal(len(t))
    return Recording(
        "run", {"t": t, "tau": 5 * a + 2 * np.tanh(v / 1e-3) + v, "q": np.round(q / step) * step if step else q}
    )


def spoiled(recording: Recording, column: str, rows: slice, values: object) -> Recording:
    table = dict(recording.table)
    table[column] = table[column].copy()
    table[column][rows] = values
    return replace(recording, table=table)


@pytest.mark.parametrize("rate", [50.0, 1000.0])
@pytest.mark.parametrize("step", [0.0, 1e-5, 3e-3])
@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_clean_recording_is_returned_as_it_is(rate: float, step: float, noise: float) -> None:
    recording = motion(step, noise, rate)
    assert cleaned(recording) is recording


@pytest.mark.parametrize("effect", [[], ["backlash"], ["torque_saturation"]])
def test_a_generated_recording_with_stops_and_impacts_is_returned_as_it_is(effect: list[str]) -> None:
    case = make_case(11, effect, duration=20.0)
    for frame in (*case.train, case.heldout):
        recording = Recording("run", {name: frame[name].to_numpy(float) for name in frame.columns})
        assert cleaned(recording) is recording


@pytest.mark.parametrize("row", [0, 424, 9999])
@pytest.mark.parametrize("rows", [1, 3])
@pytest.mark.parametrize("step", [0.0, 3e-3])
def test_a_false_position_is_bridged_to_within_the_encoder(row: int, rows: int, step: float) -> None:
    good = motion(step)
    if row + rows > len(good):
        rows = len(good) - row
    bad = spoiled(good, "q", slice(row, row + rows), -3.14)
    found = cleaned(bad)
    assert np.abs(found["q"] - good["q"]).max() < max(5e-5, 3 * step)
    assert found.masked == ((good.t[row], good.t[row + rows - 1]),)
    (said,) = single_readings([bad], [found])
    assert said.finding == "single_readings"
    assert f"q = -3.14 in row {row + 1:,}" in said.statement
    assert cleaned(found) is found


def test_a_false_reading_no_longer_makes_the_error() -> None:
    good = motion()
    bad = spoiled(good, "q", slice(5000, 5001), -3.14)
    truth = heldout_rms([good], MOUNT)
    assert heldout_rms([bad], MOUNT) > 20 * truth
    assert heldout_rms([cleaned(bad)], MOUNT) == pytest.approx(truth, rel=0.02)


def test_nothing_is_judged_beside_a_false_reading() -> None:
    found = cleaned(spoiled(motion(), "q", slice(5000, 5001), -3.14))
    (piece,) = prepare([found], 20.0).pieces
    out = piece.t[~piece.inside & (piece.t > 4) & (piece.t < 19)]
    assert out.min() == pytest.approx(10.0, abs=0.03)
    assert out.max() == pytest.approx(10.0, abs=0.03)


def test_a_torque_that_no_drive_gives_is_bridged_and_a_kick_that_one_may_give_is_not() -> None:
    good = motion()
    reach = float(np.abs(good["tau"]).max())
    absurd = cleaned(spoiled(good, "tau", slice(300, 301), 10 * reach))
    assert np.abs(absurd["tau"] - good["tau"]).max() < 1e-3 * reach
    kick = spoiled(good, "tau", slice(300, 301), 2 * reach)
    assert cleaned(kick) is kick


def test_a_stale_reading_in_fast_motion_is_false() -> None:
    good = motion(noise=1e-7)
    row = int(np.argmax(np.abs(np.diff(good["q"]))))
    stale = spoiled(good, "q", slice(row, row + 1), good["q"][row - 1])
    assert cleaned(stale).masked == ((good.t[row], good.t[row]),)


@pytest.mark.parametrize("what", ["impact", "new zero", "bump", "chatter", "flicker"])
def test_what_a_machine_can_do_is_left(what: str) -> None:
    good, row = motion(1e-4, noise=1e-5), 4000
    t, q = good.t, good["q"]
    width = 4 / RATE
    real = {
        "impact": q + 0.5 * np.maximum(t - t[row], 0),
        "new zero": q + 1.0 * (t > t[row]),
        "bump": q + 0.01 * np.exp(-(((t - t[row]) / width) ** 2)),
        "chatter": q + 0.003 * np.sign(np.sin(2 * np.pi * 120 * t)) * (np.abs(t - t[row]) < 0.2),
        "flicker": q + 1e-4 * (np.arange(len(t)) == row),
    }[what]
    run = replace(good, table=good.table | {"q": real})
    assert cleaned(run) is run


def test_many_false_readings_are_not_single() -> None:
    rng, good = np.random.default_rng(2), motion()
    q = np.where(rng.random(len(good)) < 0.05, -3.14, good["q"])
    run = replace(good, table=good.table | {"q": q})
    assert cleaned(run) is run


def test_a_diagnosis_leaves_them_out_before_anything_is_fitted() -> None:
    from cosim.diagnosis.diagnose import diagnose

    bad = spoiled(motion(rate=200.0), "q", slice(2000, 2001), -3.14)
    card = parse_card('[mount]\ninertia = 4.5\n[friction]\nmodel = "coulomb"\nFc = 1.8\nsigma2 = 1.1\n', "card.toml")
    found = diagnose([bad], [replace(bad, name="heldout")], card).diagnosis
    assert found.verdict == ()
    assert found.heldout.before_rms < 0.1, "a twentieth of the friction level; the false reading alone makes 1 N m"
    assert [one.finding for one in found.sanity][:2] == ["single_readings", "single_readings"]
    assert any("row 2,001" in note for note in found.data_quality)
