"""The small cases of the net: the diagnosis still gives the stored answers."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT))
from bench.net.answers import ALIKE, answered, differences, read  # noqa: E402
from bench.net.cases import NetCase, home  # noqa: E402

SMALL = [one for one in home() if one.small]


@pytest.mark.parametrize("case", SMALL, ids=[one.name for one in SMALL])
def test_a_small_case_has_its_stored_answer(case: NetCase, tmp_path: Path) -> None:
    stored = read(case)
    assert stored, "python -m bench.net record --small"
    found = answered([sys.executable, "-m", "cosim"], case, tmp_path / "case")
    assert not differences(stored, found, ALIKE)


def test_a_change_of_an_answer_is_seen() -> None:
    stored = read(SMALL[0])
    assert stored
    assert not differences(stored, stored)
    assert differences(stored, stored | {"verdict": ["delay"]})
    card = {name: value * 1.02 for name, value in stored["card"].items()}
    assert differences(stored, stored | {"card": card}, ALIKE)
