"""A signal ends a command wherever it comes, with its exit code and a word."""

import errno
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from commands import call, python

from cosim.cli import guarded, main
from cosim.support.interrupts import end_well


@pytest.fixture
def handlers() -> Iterator[Callable[[], None]]:
    """Take the handlers of a fresh process, as often as it is called; afterwards all is as it was."""
    before = {one: signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM)}

    def fresh() -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)

    yield fresh
    for one, handler in before.items():
        signal.signal(one, handler)
    end_well()


def test_a_signal_that_comes_before_a_verb_begins_is_told_by_the_exit_code(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], handlers: Callable[[], None]
) -> None:
    """Typer takes each KeyboardInterrupt for Ctrl-C."""
    for number, code in ((signal.SIGTERM, 143), (signal.SIGINT, 130)):
        come = partial(signal.raise_signal, number)
        monkeypatch.setattr("typer.core.TyperGroup.parse_args", lambda *_, come=come, **__: come())
        handlers()
        assert call("show", "paper_mount") == code
    assert "cosim: terminated" in capsys.readouterr().err


def caused(error: Exception, cause: BaseException) -> Exception:
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    ("error", "number", "code"),
    [
        (RuntimeError("error building a validator"), signal.SIGINT, 130),
        (RuntimeError("error building a validator"), signal.SIGTERM, 143),
        (RuntimeError("error building a validator"), None, None),
        (OSError(errno.EBADF, "Bad file descriptor"), signal.SIGTERM, 143),
        (OSError(errno.EBADF, "Bad file descriptor"), None, 2),
        (OSError(errno.ENOSPC, "No space left on device"), signal.SIGTERM, 2),
        (caused(ImportError("initialization failed"), KeyboardInterrupt()), None, 130),
        (caused(ImportError("initialization failed"), ValueError()), None, None),
    ],
)
@pytest.mark.usefixtures("handlers", "capsys")  # not pytest's own file: a verb that fails lets go of its stdout
def test_what_a_c_extension_makes_of_a_signal_is_an_interrupt(error: Any, number: int | None, code: Any) -> None:
    """Some swallow the KeyboardInterrupt and raise an error of their own that does not even hold it.

    Python's own `rmtree` closes a file a second time; a disk that is full is what a person must know all the same.
    """

    def verb() -> None:
        with suppress(KeyboardInterrupt):
            end_well()
            if number is not None:
                signal.raise_signal(number)
        raise error

    with pytest.raises(type(error) if code is None else SystemExit) as ended:
        guarded(verb, False)()
    assert getattr(ended.value, "code", None) == code


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (None, None)])
def test_a_signal_while_a_verb_is_loaded_is_an_interrupt_whatever_becomes_of_it(
    number: int | None, code: int | None, monkeypatch: pytest.MonkeyPatch, capsys: Any, handlers: Callable[[], None]
) -> None:
    """A C extension that is interrupted as it is loaded raises an ImportError of its own."""

    def loaded(name: str) -> None:
        with suppress(KeyboardInterrupt):
            if number is not None:
                signal.raise_signal(number)
        raise ImportError(f"initialization of {name} failed")

    monkeypatch.setattr(sys.modules["cosim.cli.verbs"], "import_module", loaded)  # `cosim.cli.verbs` is the function
    handlers()
    with pytest.raises(ImportError if code is None else SystemExit) as ended:
        main(["export", "paper_mount", "--out", "out"])
    assert getattr(ended.value, "code", None) == code
    said = {130: "cosim: interrupted\n", 143: "cosim: terminated\n", None: ""}
    assert capsys.readouterr().err == said[code]


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("library", ["casadi", "numpy"])
def test_termination_ends_an_export_wherever_it_comes_and_leaves_nothing(library: str, tmp_path: Path) -> None:
    """Here: while the verb loads what it works with; SIGTERM comes from within."""
    start = f"""
import builtins, signal
load = builtins.__import__
def come(name, *given, **named):
    if name.split(".")[0] == "{library}":
        builtins.__import__ = load
        signal.raise_signal(signal.SIGTERM)
    return load(name, *given, **named)
builtins.__import__ = come
from cosim.cli import main
main()
"""
    done = python("-c", start, "export", "paper_mount", "--out", "out", folder=tmp_path)
    assert (done.returncode, done.stderr) == (143, "cosim: terminated\n")
    assert not [one for one in tmp_path.rglob("*") if one.is_file()]


PROGRAM = """
import signal, time
import casadi as ca
from cosim.cli import guarded, main
from cosim.support.interrupts import end_well

class Last:
    def __del__(self):
        {comes}

class Shaped:
    asked = 0
    @property
    def shape(self):
        self.asked += 1
        if self.asked == 1:
            {comes}
        return 1, 1

def verb():
    try:
        {what}
    except NotImplementedError:
        pass  # it is no number
    time.sleep({seconds})

end_well()
guarded(verb, False)()
"""
FINALIZED, ASKED = "Last()", 'ca.fmax(ca.SX.sym("x"), Shaped())'


def ended(what: str, comes: str, seconds: float) -> tuple[int, str]:
    """Run a verb in which something comes while an object is finalized, or while CasADi asks one for its shape."""
    done = python("-c", PROGRAM.format(what=what, comes=comes, seconds=seconds))
    return done.returncode, done.stderr


@pytest.mark.parametrize("what", [FINALIZED, ASKED], ids=["finalized", "casadi"])
@pytest.mark.parametrize(
    ("name", "code", "said"), [("SIGINT", 130, "cosim: interrupted\n"), ("SIGTERM", 143, "cosim: terminated\n")]
)
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_signal_that_comes_where_errors_are_ignored_is_not_lost(what: str, name: str, code: int, said: str) -> None:
    assert ended(what, f"signal.raise_signal(signal.{name})", 600) == (code, said)


def test_other_exceptions_that_python_ignores_are_told_as_ever() -> None:
    code, said = ended(FINALIZED, "raise ValueError('of a finalizer')", 0)
    assert (code, said[:22]) == (0, "Exception ignored in: ")
    assert said.endswith("ValueError: of a finalizer\n")
