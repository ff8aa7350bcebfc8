"""A run, a sweep and a system say where a model is proven, and the first time and variable at which it is left."""

import shutil
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cosim
from cosim.fmi.domain import KEY, Domain, domains_of, entries_of
from cosim.master.proven import Proven
from cosim.master.session import OutsideProvenRangeWarning
from cosim.system.ports import PortRef
from pyfmi_models.card import read_card
from pyfmi_models.card_writer import card_text
from pyfmi_models.export import export_fmu
from pyfmi_models.export.related import identified, references

SCENARIO = """
step = 1e-2
stop = 2.0
[components.a]
fmu = "proven.fmu"
variables = { speed = "w" }
[components.b]
fmu = "proven.fmu"
[signals.u]
kind = "ramp"
velocity = 2.0
unit = "A"
[[connections]]
from = "u.position"
to = "a.i"
[[connections]]
from = "u.position"
to = "b.i"
gain = 0.5
[record]
signals = { phi = "a.phi" }
"""


@pytest.fixture(scope="module")
def folder(fmu, tmp_path_factory) -> Path:
    """A motor that is proven for speeds up to 60 rpm and currents of 3 A, and a system of two of them."""
    folder = tmp_path_factory.mktemp("proven")
    domains = (Domain("speed", -60.0, 60.0, "rpm", "w"), Domain("i", -3.0, 3.0, "A"), Domain("dust", 0, 1, "1"))
    files = references(identified("motor", {KEY: entries_of(domains)}, b""))
    shutil.copy(fmu, folder / "proven.fmu")
    with zipfile.ZipFile(folder / "proven.fmu", "a") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    (folder / "system.toml").write_text(SCENARIO)
    return folder


def test_a_run_says_the_first_time_and_variable(folder):
    done = cosim.run(folder / "system.toml")
    outside = done.statistics["outside"]
    assert [one.split(" leaves")[0] for one in outside] == ["a.speed", "a.i"], "the first one first"
    current = next(one for one in outside if one.startswith("a.i"))
    assert "a is proven at 1.51 s: 3.02 A, proven -3 to 3; at most it is 3.98" in current
    speed = next(one for one in outside if one.startswith("a.speed"))
    assert "proven -6.283 to 6.283" in speed
    assert outside[0] in str(done)
    assert list(done.recording.columns) == ["t", "phi"], "nothing more is recorded"
    assert cosim.run(folder / "system.toml", stop=0.5).statistics["outside"] == [], "within it nothing is said"


def test_a_system_in_hand_says_it_while_it_is_stepped_and_warns_at_the_end(folder):
    def stepped():
        with cosim.open(folder / "system.toml") as s:
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


def test_a_sweep_says_which_run_leaves_it_first(folder, tmp_path):
    (folder / "sweep.toml").write_text(
        'scenario = "system.toml"\n[vary]\n"u.velocity" = [0.1, 2.0, 4.0]\n'
        '[statistics]\nend = { signal = "phi", kind = "final" }\n'
    )
    done = cosim.sweep(folder / "sweep.toml", tmp_path / "out", workers=1)
    assert done.summary.outside == 2
    assert "2 runs left what is proven; run 1: a.speed leaves the range in which a is proven at " in str(done)
    reasons = done.frame()["reason"].tolist()
    assert [bool(one) for one in reasons] == [False, True, True]
    assert done.frame()["status"].tolist() == ["ok"] * 3


def test_ranges_of_a_system_are_intersected_where_one_signal_feeds_both(folder):
    rows = {row["signal"]: row for row in cosim.show(folder / "system.toml").tables["proven for"]}
    assert rows["u.position"] == {"signal": "u.position", "proven": "-3 to 3 A", "for": "a, b"}, "b allows 6 A of it"
    assert rows["a.speed"]["proven"] == "-60 to 60 rpm"


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
    told = identified("improved", {"version": "1", **origin}, b"")
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
