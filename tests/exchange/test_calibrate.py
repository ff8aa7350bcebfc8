"""Numbers of a foreign FMU from recordings: found within their standard errors, named as not determined, or refused."""

import json
import math
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import call
from motor_fmu import TRUTH, driven, motor, recorded
from small_loop import text_of

import cosim
from cosim_calibration.calibrate import Options, calibrate
from cosim_calibration.residuals import Residuals
from cosim_calibration.subject import of_fmu


@pytest.mark.parametrize("version", [2, 3])
def test_the_true_numbers_lie_within_three_standard_errors(found, table, tmp_path, version):
    done = found(table, fmu=motor(tmp_path, version), starts=2)
    for name, value in TRUTH.items():
        assert abs(done.numbers[name] - value) < 3 * done.standard_errors[name] < 0.2 * value
        assert done.frame().loc[name, "value"] == done.numbers[name]
    assert not done.not_determined


def test_the_verb_writes_numbers_an_fmu_that_has_them_and_a_report(fmu, found, tmp_path, capsys):
    runs = [tmp_path / "run1.csv", tmp_path / "run2.csv"]
    for seed, path in enumerate(runs, 1):
        pd.DataFrame(recorded(fmu, TRUTH, seed=seed)).to_csv(path, index=False)
    out = tmp_path / "out"
    given = ["identify", "--fmu", fmu, "--free", "J", "d", "Fc", runs[0], "--heldout", runs[1], "--out", out]
    assert call(*given, "--starts", 1) == 0
    assert "run2 (kept out)" in capsys.readouterr().out
    told = json.loads((out / "identified.json").read_text())
    assert set(told["numbers"]) == set(TRUTH)
    assert told["heldout"]["w"]["after_rms"] < 0.025 < told["heldout"]["w"]["before_rms"]
    with zipfile.ZipFile(out / "motor3_identified.fmu") as archive:
        text = archive.read("modelDescription.xml").decode()
    assert f'start="{told["numbers"]["J"]["value"]!r}"' in text
    again = found(runs[1], fmu=out / "motor3_identified.fmu", free=["J"])
    assert abs(again.numbers["J"] - told["numbers"]["J"]["value"]) < 5 * again.standard_errors["J"]
    assert "ssv:Real" in (out / "identified.ssv").read_text()
    page = (out / "report.html").read_text()
    assert "kept out" in page
    assert "run1: w" in page
    assert call(*given) == 2, "nothing is overwritten"


def test_a_parameter_that_changes_nothing_and_a_pair_that_acts_as_a_product_are_named(fmu, found, table):
    done = found(table, free=["J", "kt", "gear", "idle"], starts=2)
    assert "idle changes nothing that was recorded." in done.not_determined
    assert any("kt" in one and "gear" in one and "product" in one for one in done.not_determined)
    assert [name for name in done.numbers if math.isfinite(done.standard_errors[name])] == ["J"]
    assert done.numbers["idle"] == 1, "it stays as it was"
    exact = found(recorded(fmu, {}, noise=0.0), free=["J", "idle"])  # the start values follow it as it is
    assert exact.not_determined == ("idle changes nothing that was recorded.",)
    assert exact.numbers["J"] == pytest.approx(0.02, rel=1e-6)
    assert 0 < exact.standard_errors["J"] < 1e-6


def test_residuals_that_hang_together_widen_the_standard_errors(fmu, found):
    clean = recorded(fmu, TRUTH, noise=0.0)
    white = 0.02 * np.random.default_rng(3).standard_normal(len(clean["t"]))
    red = np.convolve(white, np.ones(20) / math.sqrt(20), "same")
    tables = [{"t": clean["t"], "i": clean["i"], "w": clean["w"] + noise} for noise in (white, red)]
    of_white, of_red = (found(one).standard_errors["d"] for one in tables)
    assert of_red > 2 * of_white


def test_outliers_move_a_robust_fit_less(found, table):
    far = {"t": table["t"], "i": table["i"], "w": table["w"] + 5.0 * (np.arange(400) % 23 == 0)}
    known = {"J": TRUTH["J"], "Fc": TRUTH["Fc"]}
    plain, robust = (found(far, free=["d"], loss=loss, set=known).numbers["d"] for loss in ("linear", "soft_l1"))
    assert abs(robust - TRUTH["d"]) < 0.3 * abs(plain - TRUTH["d"])


# What a calibration refuses in a sentence, and what costs it a point: columns, names, FMUs that crash or hang.


@pytest.mark.parametrize("trouble", [{"crash_above": 0.05}, {"nan_below": 0.006}])
def test_a_point_at_which_the_fmu_crashes_or_gives_nan_costs_that_point(found, table, trouble):
    done = found(table, starts=2, set=trouble)
    assert abs(done.numbers["J"] - TRUTH["J"]) < 4 * done.standard_errors["J"]
    assert done.calibrated.lost


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"set": {"crash_above": 0.01}}, "crashed"),
        ({"set": {"nan_below": 1.0}}, "not a finite number"),
        ({"set": {"hang_below": 1.0}, "timeout": 2.0}, "did not end its simulation within 2 s"),
        ({"set": {"d": np.inf}}, "--set d=inf: it must be a finite number"),
        ({"set": {"i": 3.0}}, '--set i: the column "i" of .* feeds it'),
        ({"free": ["j"]}, 'has no such variable.*Did you mean "J"'),
        ({"free": ["i"]}, "is an input, which the columns"),
        ({"free": ["crash"]}, "has no such variable"),
        ({"workers": 100_000}, "1,024 are the most"),
        ({"initial": "guess"}, '--initial "guess": there are: recorded, free'),
        ({"derivatives": "adjoint"}, "there are: differences, directional"),
        ({"window": 0.02}, "4 are the fewest"),
        ({"columns": {"w": "nothing"}}, 'no recording has a column "nothing"; they have: i'),
        ({"columns": {"phi": "seed"}}, 'no recording has a column "seed"'),  # never that of its own name instead
        ({"units": {"w": "kg"}}, "does not fit w"),
    ],
)
def test_an_fmu_that_does_not_run_and_options_that_cannot_be_meant_are_sentences(found, table, options, words):
    with pytest.raises(cosim.InputError, match=words):
        found(table, **{"free": ["J"], **options})


def test_columns_are_matched_by_name_option_and_unit(found, table):
    turned = {"t": table["t"], "current": table["i"], "speed": np.degrees(table["w"]), "other": table["phi"]}
    done = found(turned, columns={"i": "current", "w": "speed"}, units={"speed": "deg/s"})
    assert all(abs(done.numbers[name] - value) < 4 * done.standard_errors[name] for name, value in TRUTH.items())
    assert any("not used: other" in note for note in done.calibrated.notes)
    with pytest.raises(cosim.InputError, match="none of its columns"):
        found(turned)


def test_an_input_without_a_number_in_a_row_is_a_sentence_and_notes_of_the_reading_are_kept(found, table):
    gap = np.where(np.arange(400) == 5, np.nan, table["i"])
    with pytest.raises(cosim.InputError, match='column "i" was left out'):
        found(table | {"i": gap})
    with pytest.raises(cosim.InputError, match="It feeds the input i"):
        found(table | {"other": gap}, columns={"i": "other"})
    done = found(table | {"more": np.full(400, np.nan)}, free=["J"])
    assert any("more" in note for note in done.calibrated.notes)
    with pytest.raises(cosim.InputError, match="is fitted and kept out"):
        found(table, heldout=table)


# A whole scenario: components, signals and wires by their addresses.

OF_SYSTEM = {"first.J": 0.03, "second.Fc": 0.2, "second.i.gain": 1.4}


def two_motors(inertia: float, friction: float, gain: float) -> str:
    fmus = {"first": {"J": inertia}, "second": {"Fc": friction}}
    return text_of(
        {
            "first.i": {"from": "current.position", "unit": "A"},
            "second.i": {"from": "first.w", "unit": "A", "gain": gain},
        },
        step=0.01,
        stop=3.0,
        components={name: {"fmu": "motor3.fmu", "parameters": given} for name, given in fmus.items()},
        signals={"current": {"kind": "sine", "amplitude": 3.0, "frequency": 0.7}},
        record={"signals": {"w": "second.w", "phi": "first.phi"}},
    )


@pytest.fixture(scope="module")
def scenario(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("system")
    motor(folder, 3)
    (folder / "start.toml").write_text(two_motors(0.02, 0.1, 1.0))
    (folder / "truth.toml").write_text(two_motors(*OF_SYSTEM.values()))
    table = cosim.run(folder / "truth.toml").recording.table
    random = np.random.default_rng(5)
    noisy = {name: table[name] + 0.02 * random.standard_normal(len(table["t"])) for name in ("w", "phi")}
    pd.DataFrame({"t": table["t"], **noisy}).to_csv(folder / "run.csv", index=False)
    return folder / "start.toml"


def test_numbers_of_components_wires_and_signals_of_a_scenario_are_found(scenario, capsys):
    run, out = scenario.parent / "run.csv", scenario.parent / "out"
    arguments = ["--system", scenario, "--free", *OF_SYSTEM, run, "--out", out, "--workers", 1, "--starts", 1]
    assert call("identify", *arguments) == 0, capsys.readouterr().err
    told = json.loads((out / "identified.json").read_text())["numbers"]
    for name, value in OF_SYSTEM.items():
        assert abs(told[name]["value"] - value) < 3 * told[name]["standard_error"]
    assert not list(out.glob("*.fmu"))
    done = cosim.identify(run, system=scenario, free=["current.amplitude"], starts=1, workers=1, set=OF_SYSTEM)
    assert abs(done.numbers["current.amplitude"] - 3) < 3 * done.standard_errors["current.amplitude"]


@pytest.mark.parametrize(
    ("free", "options", "words"),
    [
        ("first.j", {}, 'Did you mean "first.J"'),
        ("first.i", {}, "is an input that is fed"),
        ("J", {}, "has no such variable"),
        ("first.J", {"derivatives": "directional"}, "is a system"),
    ],
)
def test_what_a_system_does_not_have_is_a_sentence(scenario, free, options, words):
    with pytest.raises(cosim.InputError, match=words):
        cosim.identify(scenario.parent / "run.csv", system=scenario, free=[free], **options)


# An FMU's own derivatives: taken where they agree with differences, said where not.

OF_PLANT = ("axis.inertia", "friction.Fc", "friction.sigma2")


@pytest.fixture(scope="module")
def plant(tmp_path_factory) -> Path:
    """An FMU that gives derivatives by its parameters: an axis with LuGre friction."""
    done = cosim.export("paper_mount", tmp_path_factory.mktemp("plant"), fmi=3)
    return next(one for one in done.fmus if "plant" in one.name)


@pytest.fixture(scope="module")
def followed(plant) -> dict:
    t = 5e-4 * np.arange(1600)
    tau = 20 * np.sin(2 * np.pi * 1.5 * t) + 8 * np.sin(2 * np.pi * 4.1 * t)
    truth = {"axis.inertia": 36.0, "friction.Fc": 1.3}
    v = driven(plant, tau, truth, into="tau", outputs=["v"], step=5e-4)["v"]
    noise = 1e-3 * np.std(v) * np.random.default_rng(1).standard_normal(1600)
    return {"t": t, "tau": tau, "v": v + noise}


def test_both_kinds_of_derivatives_agree_and_give_the_same_numbers(plant, followed, found, monkeypatch):
    seen: list[tuple[np.ndarray, np.ndarray]] = []
    use = Residuals.use_directional

    def compared(self, x):
        shared = list(range(len(self.free)))
        seen.append((self._directional(x, shared), self._differences(x, 1e-3 * np.ones(len(x)))[0]))
        return use(self, x)

    monkeypatch.setattr(Residuals, "use_directional", compared)
    by_differences, by_own = (
        found(followed, fmu=plant, free=list(OF_PLANT), derivatives=kind) for kind in ("differences", "directional")
    )
    own, difference = seen[0]
    assert (np.linalg.norm(own - difference, axis=0) < 0.02 * np.linalg.norm(difference, axis=0)).all()
    for name in OF_PLANT:
        error = by_differences.standard_errors[name]
        assert abs(by_own.numbers[name] - by_differences.numbers[name]) < 0.1 * error
        assert by_own.standard_errors[name] == pytest.approx(error, rel=0.05)
    assert not any("differences" in note for note in by_own.calibrated.notes)
    assert by_own.calibrated.evaluations < by_differences.calibrated.evaluations


def test_an_fmu_without_derivatives_is_fitted_by_differences_and_that_is_said(found, table):
    done = found(table, free=["J"], set={"d": TRUTH["d"], "Fc": TRUTH["Fc"]}, derivatives="directional")
    assert "The FMU gives no directional derivatives by J: differences are used." in done.calibrated.notes
    assert abs(done.numbers["J"] - TRUTH["J"]) < 4 * done.standard_errors["J"]


def test_derivatives_that_are_wrong_are_not_used(plant, followed, monkeypatch):
    right = Residuals._directional

    def wrong(self, x, numbers):
        return right(self, x, numbers) * np.where(np.array(numbers) == 1, -1.0, 1.0)

    monkeypatch.setattr(Residuals, "_directional", wrong)
    recording = cosim.read(followed, required=())
    options = Options(OF_PLANT, starts=1, workers=1, derivatives="directional")
    done = calibrate(of_fmu(plant), [recording], [], options)
    assert ["friction.Fc" in one and "200 % from differences" in one for one in done.notes if "FMU's" in one] == [True]
    assert abs(done.values["friction.Fc"] - 1.3) < 4 * done.uncertainty.standard_errors[1]
