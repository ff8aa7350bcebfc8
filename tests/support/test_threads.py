"""Calls from Python give linear algebra one thread, and leave the process as it was."""

import os

import numpy  # noqa: F401 brings linear algebra along
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import cosim
from cosim.cli import set_libraries
from cosim.support.threads import VARIABLES, in_one_thread


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
