"""What cannot end well is refused before any work is done."""

from pathlib import Path

import pytest

from cosim.cli import main
from cosim.support.errors import OutputError
from cosim.support.files import check_free


def test_a_file_in_the_place_of_a_folder_is_told_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file", "utf-8")
    with pytest.raises(OutputError, match=r"The directory .*taken cannot be made: .*taken is a file\."):
        check_free(tmp_path / "taken" / "card.toml", force=True)


def test_a_folder_below_what_is_no_folder_is_refused_before_the_work() -> None:
    with pytest.raises(OutputError, match=r"The directory /dev/null/paper cannot be made: /dev/null is no folder\."):
        check_free(Path("/dev/null/paper/README.md"), force=True)


@pytest.mark.parametrize(
    "words",
    [
        ["serve", "--port", "99999"],
        ["identify", "run.csv", "--card", "emps", "--out", "x", "--cut", "-1"],
    ],
)
def test_numbers_out_of_range_are_refused_with_their_range(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    assert words[-2] in capsys.readouterr().err
