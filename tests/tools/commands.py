"""Commands as a person gives them: in this process or in another, with a cache of their own and a small scenario."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from small_loop import TEXT

import cosim.models.cache
from cosim.cli import main

Refused = Callable[..., str]
ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(cosim.models.cache.__file__).parents[2]), "NO_COLOR": "1"}


@pytest.fixture
def scenario(tiny: dict[int, Path], tmp_path: Path) -> Path:
    path = tmp_path / "loop.toml"
    path.write_text(TEXT.replace('"tiny', f'"{tiny[2].parent}/tiny'))
    return path


@pytest.fixture(autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    home = tmp_path_factory.mktemp("cache")
    monkeypatch.setattr(cosim.models.cache, "_home", lambda: home)
    return home


def call(*arguments: object) -> int:
    with pytest.raises(SystemExit) as left:
        main([str(argument) for argument in arguments])
    return int(left.value.code or 0)


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Refused:
    """A command that is refused, without a word on stdout: call it with its words; what it says."""

    def asked(*words: object) -> str:
        capsys.readouterr()
        assert call(*words) == 2
        said = capsys.readouterr()
        assert said.out == ""
        return said.err

    return asked


def python(*words: str, folder: Path | None = None, **more: str) -> "subprocess.CompletedProcess[str]":
    """Run Python in a process of its own, where a folder is the current one and some variables are set."""
    command = [sys.executable, *words]
    return subprocess.run(command, env=ENVIRONMENT | more, cwd=folder, capture_output=True, text=True, check=False)
