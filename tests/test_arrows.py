"""The arrows of the architecture: who may import whom."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for package in ("cosim", "pyfmi_models")
    for path in (ROOT / package).rglob("*.py")
}
EXPORT_READS = ("pyfmi_models.model", "pyfmi_models.errors", "pyfmi_models.export")
RUNNERS = (
    "component",
    "fmu",
    "master",
    "loop",
    "recording",
    "scenario",
    "ssp",
    "renamed",
    "signals",
    "hardware",
    "supervisor",
    "wiring",
    "algorithm",
    "schedule",
    "planning",
    "faults",
    "function",
    "exchange",
    "listeners",
    "diagram",
    "execution",
    "interrupts",
    "description",
    "sweep",
)
MAKERS = (
    "cosim.diagnosis",
    "cosim.identify",
    "cosim.paper",
    "cosim.proof",
    "cosim.demo",
    "cosim.stiffness",
    "cosim.cli",
)


def imports(name: str, inside: bool = True) -> set[str]:
    """List what a module imports, as far as modules of ours go; `inside` counts imports within functions too."""
    tree = ast.parse(FILES[name].read_text("utf-8"))
    found: set[str] = set()
    for node in ast.walk(tree) if inside else tree.body:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            whole = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {one if one in FILES else node.module for one in whole}
    return found


def belongs(name: str, *rooms: str) -> bool:
    return any(name == room or name.startswith((f"{room}.", f"{room}_")) for room in rooms)


@pytest.mark.parametrize("name", FILES)
def test_a_module_imports_only_what_it_may(name: str) -> None:
    for other in imports(name):
        if belongs(name, "pyfmi_models"):
            assert not belongs(other, "cosim"), f"{name} imports {other}: physics knows nothing of what runs it"
        if belongs(name, "pyfmi_models.export"):
            assert not belongs(other, "pyfmi_models") or belongs(other, *EXPORT_READS), f"{name} imports {other}"
        elif belongs(name, "pyfmi_models"):
            assert not belongs(other, "pyfmi_models.export"), f"{name} imports {other}: physics does not export itself"
        if belongs(name, *(f"cosim.{room}" for room in RUNNERS)):
            assert not belongs(other, "casadi", "ziglang", "pyfmi_models", "matplotlib"), f"{name} imports {other}"
        if belongs(other, "pyfmi_models") and belongs(name, "cosim"):
            assert belongs(name, *MAKERS), f"{name} imports {other}: only {', '.join(MAKERS)} may"


def test_no_module_imports_itself_by_a_detour() -> None:
    graph = {name: {other for other in imports(name, inside=False) if other in FILES} - {name} for name in FILES}
    TopologicalSorter(graph).prepare()
