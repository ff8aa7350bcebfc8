"""Tapes of structures are derived once and found on the disk from then on, and a cache that fails is none."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from cosim.estimation import tape_cache
from cosim.estimation.equations import Equations
from pyfmi_models.effects import Cogging
from pyfmi_models.friction import LuGre
from pyfmi_models.mount import Axis, Mount

LAW = LuGre(Fc=2.0, Fs=2.4, Vs=0.05, sigma0=5e3, sigma1=20.0, sigma2=1.5)
MOUNT = Mount(name="axis", axis=Axis(inertia=5.0), friction=LAW, effects=(Cogging(cycles_per_rev=12, amplitude=0.3),))
FREE = ("friction.Fc", "axis.inertia")


@pytest.fixture(autouse=True)
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(tmp_path / "cache"))
    tape_cache._folder.cache_clear()
    yield tmp_path / "cache"
    tape_cache._folder.cache_clear()


def evaluated(mount: Mount = MOUNT) -> list[np.ndarray]:
    """Torque and state of a structure at some rows, from expressions that are not in memory."""
    equations = Equations(mount, FREE, ("a structure", *map(type, mount.components().values())))
    columns = [np.linspace(0, 1, 50) + k for k in range(9)]
    numbers = np.array([variable.start for variable in mount.parameters()])
    return [
        equations.torque(columns[:6], numbers),
        *(one.rows([*columns, columns[0]], numbers) for one in equations._affine),
    ]


def test_what_is_on_the_disk_gives_the_same_bits(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = evaluated()
    files = {path: path.stat().st_mtime_ns for path in folder.rglob("*.tape")}
    assert files
    monkeypatch.setattr(Equations, "_symbols", property(lambda _: pytest.fail("it was derived again")))
    assert all(np.array_equal(*both) for both in zip(first, evaluated(), strict=True))
    assert files == {path: path.stat().st_mtime_ns for path in folder.rglob("*.tape")}


@pytest.mark.parametrize("damage", [b"", b"no tape", b"\xe9\x00\x00"])
def test_a_damaged_file_is_made_again(folder: Path, damage: bytes) -> None:
    first = evaluated()
    for path in folder.rglob("*.tape"):
        path.write_bytes(damage)
    assert all(np.array_equal(*both) for both in zip(first, evaluated(), strict=True))
    assert all(path.read_bytes() != damage for path in folder.rglob("*.tape"))


def test_a_folder_with_too_many_begins_anew(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = evaluated()
    old = sorted(folder.rglob("*.tape"))
    for path in old:
        path.rename(path.with_stem(f"another {path.stem}"))
    tape_cache._folder.cache_clear()
    monkeypatch.setattr(tape_cache, "MOST", 1)
    assert all(np.array_equal(*both) for both in zip(first, evaluated(), strict=True))
    assert sorted(folder.rglob("*.tape")) == old


def test_a_folder_that_cannot_be_made_is_done_without(folder: Path) -> None:
    folder.write_text("a file is in its place", "utf-8")
    assert np.isfinite(evaluated()[0]).all()


@dataclass(frozen=True)
class OwnRipple(Cogging):
    """An effect from a file of the user, whose equations may change."""


def test_an_effect_of_the_users_own_is_not_stored(folder: Path) -> None:
    evaluated(Mount(name="axis", axis=MOUNT.axis, friction=LAW, effects=(OwnRipple(cycles_per_rev=12, amplitude=0.3),)))
    assert not list(folder.rglob("*.tape"))
