"""The gallery of machines: at least six measured ones, each with picture, verdict, what is known and a licence."""

import re
from pathlib import Path

import pytest
from plain_words import unplain

DOCS = Path(__file__).parents[2] / "docs"
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
