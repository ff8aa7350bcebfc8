"""The documentation site says of every effect what a reader needs, and has a page for every subject."""

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

DOCS = Path(__file__).parents[2] / "docs"
PAGES = (
    "card recording_data report theory decision glossary reading scenarios fmus other_tools hardware api architecture"
)


@pytest.fixture(scope="module")
def gallery() -> Any:
    sys.path.insert(0, str(DOCS))
    try:
        yield importlib.import_module("gallery")
    finally:
        sys.path.remove(str(DOCS))


def loaded(path: Path) -> Any:
    """A file of the documentation as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec
    assert spec.loader
    spec.loader.exec_module(module := importlib.util.module_from_spec(spec))
    return module


@pytest.fixture
def site(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(sys, "path", [*sys.path])
    return loaded(DOCS / "conf.py")


@pytest.mark.parametrize("name", sorted(TRIED))
def test_every_effect_has_equation_words_advice_and_literature(gallery: Any, name: str) -> None:
    for form in CATALOGUE[name]:
        said, literature = gallery.described(form)
        assert said
        assert form.equation
        assert form.action
    assert literature or gallery.LITERATURE[name]


def test_the_gallery_has_a_picture_checks_and_repairs_of_each_effect_and_a_small_picture_that_leads_there(
    gallery: Any, tmp_path: Path
) -> None:
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


def test_no_literature_is_told_twice(gallery: Any) -> None:
    assert set(gallery.LITERATURE) <= set(TRIED)
    last = {form.id: form for form in FORMS if form.id in TRIED}
    assert [name for name in gallery.LITERATURE if gallery.described(last[name])[1]] == []


def test_the_gallery_lists_the_effects_that_a_diagnosis_does_not_look_for(gallery: Any) -> None:
    text = "\n".join(gallery.of_cards_alone())
    assert "A diagnosis does not look for them yet" in text
    assert set(re.findall(r"^`(\w+)`, ", text, re.M)) == set(CATALOGUE) - set(TRIED)
    assert text.count("*Literature:* Wen") == 1


def test_the_index_leads_to_every_page_that_is_there() -> None:
    index = (DOCS / "index.md").read_text("utf-8")
    listed = set(re.findall(r"^([a-z_/]+)$", index, re.M))
    assert {*PAGES.split()} <= listed
    assert all((DOCS / f"{name}.md").exists() for name in listed if not name.startswith("_generated"))


def test_links_out_of_the_folder_are_said_as_paths(site: Any) -> None:
    text = ["see [results](../results/a.md#b) and [x](y.md)"]
    site.inside_the_site(None, "index", text)
    assert text == ["see results (`results/a.md` in the source) and [x](y.md)"]
    text = ["of [the report](../report.md), in [results](../../results/a.md)"]
    site.inside_the_site(None, "_generated/effects", text)
    assert text == ["of [the report](../report.md), in results (`results/a.md` in the source)"]


# The gallery of machines: at least six measured ones, each with picture, verdict, what is known and a licence.

PAGE = (DOCS / "machines.md").read_text("utf-8")
SECTIONS = dict(re.findall(r"^\((\w+)\)=\n(.*?)(?=^\(\w+\)=|\Z)", PAGE, re.DOTALL | re.MULTILINE))
LARGEST = 60_000
"""Bytes of a picture."""


def test_six_machines_are_measured_and_their_licence_is_stated() -> None:
    measured = {name: text for name, text in SECTIONS.items() if "*Measured.*" in text}
    assert len(measured) >= 6
    for name, text in measured.items():
        assert re.search(r"\b(MIT|BSD 3-Clause|Apache 2\.0)\b", text), name
    assert all("*Generated from published numbers.*" in text for name, text in SECTIONS.items() if name not in measured)


@pytest.mark.parametrize("name", SECTIONS)
def test_a_machine_has_a_verdict_errors_a_picture_and_a_small_one_that_leads_to_it(name: str) -> None:
    text, picture = SECTIONS[name], DOCS / "machines" / f"{name}.png"
    assert picture.stat().st_size < LARGEST
    assert f"](machines/{name}.png)" in text
    assert f"machines/{name}.png)" in PAGE.split("(brushless_motor)=")[0]
    assert f"](#{name})" in PAGE
    assert re.search(r"^\*\*.+\*\*$", text, re.MULTILINE)
    for word in ("*Validation error:*", "*Known of it:*"):
        assert word in text
    assert not unplain(text)


def test_no_picture_is_of_a_machine_that_the_page_lacks_and_no_recording_lies_beside_them() -> None:
    assert {path.name for path in (DOCS / "machines").iterdir()} == {f"{name}.png" for name in SECTIONS}


# docs/promises.md names tests that there are.

TESTS = Path(__file__).parents[1]
PROMISES = TESTS.parent / "docs" / "promises.md"


def test_every_promise_names_tests_that_there_are() -> None:
    rows = [one for one in PROMISES.read_text("utf-8").splitlines() if one.startswith("| ") and "| tests |" not in one]
    assert rows
    for row in rows:
        promise, tests = row.strip("| ").split(" | ")
        named = re.findall(r"`(test_\w+\.py)::(test_\w+)`", tests)
        assert named or "`.ci/" in tests, promise
        for file, name in named:
            assert f"\ndef {name}(" in next(TESTS.rglob(file)).read_text("utf-8"), (file, name)


# The scripts of the documentation do what they say.


def script(name: str) -> Any:
    return loaded(DOCS / "scripts" / f"{name}.py")


def test_your_own_axis_is_diagnosed() -> None:
    assert script("diagnose_your_axis").main() == ("cogging",)


def test_your_fmu_runs_beside_the_controller_of_a_card() -> None:
    assert script("cosimulate_your_fmu").main() <= 0.01  # arcsec; the encoder of the card has counts of 0.0003


def test_a_controller_is_designed_within_its_limits_and_proven_with_friction() -> None:
    design = script("design_a_controller")
    chosen, before, after = design.main()
    phase, noise = design.limits(design.tuned(design.read_card("paper_mount"), chosen))
    assert phase >= design.LEAST
    assert noise <= design.MOST
    assert design.BANDWIDTHS[0] < chosen < design.BANDWIDTHS[-1]
    assert after <= before / 2
