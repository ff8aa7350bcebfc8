"""An option of `cosim identify` that goes with another kind of model is refused, not passed over."""

from pathlib import Path

import pytest

import cosim
from cosim.cli import main
from cosim.support.errors import InputError

CARD = '[mount]\ninertia = 1.0\n[friction]\nmodel = "coulomb"\nFc = 0.7\nsigma2 = 2.0\n'


@pytest.mark.parametrize("option", ["--cluster host:1", "--window 3", "--heldout b.csv", "--set a=1", "--workers 2"])
def test_a_card_takes_no_option_of_an_fmu(option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "card.toml").write_text(CARD, "utf-8")
    given = ["identify", "a.csv", "--card", str(tmp_path / "card.toml"), "--out", str(tmp_path / "out")]
    with pytest.raises(SystemExit, match="2"):
        main([*given, *option.split()])
    assert f"{option.split()[0]} goes with an FMU or a system alone; leave it out." in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_fmu_takes_no_option_of_a_card(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["identify", "a.csv", "--fmu", "theirs.fmu", "--free", "k", "--cut", "2"])
    assert "--cut goes with a card alone; leave it out." in capsys.readouterr().err


def test_so_does_the_call() -> None:
    with pytest.raises(InputError, match="cluster: of an FMU or a system, not of a card"):
        cosim.identify("a.csv", "card.toml", cluster="tcp://host:8786")  # type: ignore[call-overload]
    with pytest.raises(TypeError, match="'clutser'"):
        cosim.identify("a.csv", "card.toml", clutser="tcp://host:8786")  # type: ignore[call-overload]
