"""The page of a comparison: by axe, on a phone, in the dark."""

from pathlib import Path
from typing import Any

from browsing import browser, check_by_axe
from test_compare import table

import cosim

__all__ = ["browser"]


def test_axe_finds_nothing_in_the_page_of_a_comparison(browser: Any, tmp_path: Path) -> None:
    cosim.compare(table(500.0), table(200.0, 15.0, 2.0, extra=0.25), out=tmp_path / "out")
    check_by_axe(browser, (tmp_path / "out" / "compare.html").read_text("utf-8"), tmp_path)
