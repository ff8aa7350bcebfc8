"""The arrows of the architecture: a folder imports only from floors below its own; nothing imports itself by a detour.

Every import counts: at the top of a file, inside a function, under TYPE_CHECKING. Folders are read from the tree.
"""

import re
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from imports import FILES, PACKAGES, PLUG_INS, ROOT, imports, imports_for_types

from cosim_studies.proof.conduct import TELLS

FLOORS = (
    {"cosim.support"},
    {"cosim.data"},
    {"cosim.fmi", "cosim.reading"},
    {"cosim.system"},
    {"cosim.master", "cosim.plots"},
    {"cosim.hardware", "cosim.models", "cosim.estimation"},
    {"cosim.experiments"},
    {"cosim.diagnosis.answer"},
    {"cosim.diagnosis.decide"},
    {"cosim.diagnosis.effects"},
    {"cosim.diagnosis.evidence"},
    {"cosim.diagnosis.terms"},
    {"cosim.diagnosis.search"},
    {"cosim.diagnosis.trust"},
    {"cosim.diagnosis.measure"},
    {"cosim.diagnosis"},
    {"cosim.report"},
    {"cosim.delivery"},
    {"cosim.api"},
    {"cosim", "cosim.cli"},
    {"cosim.__main__"},
    set(PLUG_INS),
)
"""The floors of the house, from the ground: what stands on one imports only from floors below."""
FLOOR_OF = {folder: number for number, floor in enumerate(FLOORS) for folder in floor}
HIGHEST = {"cosim", "cosim.api", "cosim.cli", *PLUG_INS}
ROOMS = {folder for floor in FLOORS for folder in floor if folder.count(".") == 2}
KNOW_PHYSICS = (
    ROOMS
    | {
        "cosim.diagnosis",
        "cosim.report",
        "cosim.delivery",
    }
    | HIGHEST
)
KNOW_PHYSICS |= {"cosim.models", "cosim.estimation"}
NEED_HEAVY = KNOW_PHYSICS | {"cosim.plots"}
"""Folders that may import CasADi, the compiler or matplotlib: a run needs none of them."""
FRONT = ("cosim", "cosim.api")
"""What Python code calls first."""
EXPORT_READS = ("pyfmi_models.model", "pyfmi_models.errors", "pyfmi_models.export")
C_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
C_FUNCTION = re.compile(r"^(?!static)(?:[A-Za-z_][\w *]*[ *])(\w+)\([^;{}]*\)\n\{", re.MULTILINE)


@cache
def ours(name: str) -> frozenset[str]:
    """What a module of ours imports of ours; the front door may name types that plug-ins bring, for editors alone."""
    types = {one for one in imports_for_types(name) if belongs(one, *PLUG_INS)} if belongs(name, *FRONT) else set()
    return frozenset({other for other in imports(name) - types if other in FILES} - {name})


def belongs(name: str, *rooms: str) -> bool:
    return any(name == room or name.startswith(f"{room}.") for room in rooms)


def folder_of(name: str) -> str:
    """cosim.system.plan -> cosim.system; rooms of the diagnosis are folders; studies and physics one folder each."""
    parts = name.split(".")
    if (room := ".".join(parts[:3])) in ROOMS:
        return room
    return ".".join(parts[:2]) if parts[0] == "cosim" else parts[0]


def floor(name: str) -> int:
    return FLOOR_OF[folder_of(name)]


def test_every_folder_stands_on_a_floor() -> None:
    found = {folder_of(name) for name in FILES} - {"pyfmi_models"}
    assert found == set(FLOOR_OF)


def test_cosim_holds_folders_and_at_most_four_modules() -> None:
    assert len(list((ROOT / "cosim").glob("*.py"))) <= 4


@pytest.mark.parametrize("folder", sorted(set(FLOOR_OF)))
def test_a_folder_imports_only_from_floors_below(folder: str) -> None:
    for name in (one for one in FILES if folder_of(one) == folder):
        for other in (one for one in ours(name) if not belongs(one, folder, "pyfmi_models")):
            assert floor(other) < floor(name), f"{name} imports {other}, which does not stand below it"


@pytest.mark.parametrize("plug_in", PLUG_INS)
def test_what_is_plugged_in_is_imported_by_itself_alone(plug_in: str) -> None:
    """The trunk knows it by its entry points, another plug-in not at all; no string in the trunk names it either."""
    for name, path in FILES.items():
        if not belongs(name, plug_in):
            assert not any(belongs(other, plug_in) for other in ours(name)), f"{name} imports {plug_in}"
        if belongs(name, "cosim"):
            assert f'"{plug_in}' not in path.read_text("utf-8") or name == "cosim.master.loop.build_hook", name


@pytest.mark.parametrize("folder", sorted({folder_of(name) for name in FILES}))
def test_physics_and_what_is_heavy_stay_where_they_belong(folder: str) -> None:
    for name, other in ((one, other) for one in FILES if folder_of(one) == folder for other in imports(one)):
        if belongs(name, "pyfmi_models"):
            assert not belongs(other, "cosim", "cosim_studies"), f"{name} imports {other}: physics knows no runner"
        elif belongs(other, "pyfmi_models"):
            assert folder_of(name) in KNOW_PHYSICS, f"{name} imports {other}: only {', '.join(KNOW_PHYSICS)} may"
        elif belongs(other, "casadi", "ziglang", "matplotlib"):
            assert folder_of(name) in NEED_HEAVY, f"{name} imports {other}: only {', '.join(NEED_HEAVY)} may"
        if belongs(name, "pyfmi_models.export"):
            assert not belongs(other, "pyfmi_models") or belongs(other, *EXPORT_READS), f"{name} imports {other}"
        elif belongs(name, "pyfmi_models"):
            assert not belongs(other, "pyfmi_models.export"), f"{name} imports {other}: physics does not export itself"


def test_nothing_that_decides_asks_what_tells() -> None:
    """The code that a page of scores is made by leaves out what only tells: no score may come from there."""
    tells = tuple(path.removesuffix(".py").replace("/", ".") for path in TELLS)
    deciding = {name for name in FILES if belongs(name, "cosim.diagnosis", "cosim.estimation", "cosim_studies.proof")}
    asking = {name for name in deciding if not belongs(name, *tells) if any(belongs(one, *tells) for one in ours(name))}
    assert not asking, asking


def test_no_file_imports_itself_by_a_detour() -> None:
    TopologicalSorter({name: ours(name) for name in FILES}).prepare()


@pytest.mark.parametrize(
    "folder", sorted({path.parent for package in PACKAGES for path in (ROOT / package).rglob("*.c")})
)
def test_no_file_in_c_calls_itself_by_a_detour(folder: Path) -> None:
    texts = {path.name: C_COMMENT.sub("", path.read_text("utf-8")) for path in folder.glob("*.c")}
    homes = {function: name for name, text in texts.items() for function in C_FUNCTION.findall(text)}
    calls = {name: {homes[word] for word in re.findall(r"\w+", text) if word in homes} for name, text in texts.items()}
    TopologicalSorter({name: others - {name} for name, others in calls.items()}).prepare()
