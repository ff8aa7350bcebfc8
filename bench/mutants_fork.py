"""Tests in forks: of this process, or of a pytest that has collected all of them and changes one function in place.

To import the product and collect tests takes seconds, to run a test often hundredths of one. `Server` does the former
once; for each mutant a fork of it gives the function its changed code and runs the tests that are asked. The changed
module must lie in the tree too: what the tests start as processes of their own reads it there.
"""

import ast
import gc
import json
import os
import resource
import signal
import sys
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import pytest

HOME = Path(__file__).parents[1]
SECONDS, WAITED = 150, 900
"""Of a processor that tests may take, and of the clock: a mutant that never ends, or waits for ever, is noticed too."""
TOO_LONG = (-signal.SIGXCPU, -signal.SIGALRM)
"""How a fork ends that took longer."""
OURS = ("cosim", "cosim_studies", "pyfmi_models", "mutants", "mutants_page", "mutants_fork", "mutations", "reach")
"""What a fork loads anew, from the tree with the error."""
QUIET = ("-n0", "-q", "-p", "no:cacheprovider")
FAILED, CANNOT = 1, 3
"""Exit codes of a fork of the server."""


def prepared(tree: Path, said: Path) -> None:
    """Make this process one of a tree: modules come from there, what is printed goes to a file."""
    os.setsid()
    os.chdir(tree)
    os.environ |= {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1"}
    sys.path[:] = [str(tree), *(one for one in sys.path if not _is_of_home(one))]
    for module in [one for one in sys.modules if one.split(".")[0] in OURS]:
        del sys.modules[module]
    with said.open("w") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)


def limited() -> None:
    """End this process by a signal once it took too long."""
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    signal.alarm(WAITED)


def _is_of_home(folder: str) -> bool:
    """Whether modules there are those of which a copy is changed; a virtual environment may lie in their tree."""
    return (folder == str(HOME) or folder.startswith(str(HOME) + os.sep)) and not folder.startswith(sys.prefix + os.sep)


def function_of(source: str, line: int) -> str:
    """The qualified name of the outermost function whose body holds a line; empty outside, and in a head."""
    return next(_functions(ast.parse(source).body, line), "")


def _functions(body: Sequence[ast.stmt], line: int, outside: str = "") -> Iterator[str]:
    for node in body:
        if isinstance(node, ast.ClassDef):
            yield from _functions(node.body, line, f"{outside}{node.name}.")
        elif isinstance(node, ast.FunctionDef) and node.lineno < node.body[0].lineno <= line <= (node.end_lineno or 0):
            yield f"{outside}{node.name}"


class Server:
    """A fork that has collected files of tests of a tree.

    Args:
        tree: where the tests lie.
        files: theirs, from the folder of tests on.

    `tests` are those that it found there: a map of who calls what may be older.
    """

    def __init__(self, tree: Path, files: Sequence[str]) -> None:
        (asked, self._ask), (self._answer, answers) = os.pipe(), os.pipe()
        self._pid = os.fork()
        if not self._pid:
            os.close(self._ask)
            prepared(tree, tree / "said")
            names = [f"tests/{name}" for name in files]
            os._exit(int(pytest.main([*QUIET, *names], plugins=[_Loop(tree, asked, answers)])))
        os.close(asked)
        os.close(answers)
        # All is loaded now: no error that is planted from now on gets in unasked.
        self.tests = frozenset(one.removeprefix("tests/") for one in json.loads(self._read()))

    def failed(self, tests: Sequence[str], module: str = "", function: str = "") -> str | None:
        """Run tests, with a function as the tree's module has it now; what failed, or None where that cannot be done.

        The name is told from the file on, "(time)" stands behind where they did not end.
        """
        told = {"tests": [f"tests/{one}" for one in tests], "module": module, "function": function}
        os.write(self._ask, (json.dumps(told) + "\n").encode())
        found: str | None = json.loads(self._read())
        return found

    def _read(self) -> bytes:
        answer = b""
        while not answer.endswith(b"\n"):
            part = os.read(self._answer, 65536)
            if not part:
                raise SystemExit("the server of tests has ended")
            answer += part
        return answer

    def close(self) -> None:
        """End it."""
        os.close(self._ask)
        os.close(self._answer)
        os.waitpid(self._pid, 0)


class _Loop:
    """A plugin of pytest: in the place of running all tests, run those that are asked, each time in a fork."""

    def __init__(self, tree: Path, asked: int, answers: int) -> None:
        self._tree, self._asked, self._answers = tree, asked, answers

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        items = {one.nodeid: one for one in session.items}
        with os.fdopen(self._asked) as asked, os.fdopen(self._answers, "w") as answers:
            print(json.dumps(list(items)), file=answers, flush=True)
            for line in asked:
                print(json.dumps(self._answered(session, items, json.loads(line))), file=answers, flush=True)
        return True

    def _answered(self, session: pytest.Session, items: dict[str, pytest.Item], told: Any) -> str | None:
        witness = self._tree / "witness"
        pid = os.fork()
        if not pid:
            os._exit(self._work(session, items, told, witness))
        code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        if code in (0, CANNOT):
            return "" if code == 0 else None
        if code == FAILED:
            return witness.read_text("utf-8").removeprefix("tests/")
        return f"{told['tests'][0].removeprefix('tests/')}{' (time)' if code in TOO_LONG else ''}"

    def _work(self, session: pytest.Session, items: dict[str, pytest.Item], told: Any, witness: Path) -> int:
        limited()
        chosen = [items[one] for one in told["tests"] if one in items]
        if len(chosen) < len(told["tests"]) or not self._changed(told["module"], told["function"]):
            return CANNOT
        for item, after in pairwise([*chosen, None]):
            if item is not None:
                item.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
                if session.testsfailed:
                    witness.write_text(item.nodeid, "utf-8")
                    return FAILED
        return 0

    def _changed(self, module: str, function: str) -> bool:
        """Give a function the code that its module in the tree has now; nothing is to do where none is loaded yet."""
        if not module:
            return True
        path = str(self._tree / module)
        codes = _codes(compile(Path(path).read_text("utf-8"), path, "exec", dont_inherit=True), function)
        loaded = [one for one in gc.get_objects() if isinstance(one, FunctionType) and one.__code__.co_filename == path]
        these = [one for one in loaded if one.__qualname__ == function or one.__code__.co_qualname == function]
        if len(codes) != 1 or (loaded and len(these) != 1) or any(_shape(one) != _shape(codes[0]) for one in these):
            return False
        for one in these:
            one.__code__ = codes[0]
        return True


def _codes(code: CodeType, name: str) -> list[CodeType]:
    inner = [one for one in code.co_consts if isinstance(one, CodeType)]
    return [*([code] if code.co_qualname == name else []), *(found for one in inner for found in _codes(one, name))]


def _shape(one: FunctionType | CodeType) -> tuple[object, ...]:
    """What must agree so that a function can take a code: arguments, and variables from outside."""
    code = one.__code__ if isinstance(one, FunctionType) else one
    return code.co_argcount, code.co_kwonlyargcount, code.co_freevars
