"""The small cases of the net: a diagnosis still gives the stored answers, and computes no more for them."""

import json
from pathlib import Path

import pytest

import cosim
from bench.net.answers import ALIKE, STORED, Answer, differences, of_folder, read
from bench.net.cases import NetCase, home
from bench.net.counts import counted

SMALL = [one for one in home() if one.small and one.name != "home_none_1_none"]
"""Of three machines without anything two: the third is asked by `python -m bench.net check --small`."""
MORE = 1.1
"""Growth of a count at which the test fails: a cost that nobody sees on a machine that is busy anyhow."""


def stored_counts() -> dict[str, dict[str, int]]:
    return dict(json.loads((STORED / "counts.json").read_text("utf-8")))


def diagnosed(case: NetCase, folder: Path) -> tuple[Answer, dict[str, int]]:
    """The answer to a case, and what it took."""
    folder.mkdir()
    case.write(folder)
    train, heldout = ([folder / one for one in names] for names in (case.train, case.heldout))
    with counted() as counts:
        cosim.diagnose(train, heldout, folder / case.card, folder / "out", quick=True)
    return of_folder(folder / "out"), counts.as_json()


@pytest.mark.parametrize("case", SMALL, ids=[one.name for one in SMALL])
def test_a_small_case_has_its_stored_answer_and_costs_no_more(case: NetCase, tmp_path: Path) -> None:
    stored = read(case)
    assert stored, "python -m bench.net record --small"
    found, counts = diagnosed(case, tmp_path / "case")
    assert not differences(stored, found, ALIKE)
    known = stored_counts()[case.name]
    grown = {name: (known[name], many) for name, many in counts.items() if many > MORE * known[name]}
    assert not grown, "more than was stored; if that is meant: python -m bench.net counts"


def test_a_change_of_an_answer_is_seen() -> None:
    stored = read(SMALL[0])
    assert stored
    assert not differences(stored, stored)
    assert differences(stored, stored | {"verdict": ["delay"]})
    card = {name: value * 1.02 for name, value in stored["card"].items()}
    assert differences(stored, stored | {"card": card}, ALIKE)
