"""The project on paper is the project as it is: commands, card, version, requirements, files of the package."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib import import_module
from importlib.metadata import PackageNotFoundError, packages_distributions, version
from pathlib import Path

import pytest

import cosim
from bench import scores
from bench.rebuild import PAGES
from cosim.diagnosis.effects import TRIED
from pyfmi_models.effects import CATALOGUE

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results"
README = (ROOT / "README.md").read_text("utf-8")
WRITTEN = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
PROJECT, WHEEL = WRITTEN["project"], WRITTEN["tool"]["hatch"]["build"]["targets"]["wheel"]
START = "python3 -m venv .venv && .venv/bin/pip install . && .venv/bin/cosim demo"
TEST = ".venv/bin/pip install '.[test]' && .venv/bin/pytest"
PACKAGES = {name: import_module(name) for name in WHEEL["packages"]}
SOURCES = [path for name in PACKAGES for path in (ROOT / name).rglob("*")]
CALLED = {"sklearn": "scikit-learn"}
"""Optional packages that are installed by another name than they are imported by."""
BUILT = {".so", ".dylib", ".dll", ".pyc"}
FOLDERS = {".ci", "bench", "docs", "fmus", "results", "tests"}
"""What the project has at its top beside the packages."""


def test_readme_states_the_two_commands_and_ci_runs_the_second() -> None:
    assert START in README
    assert TEST in README
    assert TEST in (ROOT / ".ci" / "run").read_text("utf-8")
    assert (ROOT / ".ci" / "run").stat().st_mode & 0o100


def test_what_a_run_leaves_is_no_part_of_the_project() -> None:
    """Answers about measured machines name folders of the computer they were made on, and stay there."""
    if not (ROOT / ".git").exists() or not (git := shutil.which("git")):
        pytest.skip("no checkout by git")
    listed = subprocess.run(
        [git, "-c", "safe.directory=*", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split("\n")
    strange = {one.split("/")[0] for one in listed if "/" in one} - FOLDERS - set(PACKAGES)
    assert not strange, f"folders that are committed, and not the project's: {', '.join(sorted(strange))}"


def test_readme_lists_the_effects_that_a_diagnosis_can_name() -> None:
    limits = README.partition("## Limits")[2]
    assert {name for name in re.findall(r"`([a-z_]+)`", limits) if name in CATALOGUE} == set(TRIED)


def test_links_of_documents_and_results_lead_somewhere() -> None:
    for page in [*ROOT.glob("*.md"), *RESULTS.rglob("*.md")]:
        for target in re.findall(r"\]\(([^)#\s]+)", page.read_text("utf-8")):
            assert target.startswith("https://") or (page.parent / target).exists(), f"{page}: {target}"


def test_no_document_or_result_names_a_folder_of_the_machine_that_made_it() -> None:
    """Whoever rebuilds a result has no such folder: a command is given with paths that begin in the project."""
    absolute = re.compile(r"(?<![\w./~-])/(?:work|root|home|tmp|mnt|Users)/\w")
    files = [one for one in RESULTS.rglob("*") if one.suffix in {".md", ".json", ".jsonl", ".csv", ".toml"}]
    files += [*ROOT.glob("*.md"), ROOT / ".ci" / "run", ROOT / "pyproject.toml"]
    named = [str(one.relative_to(ROOT)) for one in files if absolute.search(one.read_text("utf-8"))]
    assert not named, f"these name a folder of one machine: {', '.join(named)}"


def test_the_version_is_stated_once_and_is_a_release_or_in_the_making() -> None:
    assert "version" in PROJECT["dynamic"]
    changelog = (ROOT / "CHANGELOG.md").read_text("utf-8")
    assert "## [Unreleased]" in changelog
    assert f"\n## [{cosim.__version__}] - " in changelog
    try:
        assert version(PROJECT["name"]) == cosim.__version__
    except PackageNotFoundError:
        pytest.skip("the package is not installed here")


def test_every_package_is_in_the_wheel_and_checked_for_types() -> None:
    there = {path.parent.name for path in ROOT.glob("*/__init__.py")} - FOLDERS | {"cosim", "pyfmi_models"}
    assert set(WHEEL["packages"]) == set(WRITTEN["tool"]["mypy"]["packages"]) == there


def test_every_file_of_the_packages_is_installed() -> None:
    for path in SOURCES:
        if path.is_file() and path.suffix not in BUILT and "partial" not in path.suffixes:
            relative = path.relative_to(ROOT)
            home = Path(str(PACKAGES[relative.parts[0]].__file__)).parent
            assert (home / Path(*relative.parts[1:])).is_file(), f"{relative} is not in the installed package"


@pytest.mark.parametrize("library", ["cosim/master/loop/_loop", "cosim_studies/proof/_machine"])
def test_the_compiled_libraries_are_installed(library: str) -> None:
    package, _, rest = library.partition("/")
    path = Path(str(PACKAGES[package].__file__)).parent / rest
    assert list(path.parent.glob(f"{path.name}.*")), (
        f"{library} is missing: python cosim/master/loop/build_hook.py builds it"
    )


def test_what_is_imported_is_required() -> None:
    """A package that only happens to be there, because another one brought it, is a missing install step."""
    stated = [*PROJECT["dependencies"], *(one for extra in PROJECT["optional-dependencies"].values() for one in extra)]
    required = {re.split(r"[^\w-]", one)[0].lower() for one in stated} | {"hatchling"}
    providers = packages_distributions()
    for module, path in sorted(imported().items()):
        names = {one.lower() for one in providers.get(module, [CALLED.get(module, module)])}
        assert names & required, f"{path} imports {module}, which pyproject.toml does not require"


def imported() -> dict[str, Path]:
    """Return the outside modules that the packages import, each with one file that does."""
    found: dict[str, Path] = {}
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text("utf-8"))) if path.suffix == ".py" else ():
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) and node.module and not node.level else []
            found |= {name.partition(".")[0]: path.relative_to(ROOT) for name in names}
    return {name: path for name, path in found.items() if name not in {*sys.stdlib_module_names, *PACKAGES}}


def test_every_result_is_told_how_it_is_rebuilt() -> None:
    """By hand are the list of the folder, the list of decks, and what is read from pages: causes."""
    pages = {str(one.relative_to(RESULTS)) for one in RESULTS.glob("*/*.md") if not one.stem.endswith("causes")}
    assert pages == set(PAGES)
    for command in PAGES.values():
        for file in re.findall(r"bench/\w+\.py", command):
            assert (ROOT / file).is_file(), command


def test_results_are_listed_and_small() -> None:
    """Proof is read by people: twelve topics and a megabyte; `python bench/slim.py` makes them so."""
    told = (RESULTS / "README.md").read_text("utf-8")
    assert not [one for one in RESULTS.rglob("*.md") if one.name != "README.md" and f"{one.name})" not in told]
    assert len([one for one in RESULTS.rglob("*") if one.is_dir()]) <= 12
    assert sum(one.stat().st_size for one in RESULTS.rglob("*") if one.is_file()) <= 1_000_000


def test_the_scores_are_those_of_the_results() -> None:
    assert scores.PAGE.read_text("utf-8") == scores.page(), "python bench/scores.py writes results/SCORES.md"


# The script that looks for known holes of dependencies: one that hears nothing does not call them clean.

UVX = """#!/bin/sh
for file; do :; done
grep -q -E "$HOLES" "$file" || { echo "No known vulnerabilities found"; exit 0; }
echo "Found 1 known vulnerability in 1 package"; exit 1
"""
UV = """#!/bin/sh
while [ "$1" != --output-file ]; do case $1 in lowest-direct) of=3.1.6;; highest) of=3.2.0;; esac; shift; done
echo "jinja2==$of" > "$2"
"""


@pytest.mark.skipif(sys.platform != "linux", reason="a script of bash")
@pytest.mark.parametrize(
    ("holes", "code", "said"),
    [
        ("nothing", 77, "skipped: "),
        ("==2.10$", 0, "== highest\nNo known"),
        ("==2.10$|==3.1.6$", 1, "== lowest-direct\nFound 1"),
        ("==2.10$|==3.2.0$", 1, "== highest\nFound 1"),
    ],
)
def test_dependencies_are_clean_only_where_a_known_hole_is_found(
    tmp_path: Path, holes: str, code: int, said: str
) -> None:
    """Stand-ins for pip-audit and uv: one knows holes of some versions, the other which versions are taken."""
    for name, text in {"uvx": UVX, "uv": UV}.items():
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    environment = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}", "HOLES": holes}
    done = subprocess.run(
        [ROOT / ".ci" / "audit"], env=environment, capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.returncode, said in done.stdout) == (code, True), done.stdout
