"""Values at the start in several tools: one SSP a case, and what FMI says of it.

python bench/initialisation.py --out results/exchange

The FMUs are those of `start_fmus.py`, of FMI 2, because not all tools know another. FMPy and libcosim show nothing
before the first step, so what is looked at cannot be right after some steps if the start was wrong. --python names an
interpreter in which the other tools are installed (extra `peers`), where that is another than this one.
"""

import argparse
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import cosim
from cosim.master.simulate import run
from cosim.support.errors import CosimError
from cosim.support.files import replacing
from cosim.system.scenario import read_scenario

sys.path.append(str(Path(__file__).parents[1] / "tests/tools"))
from ssp_files import EXPERIMENT, SPACES, real, wire
from ssp_tools import TOOLS
from start_fmus import DX, C, K, U, V, X, Y, library, packed

STEP, STEPS = 0.001, 3
PACKAGES = {"fmpy": "fmpy", "ecos": "ecospy", "libcosim": "libcosimpy"}
ANY = V("any", 4, "input", start="0")
"""An input that nothing follows, through which a component waits for another."""


@dataclass(frozen=True)
class Case:
    """A system, what is looked at, what it is at the start and stays by the standard, and why."""

    title: str
    fmus: Mapping[str, Mapping[str, object]]
    wires: Sequence[tuple[str, str]]
    signal: str
    right: float
    why: str
    values: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    factor: float = 1.0
    open: bool = False
    """Whether the FMU breaks a rule, so that a tool which has another value is not wrong."""


RING = [("a.y", "b.u"), ("b.y", "a.u")]
SOURCE = {"model": "source", "follows": ""}
LAG = {"model": "lag", "follows": "u", "variables": (U, X, DX, Y)}
CASES = (
    Case(
        "a lag with x(0) = u(0), fed by y = 5",
        {"lag": LAG, "source": SOURCE},
        [("source.y", "lag.u")],
        "lag.x",
        5,
        "x is an initial unknown that follows u, which is set in initialisation mode (2.0.5, 4.2.4)",
        {"source": {"c": 5}},
    ),
    Case(
        "a controller whose home is the position it meets: its torque",
        {"home": {"model": "home", "follows": ""}, "source": SOURCE},
        [("source.y", "home.u")],
        "home.y",
        0,
        "u is an input, and its value at the start is that of its source",
        {"source": {"c": 5}},
    ),
    Case(
        "the same through a transformation, y = 2 x + 1 at once",
        {"lag": LAG, "gain": {"model": "gain", "follows": "u", "running": "u"}, "source": SOURCE},
        [("gain.y", "lag.u"), ("source.y", "gain.u")],
        "lag.x",
        11,
        "values travel in the order of the dependencies, whatever the order in the file",
        {"source": {"c": 5}, "gain": {"k": 2, "c": 1}},
    ),
    Case(
        "a connection with factor 2",
        {"lag": LAG, "source": SOURCE},
        [("source.y", "lag.u")],
        "lag.x",
        10,
        "the transformation of a connection acts at the start too (SSP 2.0, 4.5.2)",
        {"source": {"c": 5}},
        2.0,
    ),
    Case(
        "an FMU that refuses inputs before initialisation mode, u = 3 of a parameter set",
        {"strict": {"model": "strict", "follows": "u", "variables": (U, Y)}},
        [],
        "strict.y",
        3,
        "in FMI 2 inputs have no `initial`, and are set in initialisation mode and later only (2.0.5, 2.2.7)",
        {"strict": {"u": 3}},
    ),
    Case(
        "two wait for each other; an output is refused before its input is set, which may be once",
        {
            "once": {"model": "once", "follows": "u", "variables": (U, Y)},
            "source": SOURCE | {"variables": (Y, V("c", 3, "parameter", start="0"), ANY)},
        },
        [("source.y", "once.u"), ("once.y", "source.any")],
        "once.y",
        7,
        "an output is read after the inputs that it follows (InitialUnknowns)",
        {"source": {"c": 7}},
    ),
    Case(
        "a ring, y = y / 2 + 1",
        {name: {"model": "gain", "follows": "u"} for name in "ab"},
        RING,
        "b.y",
        2,
        "rings in initialisation mode are handled by a numerical method (2.0.5, 4.2.4)",
        {"a": {"k": 0.5, "c": 1}},
    ),
    Case(
        "a ring, y = -3 y + 1",
        {name: {"model": "gain", "follows": "u"} for name in "ab"},
        RING,
        "b.y",
        0.25,
        "the same; setting and getting in turn does not converge",
        {"a": {"k": -3, "c": 1}},
    ),
    Case(
        "a ring, u = 2 - v^2, v = 2 - u^2 from u = 0.8",
        {name: {"model": "square", "follows": "u", "variables": (U, Y, K, C)} for name in "ab"},
        RING,
        "a.y",
        1,
        "the start value of an input is where the iteration begins (2.0.5, 2.2.7)",
        {name: {"c": 2, "u": 0.8} for name in "ab"},
    ),
    Case(
        "an FMU that computes y = u only as initialisation ends, in front of a lag",
        {"lag": LAG, "late": {"model": "late", "follows": "u"}, "source": SOURCE},
        [("source.y", "late.u"), ("late.y", "lag.u")],
        "lag.x",
        5,
        "the FMU breaks a rule: y must be there in initialisation mode; where it is initialised first, 5 arrives",
        {"source": {"c": 5}},
        open=True,
    ),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--python", default=sys.executable, help="an interpreter that has the other tools")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        tools = {name: version for name in TOOLS if (version := installed(given.python, name))}
        rows = [judged(case, Path(folder), given.python, list(tools)) for case in CASES]
    given.out.mkdir(parents=True, exist_ok=True)
    with replacing(given.out / "initialisation.md", force=True) as partial:
        partial.write_text(page(rows, tools), "utf-8")


def installed(python: str, tool: str) -> str:
    """The version of a tool; empty where it is not installed or does not load."""
    code = f"import importlib, importlib.metadata as m; importlib.import_module({TOOLS[tool]!r}); "
    done = subprocess.run([python, "-c", f"{code}print(m.version({PACKAGES[tool]!r}))"], capture_output=True, text=True)
    if done.returncode:
        print(f"left out, {tool}: {done.stderr.strip().splitlines()[-1]}", file=sys.stderr)
    return done.stdout.strip()


def judged(case: Case, folder: Path, python: str, tools: Sequence[str]) -> list[str]:
    """A row of the table: the case, what it is by the standard, and what each tool has."""
    archive = written(case, Path(tempfile.mkdtemp(dir=folder)))
    cells = [f"{case.title}: `{case.signal}`", f"{case.right:g}", mark(ours(archive, case), case)]
    cells += [mark(theirs(archive, case, python, tool), case, first=tool == "ecos") for tool in tools]
    return [*cells, case.why]


def ours(archive: Path, case: Case) -> np.ndarray | str:
    try:
        recording = run(read_scenario(archive)).recording
    except CosimError as error:
        return str(error)
    return recording[case.signal][[0, STEPS]]


def theirs(archive: Path, case: Case, python: str, tool: str) -> np.ndarray | str:
    runner, out = Path(__file__).parent / "ssp_tools.py", archive.with_suffix(f".{tool}.npy")
    command = [python, str(runner), tool, str(archive), str(STEP), str(STEPS), str(out), case.signal]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    if done.returncode or not out.exists():
        said = [line for line in (done.stderr + done.stdout).splitlines() if line.strip()]
        return said[-1] if said else f"exit code {done.returncode}"
    return np.load(out)[[0, STEPS], 0]


def mark(found: np.ndarray | str, case: Case, first: bool = True) -> str:
    """What a tool has at the start and after some steps; right where both are."""
    if isinstance(found, str):
        return "refuses"
    seen = (found if first else found[1:]) + 0.0  # no negative zero
    right = np.allclose(seen, case.right, rtol=1e-6, atol=1e-9)
    verdict = "right" if right else "other" if case.open else "**wrong**"
    return f"{verdict}: {', '.join(f'{value:.4g}' for value in seen)}"


def written(case: Case, folder: Path) -> Path:
    """Write the SSP of a case."""
    built, archive = library(folder), folder / "case.ssp"
    with zipfile.ZipFile(archive, "w") as file:
        elements = ""
        for name, given in case.fmus.items():
            more = dict(given)
            file.write(packed(folder, built, str(more.pop("model")), **more), f"resources/{name}.fmu")
            values = "".join(real(key, float(value)) for key, value in case.values.get(name, {}).items())
            if values:
                body = f"<ssv:Parameters>{values}</ssv:Parameters>"
                text = f'<ssv:ParameterSet {SPACES} version="1.0" name="card">{body}</ssv:ParameterSet>'
                file.writestr(f"resources/{name}.ssv", text)
            elements += component(case, name, bool(values))
        file.writestr("SystemStructure.ssd", structure(case, elements))
    return archive


def component(case: Case, name: str, has_values: bool) -> str:
    taken = [target.partition(".")[2] for _, target in case.wires if target.startswith(f"{name}.")]
    seen = [*(source for source, _ in case.wires), case.signal]
    given = [one.partition(".")[2] for one in dict.fromkeys(seen) if one.startswith(f"{name}.")]
    kinds = [("input", one) for one in taken] + [("output", one) for one in given]
    inside = "".join(f'<ssd:Connector name="{one}" kind="{kind}"><ssc:Real/></ssd:Connector>' for kind, one in kinds)
    binding = f'<ssd:ParameterBinding source="resources/{name}.ssv"/>' if has_values else ""
    bindings = f"<ssd:ParameterBindings>{binding}</ssd:ParameterBindings>" if binding else ""
    head = f'<ssd:Component name="{name}" type="application/x-fmu-sharedlibrary" source="resources/{name}.fmu">'
    return f"{head}<ssd:Connectors>{inside}</ssd:Connectors>{bindings}</ssd:Component>"


def structure(case: Case, elements: str) -> str:
    inside = "" if case.factor == 1 else f'<ssc:LinearTransformation factor="{case.factor}" offset="0.0"/>'
    wires = "".join(wire(source, target, inside) for source, target in case.wires)
    connections = f"<ssd:Connections>{wires}</ssd:Connections>"
    system = f'<ssd:System name="case"><ssd:Elements>{elements}</ssd:Elements>{connections}</ssd:System>'
    root = f'ssd:SystemStructureDescription {SPACES} version="1.0" name="case"'
    head = '<?xml version="1.0" encoding="UTF-8"?>'
    return f"{head}<{root}>{system}{EXPERIMENT}</ssd:SystemStructureDescription>"


def page(rows: Sequence[Sequence[str]], tools: Mapping[str, str]) -> str:
    heads = ["case: what is looked at", "by the standard", f"cosim {cosim.__version__}"]
    heads += [f"{name} {version}" for name, version in tools.items()] + ["why"]
    lines = [
        "# Values at the start, in several tools",
        "",
        "    python bench/initialisation.py --out results/exchange",
        "",
        "One SSP a case, with FMUs of FMI 2. In a cell the value at the start and after three steps of 1 ms; FMPy and",
        "libcosim show none before the first step. FMPy is given the parameter sets, which it does not read by itself.",
        "OMSimulator could not be tried: its package on PyPI brings no binaries.",
        "",
        f"| {' | '.join(heads)} |",
        "|---" * len(heads) + "|",
        *(f"| {' | '.join(row)} |" for row in rows),
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
