"""A card from recordings alone, and a diagnosis to which neither a card nor a held-out recording is given."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import call
from two_links import OWN, elbow
from wandering import swing

import cosim
from cosim.api.defaults import estimated, split
from cosim.api.diagnose import diagnose
from cosim.data.recording import Recording
from cosim.diagnosis.first_card import first_card
from cosim.diagnosis.terms.dictionary import user_columns
from cosim.estimation.prepare import prepare
from cosim.support.errors import InputError
from pyfmi_models.card import read_card
from pyfmi_models.effects import TorqueOffset

Printed = pytest.CaptureFixture[str]
SECONDS, RATE = 30.0, 250.0
TRUE = {"axis.inertia": 2.0, "friction.Fc": 1.5, "friction.sigma2": 3.0}
NOISE, READING = 0.02, 1e-6
"""Of the torque [N m] and of the position [rad], RMS."""


T = np.arange(round(SECONDS * RATE)) / RATE


def made(
    dice: np.random.Generator, q: np.ndarray, tau: np.ndarray, noise: float = NOISE, reading: float = 0.0
) -> pd.DataFrame:
    """A table of what was recorded, with noise."""
    noises = (dice.normal(0, size, len(q)) for size in (noise, reading))
    return pd.DataFrame({"t": T[: len(q)], "tau": tau + next(noises), "q": q + next(noises)})


def table(
    seed: int, offset: float = 0.0, weight: float = 0.0, seconds: float = SECONDS, reach: float = 1.0
) -> pd.DataFrame:
    """Swings of an axis of which everything is known, in both directions, with stops between."""
    dice, t = np.random.default_rng(seed), T[: round(seconds * RATE)]
    waves, phases = [(0.9, 0.13), (0.35, 0.41), (0.12, 0.97)], dice.uniform(0, 2 * np.pi, 3)
    q, v, acceleration = swing(t, [(reach * a, f, p) for (a, f), p in zip(waves, phases, strict=True)])
    tau = TRUE["axis.inertia"] * acceleration + TRUE["friction.Fc"] * np.tanh(v / 1e-3) + TRUE["friction.sigma2"] * v
    return made(dice, q, tau + offset + weight * np.sin(q + 0.4), reading=READING)


def test_inertia_and_friction_are_estimated_with_ranges_that_hold_the_truth(tmp_path: Path) -> None:
    found = cosim.card([table(1), table(2)], tmp_path / "axis.toml", motion="rotary")
    for name, true in TRUE.items():
        one = found.found.number(name)
        assert one.is_determined
        assert one.value == pytest.approx(true, rel=0.05), name
    assert read_card(str(tmp_path / "axis.toml")).plant().parameters()
    assert not found.card.effects
    assert found.card.unbalance is None
    assert "inertia: 2.0" in str(found)
    assert found.card.path == "the estimated card"
    assert found.as_json()["numbers"]["axis.inertia"]["determined"]  # type: ignore[index,call-overload]


def steady(seed: int) -> pd.DataFrame:
    """Constant speeds alone: nothing says what the inertia is."""
    return made(np.random.default_rng(seed), 0.4 * T, TRUE["friction.Fc"] + 0.4 * TRUE["friction.sigma2"] + 0 * T)


def test_what_is_not_determined_is_demanded_by_its_option() -> None:
    with pytest.raises(InputError, match=r"do not determine the inertia: .*--inertia VALUE, in kg\.m2"):
        cosim.card(steady(1), motion="rotary")
    given = cosim.card(table(6), motion="rotary", inertia=2.0)
    assert given.card.mount.inertia == 2.0
    assert "inertia: 2.000 kg.m2, as given" in str(given)


def slow(seed: int) -> pd.DataFrame:
    """Swings in which friction hides the inertia: it takes 3e-5 N m, the noise is far more."""
    q, v, a = swing(T, [(0.5, 0.25, seed)], per=1)
    return made(np.random.default_rng(seed), q, 0.001 * a + 1.5 * np.tanh(v / 1e-3) + 3.0 * v, noise=0.5)


def test_a_diagnosis_without_a_card_goes_on_where_the_inertia_is_not_seen_and_says_what_it_took() -> None:
    with pytest.raises(InputError, match="do not determine the inertia"):
        cosim.card([slow(1), slow(2)], motion="rotary")
    found = cosim.diagnose([slow(1), slow(2)], slow(3), motion="rotary")
    assert found.missing == ()
    with pytest.raises(InputError, match="do not determine the inertia"):
        cosim.diagnose([steady(1)], steady(2), motion="rotary")
    said = " ".join(found.diagnosis.data_quality)
    assert "The recordings hardly show the inertia" in said
    assert 0 < found.card.mount.inertia < 2.0
    assert found.card.friction.Fc == pytest.approx(1.5, rel=0.05)  # type: ignore[attr-defined]


def test_units_say_whether_an_axis_turns_and_what_is_no_axis_or_given_twice_is_refused() -> None:
    assert cosim.card(table(7)).notes[0].startswith("No unit says whether the axis turns")
    assert cosim.card(table(7), units={"q": "mm", "tau": "N"}).card.mount.motion == "linear"
    with pytest.raises(InputError, match='motion "sideways" is no kind of axis; there are: rotary, linear'):
        cosim.card(table(7), motion="sideways")
    with pytest.raises(InputError, match="recording 2 and recording 1 are the same recording; give each once"):
        cosim.card([table(7), table(7)], motion="rotary")


def test_of_several_recordings_the_last_is_kept_and_a_single_one_is_cut() -> None:
    several = [cosim.read(table(seed), name=f"run {seed}") for seed in (1, 2, 3)]
    train, held, said = split(several)
    assert (train, held) == (several[:2], several[2:])
    assert said.startswith("run 3, the last of 3 recordings, is for validation")
    (first,), (rest,), said = split(several[:1])
    assert len(first) + len(rest) == len(several[0])
    assert first.t[-1] < rest.t[0]
    assert "which is weaker than a second recording" in said


def test_two_files_alone_give_an_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Printed) -> None:
    monkeypatch.chdir(tmp_path)
    for seed in (1, 2):
        table(seed, seconds=15.0).to_csv(f"run{seed}.csv", index=False)
    assert call("diagnose", "run1.csv", "run2.csv", "--quick", "--json") == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["verdict"] == []
    assert "run2, the last of 2 recordings, is for validation and not fitted" in said.err
    estimate = r"No card was given; it is estimated from the recordings: inertia (1\.9\d*|2(\.0\d*)?) kg"
    assert re.search(estimate, said.err)
    assert Path("cosim_out/run1-1/card.toml").exists()


def test_a_number_that_the_estimated_card_does_not_hold_is_not_told_as_one_of_it() -> None:
    t = np.arange(0, 20, 0.005)
    tau = -18.0 * np.sin(3 * t) + np.random.default_rng(3).normal(0, NOISE, len(t))
    card, said = estimated([Recording.of({"t": t, "q": np.sin(3 * t), "tau": tau}, "run")], "rotary", print)
    assert card.friction.Fc == 0.0  # type: ignore[attr-defined]
    assert re.search(r"from the recordings: inertia [\d.]+ kg\.m2\. .*Coulomb friction; the card has none", said)


def test_over_a_short_way_a_weight_and_a_constant_are_one_and_over_a_long_way_both_are_there() -> None:
    """Both together had 1.7 times the weight of a measured arm, each far from its standard error."""
    short, long = (
        cosim.card([table(seed, offset=1.0, weight=4.0, reach=reach) for seed in (6, 7)], motion="rotary").card
        for reach in (0.25, 1.5)
    )
    assert short.unbalance is not None
    assert not short.effects
    assert long.unbalance is not None
    assert float(long.unbalance.mgl) == pytest.approx(4.0, rel=0.05)
    assert float(long.unbalance.phase) == pytest.approx(0.4, abs=0.05)
    (offset,) = long.effects
    assert isinstance(offset, TorqueOffset)
    assert float(offset.torque) == pytest.approx(1.0, rel=0.05)


def test_an_inertia_that_a_neighbour_hides_is_estimated_beside_its_motion() -> None:
    """An elbow whose weight turns with both joints: alone the balance tells nothing, and says what would."""
    hidden = [elbow(1, columns=False), elbow(2, columns=False)]
    with pytest.raises(InputError, match=r"other axes move with it, alone, or with their motion as columns \(q2"):
        cosim.card(hidden, motion="rotary")
    beside = cosim.card([elbow(1), elbow(2)], motion="rotary")
    assert beside.card.mount.inertia == pytest.approx(OWN, rel=0.05)
    assert any("only beside the motion of q1" in note for note in beside.notes)
    assert 0 < beside.numbers[0].error < 0.05 * OWN


def test_an_inertia_that_even_its_neighbour_hardly_shows_is_taken_from_its_limit() -> None:
    """A wrist whose torque is read behind the gear: a weight that turns with two joints, and next to no inertia."""
    runs = []
    for seed in (1, 2):
        one, dice = elbow(seed), np.random.default_rng(seed)
        q, own = one["q1"] + one["q"], np.gradient(one["q"], one.t)
        tau = 3.0 * np.sin(q) + 0.3 * np.tanh(own / 1e-2) + dice.normal(0, 0.1, len(q))
        runs.append(Recording.of({**one.table, "tau": tau}, one.name))
    found = first_card(runs, "rotary", is_asked=False)
    assert not found.number("axis.inertia").is_determined
    assert 0 < found.mount.axis.inertia < 0.02
    assert any("hardly show the inertia" in note for note in found.notes)
    alone = [Recording.of({name: one[name] for name in ("t", "tau", "q")}, one.name) for one in runs]
    most = first_card(alone, "rotary", is_asked=False).number("axis.inertia").range[1]
    assert found.number("axis.inertia").range[1] < 0.1 * most


# Recordings as loggers leave them end in no traceback.


def logged(seed: int, level: float, **columns: np.ndarray) -> Recording:
    """.02 kg m2 at 33 Hz with viscous friction, a level of Coulomb friction, and a ripple that no card has."""
    t = np.arange(0, 35, 0.03)
    q = 0.5 * np.sin(1.3 * t + seed) + 0.2 * np.sin(2.9 * t)
    v = np.gradient(q, 0.03)
    noise = 0.004 * np.random.default_rng(seed).standard_normal(len(t))
    tau = 0.02 * np.gradient(v, 0.03) + level * np.tanh(v / 0.01) + 0.15 * v + 0.03 * np.sin(11 * q) + noise
    return Recording(f"run {seed}", {"t": t, "tau": tau, "q": q} | columns)


def test_a_column_that_changes_only_later_is_no_cause() -> None:
    temperature = np.where(np.arange(1167) > 600, 27.0, 26.0)
    train, held = logged(1, 0.2, temperature=np.full(1167, 26.0)), logged(2, 0.2, temperature=temperature)
    assert user_columns(prepare([train], 8.0)) == {}
    assert set(user_columns(prepare([held], 8.0))) == {"temperature"}
    assert diagnose([train], [held]).diagnosis.heldout.before_rms > 0


@pytest.mark.parametrize("level", [0.0, 0.006])
def test_friction_that_is_not_seen_has_no_forms(level: float) -> None:
    found = diagnose([logged(1, level)], [logged(2, level)]).diagnosis
    assert found.heldout.after_rms <= found.heldout.before_rms
