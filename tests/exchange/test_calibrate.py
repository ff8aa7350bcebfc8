"""Numbers of a foreign FMU from recordings: found within their standard errors, named as not determined, or refused."""

import json
import math
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import call as verb
from motor_fmu import motor, recorded

import cosim

TRUTH = {"J": 0.013, "d": 0.08, "Fc": 0.16}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("motor")


@pytest.fixture(scope="module")
def fmus(folder) -> dict[int, Path]:
    return {version: motor(folder, version) for version in (2, 3)}


def found(*given, **options):
    return cosim.identify(*given, **{"workers": 1, **options})


def csv(path: Path, table: dict) -> Path:
    pd.DataFrame(table).to_csv(path, index=False)
    return path


@pytest.mark.parametrize("version", [2, 3])
def test_the_true_numbers_lie_within_three_standard_errors(fmus, version):
    done = found(recorded(fmus[version], TRUTH), fmu=fmus[version], free=list(TRUTH), starts=2)
    for name, value in TRUTH.items():
        assert abs(done.numbers[name] - value) < 3 * done.standard_errors[name] < 0.2 * value
        assert done.frame().loc[name, "value"] == done.numbers[name]
    assert not done.not_determined


def test_the_verb_writes_numbers_an_fmu_that_has_them_and_a_report(fmus, folder, capsys):
    runs = [csv(folder / f"run{k}.csv", recorded(fmus[3], TRUTH, seed=k)) for k in (1, 2)]
    out = folder / "out"
    given = ["identify", "--fmu", fmus[3], "--free", "J", "d", "Fc", runs[0], "--heldout", runs[1], "--out", out]
    assert verb(*given, "--starts", 1) == 0
    assert "run2 (kept out)" in capsys.readouterr().out
    told = json.loads((out / "identified.json").read_text())
    assert set(told["numbers"]) == set(TRUTH)
    assert told["heldout"]["w"]["after_rms"] < 0.025 < told["heldout"]["w"]["before_rms"]
    with zipfile.ZipFile(out / "motor3_identified.fmu") as archive:
        text = archive.read("modelDescription.xml").decode()
    assert f'start="{told["numbers"]["J"]["value"]!r}"' in text
    again = found(runs[1], fmu=out / "motor3_identified.fmu", free=["J"], starts=1)
    assert abs(again.numbers["J"] - told["numbers"]["J"]["value"]) < 5 * again.standard_errors["J"]
    assert "ssv:Real" in (out / "identified.ssv").read_text()
    page = (out / "report.html").read_text()
    assert "kept out" in page
    assert "run1: w" in page
    assert verb(*given) == 2, "nothing is overwritten"


def test_a_parameter_that_changes_nothing_and_a_pair_that_acts_as_a_product_are_named(fmus):
    done = found(recorded(fmus[3], TRUTH), fmu=fmus[3], free=["J", "kt", "gear", "idle"], starts=2)
    assert "idle changes nothing that was recorded." in done.not_determined
    assert any("kt" in one and "gear" in one and "product" in one for one in done.not_determined)
    assert math.isinf(done.standard_errors["idle"])
    assert math.isinf(done.standard_errors["kt"])
    assert math.isfinite(done.standard_errors["J"])
    assert done.numbers["idle"] == 1, "it stays as it was"


def test_residuals_that_hang_together_widen_the_standard_errors(fmus):
    table = recorded(fmus[3], TRUTH, noise=0.0)
    random = np.random.default_rng(3)
    white = 0.02 * random.standard_normal(len(table["t"]))
    red = np.convolve(white, np.ones(20) / math.sqrt(20), "same")
    errors = {}
    for name, noise in {"white": white, "red": red}.items():
        done = found(
            {"t": table["t"], "i": table["i"], "w": table["w"] + noise}, fmu=fmus[3], free=["J", "d", "Fc"], starts=1
        )
        errors[name] = done.standard_errors["d"]
    assert errors["red"] > 2 * errors["white"]


def test_windows_start_from_the_recording(fmus):
    table = recorded(fmus[3], TRUTH)
    done = found(table, fmu=fmus[3], free=["J", "d", "Fc"], window=1.0, starts=1)
    assert all(abs(done.numbers[name] / value - 1) < 0.2 for name, value in TRUTH.items())
    with pytest.raises(cosim.InputError, match="4 are the fewest"):
        found(table, fmu=fmus[3], free=["J"], window=0.02)


def test_outliers_move_a_robust_fit_less(fmus):
    table = recorded(fmus[3], TRUTH)
    table["w"][::23] += 5.0
    off = {}
    for loss in ("linear", "soft_l1"):
        done = found(
            {k: v for k, v in table.items() if k != "phi"},
            fmu=fmus[3],
            free=["d"],
            starts=1,
            loss=loss,
            set={"J": TRUTH["J"], "Fc": TRUTH["Fc"]},
        )
        off[loss] = abs(done.numbers["d"] - TRUTH["d"])
    assert off["soft_l1"] < 0.3 * off["linear"]


def test_recordings_without_noise_that_the_start_values_follow_exactly_still_name_what_is_idle(fmus):
    table = recorded(fmus[3], {}, noise=0.0)
    done = found(table, fmu=fmus[3], free=["J", "idle"], starts=1)
    assert done.not_determined == ("idle changes nothing that was recorded.",)
    assert done.numbers["J"] == pytest.approx(0.02, rel=1e-6)
    assert 0 < done.standard_errors["J"] < 1e-6


# What a calibration refuses in a sentence, and what costs it a point: columns, names, FMUs that crash or hang.


def test_a_point_at_which_the_fmu_crashes_or_gives_nan_costs_that_point(fmus):
    table = recorded(fmus[3], TRUTH)
    for name, value in (("crash_above", 0.05), ("nan_below", 0.006)):
        done = found(table, fmu=fmus[3], free=["J", "d", "Fc"], starts=2, set={name: value})
        assert abs(done.numbers["J"] - TRUTH["J"]) < 4 * done.standard_errors["J"]
        assert done.calibrated.lost


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("crash_above", 0.01, "crashed"),
        ("nan_below", 1.0, "not a finite number"),
        ("hang_below", 1.0, "did not end its simulation within 2 s"),
    ],
)
def test_an_fmu_that_cannot_be_simulated_at_its_start_is_a_sentence(fmus, name, value, words):
    patience = 2.0 if name == "hang_below" else 60.0  # what answers may be slow on a busy computer
    with pytest.raises(cosim.InputError, match=words):
        found(recorded(fmus[3], TRUTH), fmu=fmus[3], free=["J"], timeout=patience, set={name: value})


@pytest.mark.parametrize(
    ("free", "words"),
    [
        ("j", 'has no such variable.*Did you mean "J"'),
        ("i", "is an input, which the columns"),
        ("crash", "has no such variable"),
    ],
)
def test_a_name_that_is_no_parameter_is_a_sentence(fmus, free, words):
    with pytest.raises(cosim.InputError, match=words):
        found(recorded(fmus[3], TRUTH), fmu=fmus[3], free=[free])


def test_columns_are_matched_by_name_option_and_unit(fmus):
    table = recorded(fmus[3], TRUTH)
    turned = {"t": table["t"], "current": table["i"], "speed": np.degrees(table["w"]), "other": table["phi"]}
    given = {"i": "current", "w": "speed"}
    done = found(turned, fmu=fmus[3], free=list(TRUTH), columns=given, units={"speed": "deg/s"}, starts=1)
    assert all(abs(done.numbers[name] - value) < 4 * done.standard_errors[name] for name, value in TRUTH.items())
    assert any("not used: other" in note for note in done.calibrated.notes)
    with pytest.raises(cosim.InputError, match='no recording has a column "nothing"; they have: current'):
        found(turned, fmu=fmus[3], free=["J"], columns={"w": "nothing"})
    with pytest.raises(cosim.InputError, match='no recording has a column "seed"'):
        found(table, fmu=fmus[3], free=["J"], columns={"w": "seed"})  # never that of the variable's own name instead
    with pytest.raises(cosim.InputError, match="none of its columns"):
        found(turned, fmu=fmus[3], free=["J"])
    with pytest.raises(cosim.InputError, match="does not fit w"):
        found(turned, fmu=fmus[3], free=["J"], columns=given, units={"speed": "kg"})


def test_an_input_without_a_number_in_a_row_is_a_sentence_and_notes_of_the_reading_are_kept(fmus, folder):
    table = recorded(fmus[3], TRUTH)
    table["i"] = np.where(table["t"] == table["t"][5], np.nan, table["i"])
    with pytest.raises(cosim.InputError, match='column "i" was left out'):
        found(table, fmu=fmus[3], free=["J"])
    with pytest.raises(cosim.InputError, match="It feeds the input i"):
        found(
            {("other" if name == "i" else name): one for name, one in table.items()},
            fmu=fmus[3],
            free=["J"],
            columns={"i": "other"},
        )
    table = recorded(fmus[3], TRUTH) | {"more": np.full(400, np.nan)}
    done = found(table, fmu=fmus[3], free=["J"], starts=1)
    assert any("more" in note for note in done.calibrated.notes)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"set": {"d": np.inf}}, "--set d=inf: it must be a finite number"),
        ({"workers": 100_000}, "1,024 are the most"),
        ({"initial": "guess"}, "there are: recorded, free"),
    ],
)
def test_options_that_cannot_be_meant_are_sentences(fmus, options, words):
    with pytest.raises(cosim.InputError, match=words):
        found(recorded(fmus[3], TRUTH), fmu=fmus[3], free=["J"], **options)


def test_a_recording_that_is_fitted_cannot_be_kept_out(fmus):
    table = recorded(fmus[3], TRUTH)
    with pytest.raises(cosim.InputError, match="is fitted and kept out"):
        found(table, fmu=fmus[3], free=["J"], heldout=table)
