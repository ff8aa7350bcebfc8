"""What was found of an object goes with it; calls give linear algebra one thread and leave all as it was."""

import gc
import os
from weakref import ref

import numpy  # noqa: F401 brings linear algebra along
import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits
from wandering import recorded, wander

import cosim
from cosim.cli import set_libraries
from cosim.diagnosis.effects.delay_and_lag import reading_lag
from cosim.estimation.discrepancy_basis import discrepancy_basis
from cosim.estimation.play import torques_of_grid
from cosim.estimation.prepare import prepare
from cosim.support.kept import kept_with
from cosim.support.threads import VARIABLES, in_one_thread


class Thing:
    """Something that may be forgotten."""


def test_only_what_was_asked_last_is_kept_and_all_of_it_goes_with_its_object() -> None:
    asked = []

    @kept_with(most=2)
    def find(of: Thing, number: int) -> Thing:
        asked.append(number)
        return Thing()

    one, other = Thing(), Thing()
    first = find(one, 1)
    assert find(one, 2) is not first
    assert find(one, 1) is first
    find(one, 3)
    assert find(one, 1) is first, "it was asked for last but one"
    find(one, 2)
    find(other, 2)
    assert find(other, number=3) is find(other, number=3) is not find(other, 2), "a name is asked for too"
    assert asked == [1, 2, 3, 2, 2, 3]
    there = ref(first)
    del one, first
    gc.collect()
    assert there() is None


def test_no_recording_outlives_its_diagnosis() -> None:
    t, q, _, a = wander(4.0)
    prepared = prepare([recorded(a, t, q)], 30.0)
    stops, _ = discrepancy_basis(prepared)
    assert discrepancy_basis(prepared)[0] is stops
    assert reading_lag(prepared) is None
    assert np.isfinite(torques_of_grid(prepared, ((1e-3, 0.1),), 0.0)).all()
    there = ref(prepared)
    del prepared
    gc.collect()
    assert there() is None


# Calls from Python give linear algebra one thread, and leave the process as it was.


def threads() -> set[int]:
    """In how many threads the loaded libraries of linear algebra work."""
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def _three_threads(monkeypatch: pytest.MonkeyPatch) -> object:
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    with threadpool_limits(3, "blas"):
        yield


def test_a_call_works_in_one_thread_and_gives_the_others_back_when_it_fails() -> None:
    @in_one_thread
    def fails() -> None:
        assert threads() == {1}
        raise KeyError

    with pytest.raises(KeyError):
        fails()
    assert threads() == {3}


def test_the_environment_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    assert in_one_thread(threads)() == {3}


@pytest.mark.parametrize(("given", "threads"), [({}, "1"), ({"OPENBLAS_NUM_THREADS": "3"}, "3")])
def test_the_command_has_one_thread_unless_told(
    given: dict[str, str], threads: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "environ", os.environ | given)  # what is set here ends here
    set_libraries()
    assert os.environ["OPENBLAS_NUM_THREADS"] == threads


def test_a_diagnosis_and_a_first_card_from_python_have_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []

    def reads(*_: object) -> None:
        seen.append(threads())
        raise InterruptedError

    monkeypatch.setattr("cosim.api.diagnose._read", reads)
    monkeypatch.setattr("cosim.api.card.read_all", reads)
    for call in (cosim.diagnose, cosim.card):
        with pytest.raises(InterruptedError):
            call(["run.csv"])
    assert seen == [{1}, {1}]
