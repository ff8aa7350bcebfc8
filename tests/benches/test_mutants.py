"""Planted errors: each is one, is found where a test looks, and survives where none does."""

import ast
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

import mutants
import mutants_choice
from mutants_choice import Declared
from mutations import mutated, sites
from reach import Reached, read

SOURCE = '''
"""A module."""
LIMIT: int = 3
def clamp(x: float = -1.5) -> float:
    """Hold x between -LIMIT and LIMIT."""
    check(x)
    if x > LIMIT and not x == 7:
        raise ValueError(f"{x + 1} is more than {LIMIT * 2}")
    return max(-LIMIT, x * 2) if x is not None else x % 2 == True
'''


def test_every_kind_of_error_is_planted_and_each_changes_one_place() -> None:
    found = [mutated(SOURCE, site) for site in range(len(sites(SOURCE)))]
    changes = [change for _, change, _ in found]
    whole = ast.unparse(ast.parse(SOURCE))
    for line, change, text in found:
        assert text != whole, change
        assert len(set(text.splitlines()) ^ set(whole.splitlines())) == 2, change
        assert 1 <= line <= len(SOURCE.splitlines())
    for wanted in (
        "3 -> 4",
        "-1.5 -> without minus",
        "check(x) -> left out",
        "x > LIMIT -> GtE",
        "x > LIMIT -> LtE",
        "x > LIMIT and (not x == 7) -> Or",
        "not x == 7 -> without not",
        "x == 7 -> NotEq",
        "x * 2 -> Div",
        "x is not None -> Is",
        "x % 2 -> Mult",
        "True -> False",
    ):
        assert wanted in changes
    assert not any("LIMIT * 2" in one or "x + 1" in one for one in changes), "what is raised is only said"


def test_the_same_seed_draws_the_same_mutants_from_every_group() -> None:
    one = list(mutants.drawn(1, 40))
    assert one == list(mutants.drawn(1, 40))
    assert one != list(mutants.drawn(2, 40))
    assert {group for group, *_ in one[:4]} == set(mutants.GROUPS)


def test_the_tests_of_a_module_are_those_that_are_near() -> None:
    root = mutants.HOME
    assert mutants_choice.belonging(root / "cosim" / "hardware" / "replay.py")[0] == "hardware/test_hardware_replay.py"
    assert "adrc/test_adrc.py" in mutants_choice.belonging(root / "pyfmi_models" / "adrc" / "controller.py")
    assert "master/test_master.py" in mutants_choice.belonging(root / "cosim" / "master" / "planning.py")


SHORT = """LIMIT = 3
TWICE = 2 * LIMIT

@cached
def one():
    return LIMIT


class A:
    size: int = 4

    def other(self):
        def inner():
            return 2

        return self.size
"""


def test_a_line_belongs_to_the_innermost_function_around_it_or_declares_names() -> None:
    found = [mutants_choice.around(SHORT, line) for line in range(1, 17)]
    assert found[:7] == ["", "", "", "one", "one", "one", ""], "from its decorator on"
    assert found[9:] == ["", "", "A.other", "A.other.<locals>.inner", "A.other.<locals>.inner", "A.other", "A.other"]
    assert mutants_choice.declared(SHORT, 1) == Declared(frozenset({"LIMIT", "TWICE"})), "and what is made of it"
    assert mutants_choice.declared(SHORT, 2) == Declared(frozenset({"TWICE"}))
    assert mutants_choice.declared(SHORT, 10) == Declared(frozenset({"size"}), "A")
    assert mutants_choice.declared(SHORT, 3) == Declared(frozenset())


def test_the_tests_that_are_asked_call_the_function_in_question_the_cheapest_of_each_kind_first() -> None:
    told = [("a[1]", 0.1, ["one"]), ("a[2]", 0.2, ["one"]), ("b", 0.3, ["one", "A.other"])]
    told += [("c", 0.4, ["A.other"]), ("d", 19.9, ["one"])]
    reached = [Reached(f"tests/test_none.py::{test}", seconds, {"m.py": names}) for test, seconds, names in told]

    def asked(line: int, module: str = "m.py") -> list[str]:
        return [one.removeprefix("test_none.py::") for one in mutants_choice.calling(module, SHORT, line, reached)]

    assert asked(6) == ["a[1]", "b", "a[2]"], "all that fit into the time"
    assert asked(16) == ["b", "c"]
    assert asked(1) == ["a[1]", "b", "c", "a[2]"], "any of the module, where no use is known"
    assert asked(6, "other.py") == []


def test_of_the_tests_that_call_a_function_those_come_first_that_name_it_then_those_of_near_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in ("cosim", "tests"):
        (tmp_path / folder).mkdir()
    (tmp_path / "cosim" / "m.py").write_text(SHORT)
    (tmp_path / "tests" / "test_far.py").write_text("def test_idle():\n    pass\n\ndef test_name():\n    one()\n")
    (tmp_path / "tests" / "test_near.py").write_text("from cosim import m\n\ndef test_idle():\n    pass\n")
    monkeypatch.setattr(mutants_choice, "HOME", tmp_path)
    mutants_choice.belonging.cache_clear()
    names = ("far.py::test_idle", "far.py::test_name", "near.py::test_idle")
    reached = [Reached(f"tests/test_{one}", 0.1 + k, {"cosim/m.py": ["one"]}) for k, one in enumerate(names)]
    found = mutants_choice.calling("cosim/m.py", SHORT, 6, reached)
    assert found == ("test_far.py::test_name", "test_near.py::test_idle", "test_far.py::test_idle")


def test_of_what_is_declared_outside_of_functions_the_tests_come_first_that_name_it_then_those_that_use_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in ("cosim", "tests"):
        (tmp_path / folder).mkdir()
    (tmp_path / "cosim" / "m.py").write_text(SHORT + "\n\ndef idle():\n    return 1\n")
    (tmp_path / "cosim" / "far.py").write_text("from cosim.m import TWICE\n\ndef far():\n    return TWICE\n")
    (tmp_path / "cosim" / "same.py").write_text("def same():\n    return LIMIT\n")
    names = "from cosim import m\n\ndef test_names():\n    assert m.LIMIT == 3\n\ndef test_idle():\n    pass\n"
    (tmp_path / "tests" / "test_m.py").write_text(names)
    monkeypatch.setattr(mutants_choice, "HOME", tmp_path)
    calls: dict[str, dict[str, list[str]]] = {
        "idle": {"cosim/m.py": ["idle"]},
        "same": {"cosim/m.py": ["idle"], "cosim/same.py": ["same"]},
        "far": {"cosim/m.py": ["idle"], "cosim/far.py": ["far"]},
        "class": {"cosim/m.py": ["A.other"]},
        "one": {"cosim/m.py": ["one"]},
        "uses": {"cosim/far.py": ["far"]},
        "names": {},
        "none": {},
    }
    reached = [Reached(f"tests/test_m.py::test_{name}", 0.1 + k / 10, calls[name]) for k, name in enumerate(calls)]

    def asked(line: int) -> list[str]:
        found = mutants_choice.calling("cosim/m.py", SHORT, line, reached)
        return [one.removeprefix("test_m.py::test_") for one in found]

    assert asked(1) == ["one", "far", "uses", "names", "idle", "same", "class"]
    assert asked(2) == ["far", "uses", "idle", "same", "class", "one"], (
        "TWICE is named nowhere, and used elsewhere only"
    )
    assert asked(10)[0] == "class", "a field: the functions of its class"


def test_who_calls_what_is_noted_for_each_test_that_passes(tmp_path: Path) -> None:
    out = tmp_path / "reach"
    here = Path(__file__).parents[2] / "bench" / "reach.py"
    command = [sys.executable, here, "--files", "diagnosis/search/test_decision_proof.py", "--out", out]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    found = read(out)
    assert [one.seconds for one in found] == sorted(one.seconds for one in found)
    source = (mutants.HOME / "cosim" / "diagnosis" / "search" / "proof.py").read_text("utf-8")
    line = source[: source.index("def prove(")].count("\n") + 1
    assert all("prove" in one.calls["cosim/diagnosis/search/proof.py"] for one in found)
    assert len(mutants_choice.calling("cosim/diagnosis/search/proof.py", source, line, found)) == len(found)


def test_a_function_is_named_where_its_body_holds_a_line() -> None:
    source = (
        "class A:\n    def one(self, x=1):\n        def inner():\n            return x\n        return inner\n\ny = 2\n"
    )
    assert [mutants.function_of(source, line) for line in range(1, 8)] == ["", "", "A.one", "A.one", "A.one", "", ""]


@pytest.mark.skipif(sys.platform != "linux", reason="forks")
def test_a_server_of_tests_changes_one_function_in_place(tmp_path: Path) -> None:
    alone("served", tmp_path)


def test_an_error_is_noticed_where_a_test_looks_and_survives_where_none_does(tmp_path: Path) -> None:
    alone("noticed", tmp_path)


@pytest.mark.parametrize("part", ["story", "clamp"])
def test_a_sample_of_planted_errors_in_the_product_is_noticed(part: str, tmp_path: Path) -> None:
    """A few that were drawn once; the whole table is results/robustness/mutants.md."""
    alone(part, tmp_path)


def alone(part: str, folder: Path) -> None:
    """Run a part of this file in an interpreter of its own: tests are run in forks of it."""
    done = subprocess.run([sys.executable, __file__, part, folder], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr


def noticed(folder: Path) -> None:
    (folder / "tests").mkdir()
    (folder / "held.py").write_text("def held(x):\n    return min(x, 3) + 0\n")
    for name, body in {"looks": "from held import held\n    assert held(9) == 3", "idle": "pass"}.items():
        (folder / "tests" / f"test_{name}.py").write_text(f"def test_{name}():\n    {body}\n")
    assert mutants.noticed(folder, ["test_idle.py", "test_looks.py"]) == ""
    source = (folder / "held.py").read_text()
    for site in range(len(sites(source))):
        _, change, text = mutated(source, site)
        (folder / "held.py").write_text(text)
        assert mutants.noticed(folder, ["test_idle.py"]) == "", change
        expected = "" if change == "min(x, 3) + 0 -> Sub" else "test_looks.py::test_looks"
        assert mutants.noticed(folder, ["test_idle.py", "test_looks.py"]) == expected, change
        assert mutants.noticed(folder, ["test_looks.py"], without=["test_looks.py::test_looks"]) == ""
    with pytest.raises(SystemExit, match="some are not there"):
        mutants.failed(folder, ["test_looks.py::test_gone"])


def served(folder: Path) -> None:
    (folder / "tests").mkdir()
    good = "def held(x, most=3):\n    return min(x, most)\n\n\n"
    good += "class A:\n    def one(self):\n        return [k + 1 for k in (1, 2)]\n"
    (folder / "held.py").write_text(good)
    body = "from held import A, held\n\ndef test_held():\n    assert held(9) == 3\n\n"
    body += "def test_one():\n    assert A().one() == [2, 3]\n"
    (folder / "tests" / "test_both.py").write_text(body)
    server = mutants.Server(folder, ["test_both.py"])
    both = ["test_both.py::test_one", "test_both.py::test_held"]
    assert server.tests == set(both)

    def found(old: str, new: str, function: str) -> str | None:
        (folder / "held.py").write_text(good.replace(old, new))
        try:
            return server.failed(both, "held.py", function)
        finally:
            (folder / "held.py").write_text(good)

    assert server.failed(both) == ""
    assert found("min(x, most)", "max(x, most)", "held") == "test_both.py::test_held"
    assert found("k + 1", "k - 1", "A.one") == "test_both.py::test_one"
    assert found("k + 1", "1 + k", "A.one") == ""
    assert found("x, most)", "x, 3)", "held") == "", "each fork begins without the error before it"
    assert found("(x, most=3)", "(x)", "held") is None, "another shape cannot be put in"
    assert found("k + 1", "k - 1", "A.two") is None
    assert server.failed(["test_both.py::test_none"]) is None
    server.close()


def planted(module: str, changes: tuple[str, ...]) -> Callable[[Path], None]:
    def run(folder: Path) -> None:
        tree, path = mutants.copied(folder), mutants.HOME / module
        source = path.read_text("utf-8")
        found = {mutated(source, site)[1]: site for site in range(len(sites(source)))}
        asking = mutants.Asking(tree)
        tried = [asking.attempt("sample", path, found[one]) for one in changes]
        assert [one for one in tried if not one.noticed] == []
        assert (tree / module).read_text("utf-8") == source

    return run


PARTS = {
    "noticed": noticed,
    "served": served,
    "story": planted(
        "cosim/hardware/story.py", ("now['sha256'] != seal.sha256 -> Eq", "now['story'] == seal.story -> NotEq")
    ),
    "clamp": planted("pyfmi_models/adrc/controller.py", ("-limit -> without minus",)),
}

if __name__ == "__main__":
    PARTS[sys.argv[1]](Path(sys.argv[2]))
