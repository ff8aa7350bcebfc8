"""What cannot end well is refused before any work is done."""

from pathlib import Path

import pytest
from commands import call

import cosim
from cosim.support.errors import InputError, OutputError
from cosim.support.files import check_free


def test_what_is_no_folder_in_the_place_of_one_is_told_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file", "utf-8")
    with pytest.raises(OutputError, match=r"The directory .*taken cannot be made: .*taken is a file\."):
        check_free(tmp_path / "taken" / "card.toml", force=True)
    with pytest.raises(OutputError, match=r"The directory /dev/null/paper cannot be made: /dev/null is no folder\."):
        check_free(Path("/dev/null/paper/README.md"), force=True)


@pytest.mark.parametrize(
    "words", [["serve", "--port", "99999"], ["identify", "run.csv", "--card", "emps", "--out", "x", "--cut", "-1"]]
)
def test_numbers_out_of_range_are_refused_with_their_range(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(*words) == 2
    assert words[-2] in capsys.readouterr().err


# An option of `cosim identify` that goes with another kind of model is refused, not passed over.

CARD = '[mount]\ninertia = 1.0\n[friction]\nmodel = "coulomb"\nFc = 0.7\nsigma2 = 2.0\n'


@pytest.mark.parametrize("option", ["--cluster host:1", "--window 3", "--heldout b.csv", "--set a=1", "--workers 2"])
def test_a_card_takes_no_option_of_an_fmu(option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "card.toml").write_text(CARD, "utf-8")
    given = ["identify", "a.csv", "--card", str(tmp_path / "card.toml"), "--out", str(tmp_path / "out")]
    assert call(*given, *option.split()) == 2
    assert f"{option.split()[0]} goes with an FMU or a system alone; leave it out." in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_fmu_takes_no_option_of_a_card(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("identify", "a.csv", "--fmu", "theirs.fmu", "--free", "k", "--cut", "2") == 2
    assert "--cut goes with a card alone; leave it out." in capsys.readouterr().err


def test_so_does_the_call() -> None:
    with pytest.raises(InputError, match="cluster: of an FMU or a system, not of a card"):
        cosim.identify("a.csv", "card.toml", cluster="tcp://host:8786")  # type: ignore[call-overload]
    with pytest.raises(TypeError, match="'clutser'"):
        cosim.identify("a.csv", "card.toml", clutser="tcp://host:8786")  # type: ignore[call-overload]
