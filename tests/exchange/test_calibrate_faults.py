"""What a calibration refuses in a sentence, and what costs it a point: columns, names, FMUs that crash or hang."""

from pathlib import Path

import numpy as np
import pytest
from motor_fmu import motor, recorded

import cosim

TRUTH = {"J": 0.013, "d": 0.08, "Fc": 0.16}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("motor")


@pytest.fixture(scope="module")
def fmus(folder) -> dict[int, Path]:
    return {3: motor(folder, 3)}


def found(*given, **options):
    return cosim.identify(*given, **{"workers": 1, **options})


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
