"""Files of experiments in an FMU: settings of a simulation, parameters, stimulus and reference.

Both drafts of the format are read: times as attributes of `Experiment`, or of `TransientSimulation` in it. Other kinds
of analysis are named and not run.
Reference: Experiments Format (ma-hs-experiments), Modelica Association, drafts of 2025 and 2026.
"""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from xml.etree import ElementTree

from cosim.fmi.manifest import Related, member_of
from cosim.fmi.xml_member import plain, xml_in
from cosim.support.errors import FmuError

KINDS = ("application/x-ma-hs-experiments", "application/x-ma-ls-experiments")
"""MIME types of files of experiments, of the later and the earlier draft."""
CSV = "text/csv"
SET = "application/x-ssp-parameter-set"


@dataclass(frozen=True)
class Experiment:
    """One experiment: files are members of the archive, "" where there is none; times are None where not given.

    `not_run` says why it cannot be run here; it is empty where it can.
    """

    name: str
    description: str = ""
    purpose: str = "smoke-test"
    start: float | None = None
    stop: float | None = None
    step: float | None = None
    tolerance: float | None = None
    parameters: str = ""
    stimuli: str = ""
    references: str = ""
    not_run: str = ""


def experiments_in(path: Path, file: Related) -> list[Experiment]:
    """Read a file of experiments.

    Raises:
        FmuError: it cannot be read, or a number in it is none.
    """
    root = xml_in(path, file.member)
    if plain(root) != "Experiments":
        raise FmuError(
            f"{path}: {file.member} is no file of experiments: its root is <{plain(root)}>.", culprit=str(path)
        )
    purpose = file.role.partition("/")[2] or "smoke-test"
    return [_experiment(path, file.member, one, purpose) for one in root if plain(one) == "Experiment"]


def _experiment(path: Path, member: str, element: ElementTree.Element, purpose: str) -> Experiment:
    parts = {plain(one): one for one in element}
    name = element.get("name", "experiment")
    kinds = [one for one in parts if one not in ("Parameters", "Stimuli", "References", "Annotations")]
    numbers = {**element.attrib, **(parts["TransientSimulation"].attrib if "TransientSimulation" in parts else {})}
    not_run = ""
    strange = [one for one in kinds if one != "TransientSimulation"]
    if strange:
        not_run = f"it is of kind {strange[0]}, and only transient simulations are run here"
    files: dict[str, str] = {}
    for tag, kind in (("Parameters", SET), ("Stimuli", CSV), ("References", CSV)):
        part = parts.get(tag)
        if part is None:
            continue
        files[tag] = member_of(member, part.get("source", ""))
        if part.get("type", kind) != kind:
            not_run = not_run or f"its {tag} are of type {part.get('type')}{only(kind)}"
        elif not files[tag]:
            not_run = not_run or f'its {tag} lie elsewhere ("{part.get("source")}")'
    times = {
        key: _number(path, member, name, key, numbers) for key in ("startTime", "stopTime", "stepSize", "tolerance")
    }
    return Experiment(
        name=name,
        description=element.get("description", ""),
        purpose=purpose,
        start=times["startTime"],
        stop=times["stopTime"],
        step=times["stepSize"],
        tolerance=times["tolerance"],
        parameters=files.get("Parameters", ""),
        stimuli=files.get("Stimuli", ""),
        references=files.get("References", ""),
        not_run=not_run,
    )


def only(kind: str) -> str:
    """The end of a sentence on a file of another kind: what is read, and what helps."""
    advice = '; a table with the first column "time", as CSV in its place, is run' if kind == CSV else ""
    return f", and only {kind} is read here{advice}"


def _number(path: Path, member: str, name: str, key: str, found: dict[str, str]) -> float | None:
    text = found.get(key)
    if text is None:
        return None
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        rule = f'{key} is "{text}"; it must be a number'
        raise FmuError(f'{path}: the experiment "{name}" in {member} breaks a rule: {rule}.', culprit=key, value=text)
    return value
