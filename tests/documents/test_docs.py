"""The documentation says of every effect, machine and promise what a reader needs, and what its pages draw is so."""

import importlib.util
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from effect_examples import FORMS
from plain_words import unplain

from cosim.diagnosis.effects import TRIED
from pyfmi_models.effects import CATALOGUE

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = "card recording_data report theory decision glossary reading scenarios fmus other_tools hardware api"


def page(name: str) -> str:
    return (DOCS / f"{name}.md").read_text("utf-8")


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A file of the documentation as a module."""
    monkeypatch.setattr(sys, "path", [str(DOCS), *sys.path])

    def loaded(name: str) -> Any:
        spec = importlib.util.spec_from_file_location(Path(name).stem, DOCS / f"{name}.py")
        spec.loader.exec_module(module := importlib.util.module_from_spec(spec))
        return module

    return loaded


@pytest.fixture
def gallery(script: Any) -> Any:
    return script("gallery")


@pytest.mark.parametrize("name", sorted(TRIED))
def test_every_effect_has_equation_words_advice_and_literature_once(gallery: Any, name: str) -> None:
    for form in CATALOGUE[name]:
        said, literature = gallery.described(form)
        assert said
        assert form.equation
        assert form.action
    last = [form for form in FORMS if form.id == name][-1]
    assert literature or gallery.LITERATURE[name]
    assert not (name in gallery.LITERATURE and gallery.described(last)[1]), "told twice"


def test_the_gallery_has_two_pictures_checks_and_repairs_of_each_effect(gallery: Any, tmp_path: Path) -> None:
    gallery.write_gallery(tmp_path)
    text = (tmp_path / "effects.md").read_text("utf-8")
    for name in TRIED:
        drawn = (tmp_path / f"{name}.svg").read_text("utf-8")
        assert drawn.count("<path") + drawn.count("<use") + drawn.count("<circle") + drawn.count("<polyline") > 5
        part = text.split(f"\n({name})=\n")[1].split("\n(")[0]
        assert f"{{figure}} {name}.svg" in part
        assert len(re.findall(r"^[123]\. ", part, re.M)) == 3
        assert len(re.findall(r"^   - .+: .+\.$", part, re.M)) >= 6
        assert "| Machine | Repair |" in part
        assert f'<a href="#{name}"><img src="../_images/{name}.svg"' in text


def test_the_gallery_lists_the_effects_that_a_diagnosis_does_not_look_for(gallery: Any) -> None:
    assert set(gallery.LITERATURE) <= set(TRIED)
    text = "\n".join(gallery.of_cards_alone())
    assert "A diagnosis does not look for them yet" in text
    assert set(re.findall(r"^`(\w+)`, ", text, re.M)) == set(CATALOGUE) - set(TRIED)
    assert text.count("*Literature:* Wen") == 1


def test_the_index_leads_to_every_page_that_is_there() -> None:
    listed = set(re.findall(r"^([a-z_/]+)$", page("index"), re.M))
    assert {*PAGES.split(), "architecture"} <= listed
    assert all((DOCS / f"{name}.md").exists() for name in listed if not name.startswith("_generated"))


@pytest.mark.parametrize(("where", "up"), [("index", ""), ("_generated/effects", "../")])
def test_links_out_of_the_folder_are_said_as_paths(script: Any, where: str, up: str) -> None:
    source = [f"of [the report]({up}report.md), in [results]({up}../results/a.md#b)"]
    script("conf").inside_the_site(None, where, source)
    assert source == [f"of [the report]({up}report.md), in results (`results/a.md` in the source)"]


def test_the_pictures_of_the_architecture_are_those_of_the_code(script: Any) -> None:
    drawing = script("architecture")
    assert drawing.direct({"c": {"a", "b"}, "b": {"a"}, "a": set()}) == {"c": {"b"}, "b": {"a"}, "a": set()}
    shown = page("architecture")
    assert [found[2] for found in drawing.MARK.finditer(shown)] == ["folders", "cosim.system", "cosim.master"]
    assert drawing.drawn(shown) == shown, "python docs/architecture.py draws them again"


def test_the_table_of_folders_names_every_folder() -> None:
    rows = re.findall(r"^\| (`.*?) \|", page("architecture"), re.MULTILINE)
    told = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    assert told == {path.parent.name for path in (ROOT / "cosim").glob("*/__init__.py")}


def test_the_glossary_holds_every_term_once_in_the_order_of_the_alphabet() -> None:
    terms = [one.casefold() for one in re.findall(r"^\*\*(.+?)\*\*", page("glossary"), re.MULTILINE)]
    assert len(terms) > 30
    assert terms == sorted(set(terms))


def test_every_promise_names_tests_that_there_are() -> None:
    rows = [one for one in page("promises").splitlines() if one.startswith("| ") and "| tests |" not in one]
    files = {one.name: one for folder in ("tests", "bench/tests") for one in (ROOT / folder).rglob("test_*.py")}
    assert rows
    for row in rows:
        promise, tests = row.strip("| ").split(" | ")
        named = re.findall(r"`(test_\w+\.py)::(test_\w+)`", tests)
        assert named or "`.ci/" in tests, promise
        for file, name in named:
            assert f"\ndef {name}(" in files[file].read_text("utf-8"), (file, name)


# The gallery of machines: at least six measured ones, each with picture, verdict, what is known and a licence.

MACHINES = page("machines")
SECTIONS = dict(re.findall(r"^\((\w+)\)=\n(.*?)(?=^\(\w+\)=|\Z)", MACHINES, re.DOTALL | re.MULTILINE))
LARGEST = 60_000
"""Bytes of a picture."""


@pytest.mark.parametrize("name", SECTIONS)
def test_a_machine_has_a_verdict_errors_a_picture_and_a_small_one_that_leads_to_it(name: str) -> None:
    text, picture = SECTIONS[name], DOCS / "machines" / f"{name}.png"
    assert picture.stat().st_size < LARGEST
    assert f"](machines/{name}.png)" in text
    assert f"machines/{name}.png)" in MACHINES.split("(brushless_motor)=")[0]
    assert f"](#{name})" in MACHINES
    assert re.search(r"^\*\*.+\*\*$", text, re.MULTILINE)
    for word in ("*Validation error:*", "*Known of it:*"):
        assert word in text
    licence = re.search(r"\b(MIT|BSD 3-Clause|Apache 2\.0)\b", text)
    assert licence if "*Measured.*" in text else "*Generated from published numbers.*" in text
    assert not unplain(text)


def test_six_machines_are_measured_and_no_other_picture_or_recording_lies_beside_them() -> None:
    assert sum("*Measured.*" in text for text in SECTIONS.values()) >= 6
    assert {path.name for path in (DOCS / "machines").iterdir()} == {f"{name}.png" for name in SECTIONS}


def test_your_own_axis_is_diagnosed(script: Any) -> None:
    assert script("scripts/diagnose_your_axis").main() == ("cogging",)


def test_your_fmu_runs_beside_the_controller_of_a_card(script: Any) -> None:
    assert script("scripts/cosimulate_your_fmu").main() <= 0.01  # arcsec; the encoder has counts of 0.0003


def test_a_controller_is_designed_within_its_limits_and_proven_with_friction(script: Any) -> None:
    design = script("scripts/design_a_controller")
    chosen, before, after = design.main()
    phase, noise = design.limits(design.tuned(design.read_card("paper_mount"), chosen))
    assert phase >= design.LEAST
    assert noise <= design.MOST
    assert design.BANDWIDTHS[0] < chosen < design.BANDWIDTHS[-1]
    assert after <= before / 2
