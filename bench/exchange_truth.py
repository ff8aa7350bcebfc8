"""What others say of an archive: FMPy on the same FMU, a reference CSV in it, and why it cannot run here."""

import csv
import tempfile
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import numpy as np

from cosim.fmi.component import Port
from cosim.fmi.description import describe
from cosim.fmi.variables import ports_of

LONGEST, STEPS, COLUMNS = 100.0, 2000, 40
"""Simulated seconds, steps of a run and recorded variables at most."""
ROUNDED = 1e-3
"""What rounding a step's size may change through a solver inside an FMU: FMPy's is the difference of two times."""


def experiment(description: Any) -> tuple[float, float]:
    """Stop and step [s] that an FMU proposes, in at most STEPS steps."""
    told_ = description.defaultExperiment
    stop, step = (float(getattr(told_, name, None) or 0) for name in ("stopTime", "stepSize"))
    stop = min(stop or 1.0, LONGEST)
    step = step if 0 < step <= stop else stop / 500
    return step * min(round(stop / step), STEPS), step


def recorded(ports: dict[str, Port]) -> list[str]:
    """Outputs, or where there are none what else moves."""
    ports = {
        name: one for name, one in ports.items() if one.type not in ("Clock", "Binary", "String") and not one.array
    }
    outputs = [name for name, one in ports.items() if one.causality == "output"]
    locals_ = [name for name, one in ports.items() if one.causality == "local" and one.type == "Float64"]
    return (outputs or locals_ or list(ports))[:COLUMNS]


def beside_fmpy(path: Path, kind: str, step: float, stop: float, seen: dict[str, Any], t: Any) -> tuple[str, float]:
    """Say how far FMPy is from what was seen, relative to the range of each signal."""
    names = outputs_of(path, seen)
    try:
        theirs = in_fmpy(path, kind, step, stop, names)
    except Exception as error:
        return f"FMPy does not run it: {type(error).__name__}: {str(error).splitlines()[0][:80]}", 0.0
    later = np.append(np.diff(theirs["time"]) > 0, True)  # at an event FMPy has two rows, one of which is ours
    former = np.append(True, np.diff(theirs["time"]) > 0)
    apart_ = []
    for name, ours in seen.items():
        whole, _, index = name.partition("[")
        column = theirs[name] if name in theirs.dtype.names else theirs[whole].reshape(len(theirs), -1)
        column = (column if column.ndim == 1 else column[:, place(index, theirs[whole])]).astype(float)
        sides = [np.interp(t, theirs["time"][one], column[one]) for one in (later, former)]
        nearest = np.where(np.abs(sides[0] - ours) < np.abs(sides[1] - ours), *sides)
        apart_.append(differ(nearest, ours))
    worst = max(apart_, default=0.0)
    if kind == "coSimulation" and 1e-9 < worst < ROUNDED and describe(path).fmiVersion.startswith("2"):
        plain = in_plain_loop(path, step, len(t) - 1, list(seen))
        same = max(differ(plain[name], ours) for name, ours in seen.items())
        return f"FMPy {worst:.1e}, a plain loop of its calls {same:.1e}", same
    return f"FMPy {worst:.1e}", worst


def in_fmpy(path: Path, kind: str, step: float, stop: float, names: list[str]) -> Any:
    """Rows of FMPy: get and doStep of a slave that is told no tolerance and no stop, as here, or its solver CVode."""
    given: Any = {"validate": False, "start_time": 0.0, "stop_time": stop, "output_interval": step, "output": names}
    if kind == "modelExchange":
        return fmpy.simulate_fmu(str(path), fmi_type="ModelExchange", relative_tolerance=1e-7, **given)
    description = describe(path)
    if description.defaultExperiment is not None:
        description.defaultExperiment.tolerance = None
    given |= {"model_description": description, "set_stop_time": False}
    return fmpy.simulate_fmu(str(path), fmi_type="CoSimulation", **given)


def in_plain_loop(path: Path, step: float, ticks: int, names: list[str]) -> dict[str, np.ndarray]:
    """Rows of the loop that FMPy's users write (FMI 2): every step of one size, where `simulate_fmu` rounds it anew."""
    description = describe(path)
    known = {one.name: one.valueReference for one in description.modelVariables if one.type == "Real"}
    references = [known[name] for name in names]
    with tempfile.TemporaryDirectory() as folder:
        fmu = fmpy.instantiate_fmu(fmpy.extract(str(path), unzipdir=folder), description, "CoSimulation")
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        rows = [fmu.getReal(references)]
        for tick in range(ticks):
            fmu.doStep(tick * step, step)
            rows.append(fmu.getReal(references))
        fmu.freeInstance()
    return dict(zip(names, np.array(rows).T, strict=True))


def outputs_of(path: Path, seen: dict[str, Any]) -> list[str]:
    """Name whole arrays in the place of their elements."""
    ports = ports_of(describe(path))
    return sorted({ports[name].array or name if name in ports else name for name in seen})


def place(index: str, values: np.ndarray) -> int:
    """Turn `2,1]` into a place in FMI's order."""
    return int(np.ravel_multi_index([int(one) - 1 for one in index.strip("]").split(",")], values.shape[1:]))


def differ(one: np.ndarray, other: np.ndarray) -> float:
    """Largest difference relative to range or size."""
    one, other = np.asarray(one, float), np.asarray(other, float)
    if not (np.isfinite(one) == np.isfinite(other)).all():
        return np.inf
    one, other = one[np.isfinite(one)], other[np.isfinite(other)]
    size = max(np.ptp(other), np.abs(other).max(), 1e-12) if len(other) else 1.0
    return float(np.abs(one - other).max() / size) if len(other) else 0.0


def beside_csv(path: Path, recording: Any) -> str:
    """Say how far the reference is that the archive itself brings (FMI-LS-REF), made by co-simulation."""
    with zipfile.ZipFile(path) as archive:
        names = [name for name in archive.namelist() if name.startswith("extra/") and name.endswith("_out.csv")]
        lines = archive.read(names[0]).decode().splitlines() if names else []
    rows = list(csv.DictReader(lines))
    if not rows:
        return ""
    t = np.array([float(row["time"]) for row in rows])
    within = (t >= recording.t[0]) & (t <= recording.t[-1])
    numbers = [name for name, text in rows[0].items() if text.strip("-.0123456789e+") == ""]
    known = [name for name in numbers if name != "time" and name in recording]
    theirs = {name: np.array([float(row[name]) for row in rows])[within] for name in known}
    ours = {name: np.interp(t[within], recording.t, recording[name]) for name in known}
    worst = max((differ(ours[name], theirs[name]) for name in known), default=0.0)
    return f"its reference CSV {worst:.1e}" if known else ""


def refused(path: Path, sentence: str, kind: str = "") -> tuple[str, str, str]:
    """Find out without this tool whether a refusal is true."""
    truth = reason(path) if path.suffix == ".fmu" else in_system(path, sentence)
    if not truth and path.suffix == ".fmu":
        truth = fmpy_refuses(path, kind)
    return ("refused" if truth else "wrong"), sentence, truth


def reason(path: Path) -> str:
    """Look into an FMU for what makes it impossible to run here."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
            root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    except Exception as error:
        return f"no readable archive: {type(error).__name__}"
    if root.get("fmiVersion", "").startswith("1"):
        return "its fmiVersion is 1.0"
    platform = fmpy.platform if root.get("fmiVersion", "").startswith("2") else fmpy.platform_tuple
    if not any(name.startswith(f"binaries/{platform}/") and not name.endswith("/") for name in names):
        sources = " (it brings sources)" if any(name.startswith("sources/") for name in names) else ""
        return f"no file in binaries/{platform}{sources}"
    return ""


def fmpy_refuses(path: Path, kind: str) -> str:
    """Let FMPy, which shares no master code, try."""
    try:
        description = describe(path)
        stop, step = experiment(description)
        rows = in_fmpy(path, kind, step, stop, recorded(ports_of(description)))
    except Exception as error:
        return f"FMPy: {type(error).__name__}: {str(error).splitlines()[0][:80]}"
    finite = all(np.isfinite(rows[name].astype(float)).all() for name in rows.dtype.names)
    return "" if finite else "FMPy records numbers that are not finite"


def in_system(path: Path, sentence: str) -> str:
    """Look for the FMU that the sentence names, or what its XML lacks."""
    text = "" if path.suffix == ".ssp" else path.read_text("utf-8", "replace")
    if "no component that is an FMU" in sentence and text and ".fmu" not in text:
        return "its XML names no FMU"
    for fmu in path.parent.rglob("*.fmu"):
        if fmu.name in sentence and reason(fmu):
            return f"{fmu.name}: {reason(fmu)}"
    if "gave an output that is not a finite number" in sentence:
        name = sentence.split()[0]
        for fmu in path.parents[3].rglob(f"{name}.fmu"):
            return f"{name} alone: {fmpy_refuses(fmu, 'coSimulation')}"
    words = [word.lstrip('"(').rstrip('").,:;') for word in sentence.split()] if path.suffix == ".ssd" else []
    files = [word for word in words if word.endswith((".fmu", ".ssv", ".ssm", ".ssd"))]
    for fmu in (path.parent / word for word in files):
        if fmu.suffix == ".fmu" and fmu.exists() and reason(fmu):
            return f"{fmu.name}: {reason(fmu)}"
    missing = [word for word in files if not (path.parent / word).exists()]
    return f"{missing[0]} is not there" if missing else ""
