"""A map of which tests run which blocks, and the tests that are asked of a line by it."""

import ast

import mutants_chosen
from mutants_blocks import blocks, marked
from mutants_choice import HOME
from mutants_chosen import Map, Ran, candidates, ordered, reaching

SOURCE = '''"""A module."""
from __future__ import annotations
LIMIT = 3
class A:
    """A class."""
    size = 4
    def grown(self, x):
        """Grow."""
        if x > LIMIT:
            return 1
        elif x < 0:
            return [2 for _ in range(self.size)][0]
        else:
            def inner():
                return 3
        try:
            return inner()
        finally:
            x += 1
'''


def test_a_block_leaves_its_mark_when_it_runs_and_only_then() -> None:
    text = marked(SOURCE, 10).replace("from mutants_seen import _seen_", "")
    there: dict[str, object] = {"_seen_": (seen := dict[int, int]())}
    exec(compile(text, "marked", "exec"), there)
    assert seen == {}, "what is imported is no block"
    assert there["A"]().grown(5) == 1  # type: ignore[operator]
    names = [one.named("m") for one in blocks(SOURCE)]
    assert {names[number - 10] for number in seen} == {"m:A.grown:0", "m:A.grown:1"}
    assert there["A"].grown.__doc__ == "Grow."  # type: ignore[attr-defined]
    assert there["A"]().grown(2) == 3  # type: ignore[operator]
    assert {names[number - 10] for number in seen} >= {"m:A.grown.inner:0", "m:A.grown:4"}


def test_every_module_of_the_product_can_be_marked() -> None:
    for path in [*(HOME / "cosim").rglob("*.py")][::7]:
        source = path.read_text("utf-8")
        count = ast.unparse(ast.parse(marked(source, 0))).count("_seen_[")
        assert count == len(blocks(source)), path


def known() -> Map:
    """Three tests of four blocks: a test that runs one, one that runs all, one that runs none of a function."""
    names = ["m:f:0", "m:f:1", "m:g:0", "m:h:0"]
    tests = [
        Ran("a.py::whole", 1.0, 0b1111, 4),
        Ran("a.py::one[1]", 1.0, 0b1000, 1),
        Ran("b.py::other", 1.0, 0b0001, 1),
    ]
    return Map({name: number for number, name in enumerate(names)}, tests, {"a.py", "b.py"})


def test_tests_that_run_a_block_are_asked_the_most_focused_first() -> None:
    found = ordered(known().running({"m:f:0"}), "")
    assert [one.name for one in found] == ["a.py::one[1]", "a.py::whole"]
    assert known().running({"m:elsewhere:0"}) == []
    assert known().seconds(["a.py::whole", "b.py::other"]) == 2.0
    assert known().seconds(["c.py::new"]) is None


def test_a_constant_is_looked_for_where_it_is_named_and_a_c_function_where_it_is_called() -> None:
    path = HOME / "cosim/diagnosis/trust/admission.py"
    source = path.read_text("utf-8")
    line = source[: source.index("\nLEAST_SECONDS = ")].count("\n") + 2
    nearest = next(candidates(path, source, line))
    assert nearest == {f"cosim/diagnosis/trust/admission.py:check_recordings:{number}" for number in (0, 2)}
    assert {"factorise", "prepare"} < reaching(HOME / "cosim/master/loop/rodas4.c", "factorise")
    assert mutants_chosen.naming_blocks("loop_run")
    for folder in ("cosim_nesting/c", "pyfmi_models/export/c", "cosim/hardware"):
        for one in (HOME / folder).glob("*.c"):
            assert reaching(one, "") or not mutants_chosen.HEAD.search(one.read_text("utf-8"))


def test_tests_of_what_is_declared_come_first_of_a_declaration() -> None:
    path = HOME / "cosim/hardware/machine.py"
    source = path.read_text("utf-8")
    line = source[: source.index("    answer_spin_us: float")].count("\n") + 1
    ranges = "hardware/test_machine_ranges.py"
    assert next(mutants_chosen.chosen(Map(files={ranges}), path, source, line)) == [ranges]
