"""The pages about the house say what the code says."""

import re
from pathlib import Path

from architecture import MARK, PAGE, direct, drawn

GLOSSARY = (Path(__file__).parents[2] / "docs" / "glossary.md").read_text("utf-8")


def test_the_pictures_are_those_of_the_code() -> None:
    page = PAGE.read_text("utf-8")
    assert [found[2] for found in MARK.finditer(page)] == ["folders", "cosim.system", "cosim.master"]
    assert drawn(page) == page, "python tests/house/architecture.py draws them again"


def test_an_arrow_that_a_longer_way_says_is_left_out() -> None:
    assert direct({"c": {"a", "b"}, "b": {"a"}, "a": set()}) == {"c": {"b"}, "b": {"a"}, "a": set()}


def test_the_table_of_folders_names_every_folder() -> None:
    page = PAGE.read_text("utf-8")
    there = {path.parent.name for path in (PAGE.parents[1] / "cosim").glob("*/__init__.py")}
    told = {name for row in re.findall(r"^\| (`.*?) \|", page, re.MULTILINE) for name in re.findall(r"`(\w+)`", row)}
    assert told == there


def test_the_glossary_holds_every_term_once_in_the_order_of_the_alphabet() -> None:
    terms = [one.casefold() for one in re.findall(r"^\*\*(.+?)\*\*", GLOSSARY, re.MULTILINE)]
    assert len(terms) > 30
    assert terms == sorted(set(terms))
