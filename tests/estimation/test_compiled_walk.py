"""A walk by compiled code: the bits of the interpreted one, compiled once, and without a compiler the same."""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from cosim.estimation import compiled
from cosim.estimation.compiled import CompiledWalk
from cosim.estimation.play import _walk
from cosim.estimation.rowwise import Stepwise
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.errors import ExportError
from pyfmi_models.model import fields_of

PLAY = Backlash(gap_rad=1e-3, load_friction=0.3, load_viscous=0.1)
FIELDS = fields_of(PLAY)
NUMBERS = np.array([5.0, *(getattr(PLAY, name) for name in FIELDS)])


def moved(rows: int = 5_000) -> np.ndarray:
    """Speeds [rad/s] before and after each step, and its length [s]."""
    speed = np.cumsum(np.random.default_rng(7).normal(size=rows + 1)) * 1e-3
    return np.vstack([speed[:-1], speed[1:], np.full(rows, 1e-3)])


def test_a_compiled_walk_has_the_bits_of_the_interpreted_one() -> None:
    walk = _walk(Backlash, FIELDS)
    (found,) = walk(moved(), NUMBERS[None])
    assert walk._compiled is not None
    assert np.array_equal(found, Stepwise(*walk._expressions)(moved(), NUMBERS))
    assert np.abs(found).max(axis=1).min() > 0


def test_several_sets_of_numbers_at_once_have_the_bits_of_each_alone() -> None:
    walk, sets = _walk(Backlash, FIELDS), np.array([NUMBERS, 2 * NUMBERS, 0.5 * NUMBERS])
    found = walk(moved(), sets)
    assert found.shape == (3, 4, 5_001)
    assert all(np.array_equal(one, walk(moved(), own[None])[0]) for one, own in zip(found, sets, strict=True))
    assert not np.array_equal(found[0], found[1])


def test_a_walk_over_columns_that_are_not_in_one_piece_of_memory() -> None:
    walk = _walk(Backlash, FIELDS)
    assert np.array_equal(walk(np.asfortranarray(moved()), NUMBERS[None]), walk(moved(), NUMBERS[None]))


def test_a_walk_over_no_rows_is_its_start() -> None:
    assert np.array_equal(_walk(Backlash, FIELDS)(moved()[:, :0], NUMBERS[None]), np.zeros((1, 4, 1)))


def decaying() -> CompiledWalk:
    """x[k+1] = p x[k] + u[k]."""
    x, u, p = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("p")
    return CompiledWalk(x, u, p, p * x + u)


def test_without_a_compiler_the_walk_is_interpreted(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> Path:
        raise ExportError("there is no C compiler")

    monkeypatch.setattr(compiled, "compile_shared", fails)
    walk = decaying()
    assert walk._compiled is None
    found = walk(np.array([[1.0, 0.0, 1.0]]), np.array([[0.5], [0.0]]))
    assert found.tolist() == [[[0.0, 1.0, 0.5, 1.25]], [[0.0, 1.0, 0.0, 1.0]]]


def test_a_damaged_library_in_the_cache_is_done_without(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    damaged = tmp_path / "walk.so"
    damaged.write_bytes(b"no library")
    monkeypatch.setattr(compiled, "compile_shared", lambda *_: damaged)
    assert decaying()(np.ones((1, 2)), np.array([[0.0]])).tolist() == [[[0.0, 1.0, 1.0]]]


def test_what_is_compiled_is_found_again(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(tmp_path))
    first, again = decaying(), decaying()
    walked = [one(np.ones((1, 2)), np.array([[0.5]])).tolist() for one in (first, again)]
    assert walked[0] == walked[1]
    assert len(list(tmp_path.glob("libraries/*/walk*"))) == 1
