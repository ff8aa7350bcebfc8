"""What an FMU carries of how its numbers were found: the recording they were judged on, where they are proven.

It does not carry experiments that only the numbers before would meet. A run, a sweep and a system say the first time
and variable at which the range is left in which a model is proven.
Learned terms go along as maps with breakpoints and units, and are shown as curves.
"""

import json
import shutil
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from experiment_archives import FOLDER, bundle, manifest, with_files
from fmpy.validation import validate_fmu
from motor_fmu import driven, recorded
from small_loop import text_of

import cosim
from cosim.data.recording import Recording
from cosim.delivery.experiment import of_recording, sines, with_experiment
from cosim.experiments.run import Outcome
from cosim.fmi.domain import KEY, Domain, domains_of, entries_of
from cosim.fmi.manifest import manifest_of
from cosim.fmi.own_starts import MEMBER, as_member, own_starts
from cosim.master.proven import Proven
from cosim.master.session import OutsideProvenRangeWarning
from cosim.models.maps import WIDTH, curve, curves_in, maps_of
from cosim.system.ports import PortRef
from cosim_calibration.left_behind import MANIFEST, left_behind
from pyfmi_models.card import read_card
from pyfmi_models.card_writer import card_text
from pyfmi_models.effects.learned import LearnedTorque
from pyfmi_models.export import export_fmu
from pyfmi_models.export.related import identified as identified_as
from pyfmi_models.export.related import references

T = 0.01 * np.arange(101)


@pytest.fixture(scope="module")
def identified(fmu, tmp_path_factory) -> Path:
    """The motor with an experiment that it passes and a page, identified from one run and judged on another."""
    folder, current = tmp_path_factory.mktemp("identified"), 2 * np.sin(9 * T)
    files = bundle({"time": T, "i": current}, {"time": T, "w": driven(fmu, current)["w"]})
    rows = ("application/x-ma-hs-experiments", "a.exp", "experiment"), ("text/html", "page.html", "document")
    more = {"page.html": "<p/>", "fmi-ls-manifest.xml": manifest(*rows)}
    with_page = with_files(fmu, folder / "theirs.fmu", files | more)
    runs = [recorded(fmu, {"J": 0.03, "Fc": 0.16}, rows=150, seed=seed) for seed in (1, 2)]
    given = {"J": 0.02, "Fc": 0.16}  # Fc stays, and is not the start value that the FMU states
    done = cosim.identify(
        runs[0], heldout=runs[1], fmu=with_page, free=["J"], set=given, starts=1, workers=1, out=folder / "numbers"
    )
    return done.files["fmu"]


def passed(fmu: Path) -> Outcome:
    """What the only experiment of an FMU comes to, which passes."""
    done = cosim.check(fmu)
    assert done.passed, str(done)
    (outcome,) = done.checked.outcomes
    return outcome


def test_an_identified_fmu_carries_the_recording_kept_out_and_passes_its_own_check(identified):
    outcome = passed(identified)
    assert outcome.experiment.name == "heldout 1"
    assert [one.name for one in outcome.compared] == ["w", "phi"]
    assert len(outcome.times) == 150
    with zipfile.ZipFile(identified) as archive:
        names = archive.namelist()
        measured = archive.read(f"{FOLDER}/identified/measured.csv").decode().splitlines()
    assert len(names) == len(set(names))
    assert any(name.startswith("binaries/") for name in names)
    first = np.array([float(row.split(",")[1]) for row in measured[1:]])
    gap = np.sqrt(np.mean((first - outcome.reference["w"]) ** 2))
    assert 0 < gap < 0.05 * np.ptp(first)  # noise of the recording, and not another curve
    assert f"w {gap:.3g} rad/s" in outcome.experiment.description


def test_the_manifest_keeps_its_other_entries_and_a_second_identification_replaces_the_experiment(identified, tmp_path):
    assert [one.member for one in manifest_of(identified).related if one.role == "document"] == [f"{FOLDER}/page.html"]
    table = recorded(identified, {"J": 0.025}, rows=150)
    done = cosim.identify(table, fmu=identified, free=["J"], starts=1, workers=1, out=tmp_path / "again")
    again = manifest_of(done.files["fmu"])
    assert [one.main_role for one in again.related].count("experiment") == 1
    assert f"{FOLDER}/page.html" in [one.member for one in again.related]
    assert "fitted" in passed(done.files["fmu"]).experiment.description


def test_an_fmu_whose_number_was_changed_afterwards_fails(identified, tmp_path):
    with zipfile.ZipFile(identified) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    files[MEMBER] = as_member({"J": 1.02 * own_starts(identified)["J"]})
    archive_of(tmp_path / "changed.fmu", files).close()
    checked = cosim.check(tmp_path / "changed.fmu")
    assert not checked.passed
    assert not checked.checked.outcomes[0].compared[0].passed


def archive_of(path: Path, files: dict[str, str | bytes]) -> zipfile.ZipFile:
    with zipfile.ZipFile(path, "w") as target:
        for name, content in files.items():
            target.writestr(name, content)
    return zipfile.ZipFile(path)


def test_other_files_stay_and_no_source_reaches_beyond_the_folder(tmp_path):
    """An experiment that names the description as its reference does not take it away."""
    text = manifest(
        ("application/x-ma-hs-experiments", "a.exp", "experiment/smoke-test"),
        ("text/html", "b.html", "document"),
        ("text/csv", "r.csv", "result"),
        ("text/csv", "s.csv", "other"),
    )
    inside = '<Experiments><Stimuli source="s.csv"/><References source="../../modelDescription.xml"/></Experiments>'
    files = {MANIFEST: text, f"{FOLDER}/a.exp": inside, f"{FOLDER}/s.csv": "time\n0\n", "modelDescription.xml": "<x/>"}
    with archive_of(tmp_path / "some.zip", files) as archive:
        gone, left = left_behind(archive)
    assert gone == {MANIFEST, *(f"{FOLDER}/{name}" for name in ("a.exp", "r.csv", "s.csv"))}
    assert b"b.html" in left
    assert not any(name in left for name in (b"a.exp", b"r.csv", b"s.csv"))
    with archive_of(tmp_path / "none.zip", {"modelDescription.xml": "<x/>"}) as archive:
        assert left_behind(archive) == (frozenset(), b"")
    with archive_of(tmp_path / "torn.zip", {MANIFEST: "<torn"}) as archive:
        assert left_behind(archive) == (frozenset(), b"<torn"), "what cannot be read stays"


# What this project exports carries an experiment by which it can be checked elsewhere.


def test_an_exported_fmu_passes_the_experiment_that_it_carries_and_equal_cards_give_equal_bytes(tmp_path):
    once, again = (cosim.export("emps", tmp_path / name, fmi=3) for name in ("once", "again"))
    for path, same in zip(once.fmus, again.fmus, strict=True):
        assert path.read_bytes() == same.read_bytes()
        assert passed(path).compared
        assert manifest_of(path).version == "1.0.0-beta.1"


def test_the_torque_of_a_recording_is_the_stimulus_and_what_was_measured_lies_beside(tmp_path):
    model = read_card("paper_mount").plant().model()
    t = 1e-3 * np.arange(3000)
    table = {"t": t, "tau": 20 * np.sin(6 * t), "q": 1e-3 * np.cos(6 * t), "tau_d": t}
    stimulus = of_recording(Recording("night", table), model)
    path = tmp_path / "improved.fmu"
    with_experiment(lambda related: export_fmu(model, path, fmi=3, force=True, related=related), stimulus)
    assert passed(path).experiment.name == "night"
    with zipfile.ZipFile(path) as archive:
        measured = archive.read(f"{FOLDER}/measured.csv").decode().splitlines()
        assert measured[0] == "time,q"
        assert len(measured) == 2001
        assert "tau" in archive.read(f"{FOLDER}/stimulus.csv").decode().splitlines()[0]


def test_an_fmu_without_a_recording_is_asked_for_sines_of_two_seconds():
    """Also where the model is sampled: ten of its steps lie between two rows."""
    card = read_card("paper_mount")
    for model, every in ((card.plant().model(), 0.01), (card.controller_model(), 10 / card.controller.loop_hz)):
        times = sines(model).times
        np.testing.assert_allclose(np.diff(times), every)
        assert (times[0], times[-1]) == (0.0, pytest.approx(2.0))


# Where a model is proven.

SCENARIO = text_of(
    {"a.i": "u.position", "b.i": {"from": "u.position", "gain": 0.5}},
    step=1e-2,
    stop=2.0,
    components={"a": {"fmu": "proven.fmu", "variables": {"speed": "w"}}, "b": {"fmu": "proven.fmu"}},
    signals={"u": {"kind": "ramp", "velocity": 2.0, "unit": "A"}},
    record={"signals": {"phi": "a.phi"}},
)


@pytest.fixture(scope="module")
def proven(fmu, tmp_path_factory) -> Path:
    """A motor that is proven for speeds up to 60 rpm and currents of 3 A, and a system of two of them."""
    folder = tmp_path_factory.mktemp("proven")
    domains = (Domain("speed", -60.0, 60.0, "rpm", "w"), Domain("i", -3.0, 3.0, "A"), Domain("dust", 0, 1, "1"))
    files = references(identified_as("motor", {KEY: entries_of(domains)}, b""))
    shutil.copy(fmu, folder / "proven.fmu")
    with zipfile.ZipFile(folder / "proven.fmu", "a") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    (folder / "system.toml").write_text(SCENARIO)
    return folder


def test_a_run_says_the_first_time_and_variable_and_a_signal_that_feeds_two_is_proven_for_both(proven):
    done = cosim.run(proven / "system.toml")
    outside = done.statistics["outside"]
    assert [one.split(" leaves")[0] for one in outside] == ["a.speed", "a.i"], "the first one first"
    current = next(one for one in outside if one.startswith("a.i"))
    assert "a is proven at 1.51 s: 3.02 A, proven -3 to 3; at most it is 3.98" in current
    speed = next(one for one in outside if one.startswith("a.speed"))
    assert "proven -6.283 to 6.283" in speed
    assert outside[0] in str(done)
    assert list(done.recording.columns) == ["t", "phi"], "nothing more is recorded"
    assert cosim.run(proven / "system.toml", stop=0.5).statistics["outside"] == [], "within it nothing is said"
    rows = {row["signal"]: row for row in cosim.show(proven / "system.toml").tables["proven for"]}
    assert rows["u.position"] == {"signal": "u.position", "proven": "-3 to 3 A", "for": "a, b"}, "b allows 6 A of it"
    assert rows["a.speed"]["proven"] == "-60 to 60 rpm"


def test_a_system_in_hand_says_it_while_it_is_stepped_and_warns_at_the_end(proven):
    def stepped():
        with cosim.open(proven / "system.toml") as s:
            s.step(50)
            assert s.outside == ()
            s.step(150)
            assert [one.split(" leaves")[0] for one in s.outside] == ["a.speed", "a.i"]
            assert "a is proven at 1.51 s: 3.02 A, proven -3 to 3" in s.outside[1]
            assert s.outside == s.outside, "asked twice it is the same"
            assert list(s.recording.columns) == ["t", "phi"], "nothing more is recorded"

    with pytest.warns(OutsideProvenRangeWarning, match="leaves the range") as warned:
        stepped()
    assert len(warned) == 2


def test_a_sweep_says_which_run_leaves_it_first(proven, tmp_path):
    (proven / "sweep.toml").write_text(
        'scenario = "system.toml"\n[vary]\n"u.velocity" = [0.1, 2.0, 4.0]\n'
        '[statistics]\nend = { signal = "phi", kind = "final" }\n'
    )
    done = cosim.sweep(proven / "sweep.toml", tmp_path / "out", workers=1)
    assert done.summary.outside == 2
    assert "2 runs left what is proven; run 1: a.speed leaves the range in which a is proven at " in str(done)
    reasons = done.frame()["reason"].tolist()
    assert [bool(one) for one in reasons] == [False, True, True]
    assert done.frame()["status"].tolist() == ["ok"] * 3


def test_a_card_states_its_range_and_its_fmu_carries_it(tmp_path):
    card = read_card("emps")
    path = tmp_path / "better.toml"
    origin = {KEY: entries_of((Domain("speed", -0.1, 0.1, "m/s", "v"), Domain("load", 0, 1, "1")))}
    path.write_text(card_text(replace(card, origin=origin)))
    assert cosim.show(path).facts["proven for"] == "speed -0.1 to 0.1 m/s; load 0 to 1 1"
    (tmp_path / "push.toml").write_text(
        f'step = 1e-3\nstop = 0.5\n[components.axis]\ncard = "{path}"\npart = "plant"\n'
        '[signals.u]\nkind = "constant"\nvalue = 100.0\nunit = "N"\n'
        '[[connections]]\nfrom = "u"\nto = "axis.tau"\n[record]\nsignals = { q = "axis.q" }\n'
    )
    assert cosim.show(tmp_path / "push.toml").tables["proven for"][0]["proven"] == "-0.1 to 0.1 m/s"
    assert "axis.v leaves the range" in cosim.run(tmp_path / "push.toml").statistics["outside"][0]
    told = identified_as("improved", {"version": "1", **origin}, b"")
    facts = cosim.show(export_fmu(card.plant().model(), tmp_path / "a.fmu", related=told)).facts
    assert facts["proven for"] == "speed -0.1 to 0.1 m/s; load 0 to 1 1"
    assert "meta-data" in facts["brings along"]


def test_what_is_no_range_is_no_domain():
    assert domains_of("all") == ()
    assert domains_of({"a": {"low": "x", "high": "1"}, "b": 3, "c": {"low": 2, "high": 1}, "d": {"low": 0}}) == ()
    assert [one.name for one in domains_of({"e": {"low": "0", "high": "1"}})] == ["e"]


@pytest.mark.parametrize(
    ("value", "is_outside"),
    [(-2.0, False), (6.0, False), (-2.0 - 4e-9, False), (6.0 + 4e-9, False), (-2.0 - 2e-8, True), (6.0 + 2e-8, True)],
)
def test_the_ends_of_a_proven_range_belong_to_it_and_rounding_does_too(value: float, is_outside: bool) -> None:
    """A billionth of the range of 8 may be lost in arithmetic."""
    watched = Proven(PortRef("a.w"), -2.0, 6.0, "rad/s")
    watched.see(np.array([0.0, 0.5]), np.array([0.0, value]))
    assert (watched.first, watched.value) == ((0.5, value) if is_outside else (float("inf"), 0.0))
    assert (watched.least, watched.greatest) == (min(0.0, value), max(0.0, value))


@pytest.mark.parametrize(("values", "farthest"), [([-2.5, 0.0, 9.0], "9"), ([6.5, 0.0, -7.0], "-7"), ([6.5, 8.0], "8")])
def test_the_value_farthest_outside_is_told_on_whichever_side_the_range_was_left_first(values, farthest) -> None:
    watched = Proven(PortRef("a.w"), -2.0, 6.0, "rad/s")
    watched.see(np.arange(float(len(values))), np.array(values))
    assert f"at 0 s: {values[0]} rad/s, proven -2 to 6; at most it is {farthest}." in str(watched)


# Maps of learned terms.

ONE = LearnedTorque(over="position", seen=(-1.0, 1.0), torque=(0.0, 0.2))
TWO = replace(ONE, by="speed", by_seen=(0.0, 2.0), waves=(1, 1), torque=(0.1, 0.0, 0.0, 0.3))


@pytest.fixture
def card(tmp_path: Path) -> Path:
    path = tmp_path / "learned.toml"
    path.write_text(card_text(replace(read_card("paper_mount"), effects=(ONE, TWO), controller=None)))
    return path


def test_a_map_has_the_values_of_the_term_at_its_breakpoints(card: Path) -> None:
    first, second = maps_of(read_card(card))
    np.testing.assert_allclose(first["value"], 0.2 * np.cos(np.pi * (np.array(first["at"]) + 1) / 2), atol=1e-12)
    assert (first["unit"], first["kind"]) == ("N.m", "torque")
    assert np.shape(second["value"]) == (len(second["at"]), len(second["by_at"]))


@pytest.mark.parametrize("content", ["[]", "{", '{"format": "mount-cosim maps 1"}', '{"format": "x", "maps": [1]}'])
def test_a_file_that_only_has_the_name_of_our_maps_draws_nothing(content: str, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.fmu", "w") as archive:
        archive.writestr("extra/maps.json", content)
    assert curves_in(tmp_path / "a.fmu", "extra/maps.json") == []


def test_an_fmu_carries_its_maps_is_shown_with_them_and_stays_valid(card: Path, tmp_path: Path) -> None:
    (path,) = cosim.export(card, tmp_path / "out", fmi=3).fmus
    rows = cosim.show(card).tables["learned maps"]
    assert (rows[0]["curve"][0], rows[0]["curve"][-1], rows[0]["values"]) == ("█", "▁", "-0.2 to 0.2 N.m")
    assert len(rows) == 1 + 5, "the map of two quantities at five values of the second"
    assert "learned maps" not in cosim.show("emps").tables
    assert cosim.show(path).tables["learned maps"] == rows
    assert not validate_fmu(path)
    with zipfile.ZipFile(path) as archive:
        folder = "extra/org.fmi-standard.fmi-ls-ref/"
        told = json.loads(archive.read(f"{folder}maps.json"))
        assert b"maps.json" in archive.read(f"{folder}fmi-ls-manifest.xml")
    assert [one["name"] for one in told["maps"]] == ["learned", "learned2"]


def test_a_map_is_drawn_from_end_to_end_in_one_line() -> None:
    assert curve([2.0, 2.0]) == "▁▁"
    drawn = curve([float(k) for k in range(101)])
    assert len(drawn) == WIDTH
    assert (drawn[0], drawn[-1]) == ("▁", "█")
    assert list(drawn) == sorted(drawn)
