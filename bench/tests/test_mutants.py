"""Planted errors: each is one, is found where a test looks, and survives where none does."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

import mutants
import mutations_c
from mutants_page import Tried
from mutations import KINDS, mutated, sites

SOURCE = '''
"""A module."""
LIMIT: int = 3
def clamp(x: float = -1.5) -> float:
    """Hold x between -LIMIT and LIMIT."""
    check(zip(x, strict=True))
    if x > LIMIT and not x == 7:
        raise ValueError(f"{x + 1} is more than {LIMIT * 2}")
    return clip(min(-LIMIT, x * 2), LIMIT) if x is not None else x[1] % 1000.0 == True
'''
NOBODY_SEES = [
    "__all__ = ['a', 3]",
    "axes.plot(t, 1000.0 * q, linewidth=2.5)",
    "axes.set(xlim=(0, 3))",
    "print(3)",
    "x = json.dumps(y, indent=2)",
    "x = draw(colour=0.5, fontsize=8)",
    "class A:\n    def size(self, limit: float = 3.0) -> float:\n        'Of an interface.'",
    "if sys.platform == 'win32':\n    x = 3",
    "if os.name == 'posix':\n    pass\nelse:\n    x = 3",
    "if TYPE_CHECKING:\n    x = 3",
]
C = """/* A file: 1 + 1 is said only. */
#include "limit.h"

static const double ends[2] = {0.5, 7};
static double clamp(double x, const double *limit)
{
    check(x);
    free(x);
    if (x > limit[0] && !(x == 7)) {
        return within(x, 1e3) + fmax(x, 2.5); /* x - 1 */
    }
    return -x * (double)known("a < b");
}
"""


def test_every_kind_of_error_is_planted_and_each_changes_one_place() -> None:
    found = [mutated(SOURCE, number) for number in range(len(sites(SOURCE)))]
    whole = ast.unparse(ast.parse(SOURCE))
    for site, text in found:
        assert text != whole, site
        assert len(set(text.splitlines()) ^ set(whole.splitlines())) == 2, site
        assert 1 <= site.line <= len(SOURCE.splitlines())
    assert {(site.kind, site.change) for site, _ in found} == {
        ("default", "3 -> 4"),
        ("sign", "-1.5 -> without minus"),
        ("default", "1.5 -> 1.8"),
        ("call", "check(zip(x, strict=True)) -> left out"),
        ("comparison", "x > LIMIT -> GtE"),
        ("comparison", "x > LIMIT -> LtE"),
        ("truth", "x > LIMIT and (not x == 7) -> Or"),
        ("sign", "not x == 7 -> without not"),
        ("comparison", "x == 7 -> NotEq"),
        ("number", "7 -> 8"),
        ("swap", "clip(min(-LIMIT, x * 2), LIMIT) -> swapped"),
        ("sign", "-LIMIT -> without minus"),
        ("operator", "x * 2 -> Div"),
        ("number", "2 -> 3"),
        ("comparison", "x is not None -> Is"),
        ("comparison", "x[1] % 1000.0 == True -> NotEq"),
        ("operator", "x[1] % 1000.0 -> Mult"),
        ("index", "1 -> 2"),
        ("number", "1000.0 -> 1200.0"),
        ("unit", "1000.0 -> 1000000.0"),
        ("truth", "True -> False"),
    }, "what is raised, annotated or written in a docstring is only said"
    assert {site.kind for site, _ in found} == set(KINDS)


@pytest.mark.parametrize("source", NOBODY_SEES)
def test_what_nobody_can_see_is_not_planted(source: str) -> None:
    kept = [site.change for site in sites(source) if not site.change.startswith(("sys.platform", "os.name"))]
    assert kept == []


def test_in_c_each_error_changes_one_token_and_nothing_that_is_only_said() -> None:
    found = [mutations_c.mutated(C, number) for number in range(len(mutations_c.sites(C)))]
    changes = {(site.kind, site.change.rpartition(": ")[2]) for site, _ in found}
    assert changes == {
        ("number", "0.5 -> 0.6"),
        ("call", "check(x); -> left out"),
        ("comparison", "> -> >="),
        ("comparison", "> -> <="),
        ("index", "0 -> 1"),
        ("truth", "&& -> ||"),
        ("sign", "! -> left out"),
        ("comparison", "== -> !="),
        ("number", "7 -> 8"),
        ("swap", "within(x, 1e3 -> within(1e3, x"),
        ("number", "1e3 -> 1200.0"),
        ("unit", "1e3 -> 1000000.0"),
        ("operator", "+ -> -"),
        ("number", "2.5 -> 3.0"),
        ("sign", "- -> left out"),
        ("operator", "* -> /"),
    }
    for site, text in found:
        ours = [one for one in zip(C.split("\n"), text.split("\n"), strict=True) if one[0] != one[1]]
        assert [one[0] for one in ours] == [C.split("\n")[site.line - 1]]


def test_the_same_seed_draws_the_same_errors_from_every_room_and_of_every_kind() -> None:
    groups = ("fmi", "loop", "hardware")
    some = {seed: drawn(seed, 150, groups) for seed in (1, 2)}
    assert some[1] == drawn(1, 150, groups)
    assert some[1] != some[2]
    assert [one.group for one in some[1][:6]] == 2 * list(groups)
    assert {one.kind for one in some[1]} == set(KINDS)
    assert any(one.module.endswith(".c") for one in some[1])


def drawn(seed: int, count: int, groups: tuple[str, ...]) -> list[Tried]:
    """What a run would try, each as if it had survived."""
    tried: list[Tried] = []
    for group, path, number in mutants.todo(seed, count, groups, tried):
        site = mutants.read(path)[1][number]
        module = str(path.relative_to(mutants.HOME))
        tried.append(Tried(group, module, number, site.line, site.kind, site.change, ""))
    return tried


def test_every_room_of_the_trunk_has_its_errors() -> None:
    there = {path for patterns in mutants.GROUPS.values() for one in patterns for path in mutants.HOME.glob(one)}
    rooms = {path.relative_to(mutants.HOME / "cosim").parts[0] for path in (mutants.HOME / "cosim").glob("*/*.py")}
    assert not {room for room in rooms if not any(mutants.HOME / "cosim" / room in one.parents for one in there)}


@pytest.mark.skipif(sys.platform != "linux", reason="forks")
def test_an_error_is_noticed_where_a_test_looks_and_survives_where_none_does(tmp_path: Path) -> None:
    """In an interpreter of its own: tests are run in forks of it."""
    done = subprocess.run([sys.executable, __file__, tmp_path], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr


def noticed(folder: Path) -> None:
    home = folder / "home"
    (home / "tests").mkdir(parents=True)
    (home / "held.py").write_text("def held(x):\n    return min(x, 3) + 0\n")
    (home / "pyproject.toml").write_text("")
    for name, body in {"looks": "from held import held\n    assert held(9) == 3", "idle": "pass"}.items():
        (home / "tests" / f"test_{name}.py").write_text(f"def test_{name}():\n    {body}\n")
    (home / "tests" / "test_broken.py").write_text("def test_broken():\n    assert False\n")
    mutants.HOME = home
    this = mutants.Tree(folder, 60.0)
    for number, site in enumerate(mutants.read(home / "held.py")[1]):
        for files in (["test_idle.py"], ["test_broken.py", "test_idle.py", "test_looks.py"])[number > 0 :]:
            mutants.chosen = lambda *_, files=files: iter([[one] for one in files])
            tried = this.attempt("held", home / "held.py", number)
            survives = len(files) == 1 or site.change == "min(x, 3) + 0 -> Sub"
            assert tried
            assert tried.noticed == ("" if survives else "test_looks.py::test_looks"), (tried, files)
    assert (this.place / "held.py").read_text() == (home / "held.py").read_text()


if __name__ == "__main__":
    noticed(Path(sys.argv[1]))
