"""`cosim.export`: a card to FMUs, and on wish to an SSP, to Modelica, C and files of other simulators."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal, Protocol

from cosim.api.recordings import Source
from cosim.delivery.experiment import sines, with_experiment
from cosim.models.carried import related_of
from cosim.support.errors import InputError
from cosim.support.files import check_free, directory
from cosim.support.html import table as html_table
from cosim.support.plain import JsonObject
from cosim.support.plugins import EXPORTS, loaded
from cosim.support.toml import parsed
from pyfmi_models.card import Card, read_card
from pyfmi_models.export import export_fmu
from pyfmi_models.export.platforms import platforms_of
from pyfmi_models.export.related import Related
from pyfmi_models.model import Model

Fmi = Literal[2, 3]
Writer = Callable[[Path, bool], object]
Progress = Callable[[int, int], None]


class Held(Protocol):
    """What a simulator holds of a card and what it loses: a table as text; `as_json` names the simulator."""

    def as_json(self) -> JsonObject:
        """Return everything as plain data."""
        ...


class Simulators(Protocol):
    """Files for other simulators and the table of what they lose, planned by what is plugged in."""

    @property
    def paths(self) -> tuple[Path, ...]:
        """All that will be written, the table last."""
        ...

    def write(self, force: bool) -> Sequence[Held]:
        """Write all; returns what each simulator holds, in the order of the files."""
        ...


@dataclass(frozen=True)
class Exported:
    """What was written: FMUs, SSP, Modelica packages, C, files of simulators (None or empty where not asked for).

    `held` says what each simulator holds of the card and what it loses, and `table` is the file that says so.
    """

    fmus: tuple[Path, ...]
    ssp: Path | None = None
    modelica: Path | None = None
    flange: Path | None = None
    c: Path | None = None
    simulators: tuple[Path, ...] = ()
    table: Path | None = None
    held: tuple[Held, ...] = ()

    @property
    def paths(self) -> tuple[Path, ...]:
        """All files in the order in which they were written; of the C project its folder."""
        others = (self.ssp, self.modelica, self.flange, self.c)
        return (*self.fmus, *(one for one in (*others, *self.simulators, self.table) if one))

    def as_json(self) -> JsonObject:
        """Return paths and tables as plain data."""
        others = {"ssp": self.ssp, "modelica": self.modelica, "modelica_flange": self.flange, "c": self.c}
        found: JsonObject = {"fmus": [str(path) for path in self.fmus]}
        found |= {kind: str(path) for kind, path in others.items() if path}
        held = [one.as_json() for one in self.held]
        found |= {str(one["simulator"]): str(path) for one, path in zip(held, self.simulators, strict=False)}
        return found | ({"table": str(self.table), "held": held} if held else {})

    def __str__(self) -> str:
        paths = "\n".join(map(str, self.paths))
        return "\n\n".join([paths, *map(str, self.held)])

    def _repr_html_(self) -> str:
        return html_table("Exported", [{"file": path, "bytes": f"{path.stat().st_size:,}"} for path in self.paths])


@dataclass(frozen=True)
class _Archive:
    path: Path
    model: Model
    fmi: Fmi
    machines: tuple[str, ...]
    related: tuple[Related, ...] = ()


def export(
    card: str | Path | Card,
    out: str | Path,
    *,
    fmi: Fmi | Literal["both"] = "both",
    platform: str = "host",
    ssp: bool = False,
    modelica: bool = False,
    modelica_flange: bool = False,
    c: bool = False,
    mujoco: bool = False,
    urdf: bool = False,
    isaac: bool = False,
    recording: Source | None = None,
    as_fmu: bool = False,
    force: bool = False,
    on_progress: Progress = lambda done, of: None,
) -> Exported:
    """Write the plant of a card and, where it has one, its controller as FMUs for co-simulation and model exchange.

    Args:
        card: a model card: its path, the name of a shipped one ("paper_mount"), or a `Card`; with `as_fmu` a scenario.
        out: folder for the files, NAME_plant_fmi3.fmu and so on; it is made where it is not there.
        fmi: version of the standard: 2, 3 or "both".
        platform: "host", "all", or names with commas between ("x86_64-linux,aarch64-linux").
        ssp: also wire plant, controller and a set point as one SSP 1.0, NAME.ssp.
        modelica: also write the plant as a Modelica package.
        modelica_flange: also write it with flanges of the Modelica Standard Library, acausal.
        c: also write it as plain C99, NAME_c: a function that steps, its header, a small program.
        mujoco: also write the joint for MuJoCo, NAME_mujoco.xml.
        urdf: also write the joint as a robot description, NAME.urdf.
        isaac: also write the joint for Isaac Sim, NAME_isaac.usda.
        recording: along whose motion is measured what a simulator cannot hold (see `cosim.read`; columns as in the
            card); None takes two sines that reach the speeds where the card's friction changes.
        as_fmu: `card` is a scenario or SSP, which becomes one FMU for co-simulation, NAME_fmi3.fmu (Linux).
        force: overwrite what is there.
        on_progress: told how many FMUs are done, and of how many.

    Returns:
        `Exported`: the paths.

    Raises:
        CardError, RecordingError: the card or recording is not good, or the card cannot have what is asked for.
        ScenarioError, WiringError, FmuError, SignalError: the system is not good, or cannot become one FMU.
        OutputError: a file is there already; nothing was written then.
    """
    asked = {"ssp": ssp, "modelica": modelica, "modelica_flange": modelica_flange, "c": c}
    kinds = kinds_of(**asked, mujoco=mujoco, urdf=urdf, isaac=isaac)
    if as_fmu:
        return system_as_fmu(card, out, fmi, platform, force, kinds)
    return planned(card, out, fmi, platform, force, kinds, recording).write(on_progress)


def system_as_fmu(
    scenario: str | Path | Card,
    out: str | Path,
    fmi: Fmi | Literal["both"],
    platform: str,
    force: bool,
    kinds: Sequence[str],
    on_build: Callable[[str], None] = lambda text: None,
) -> Exported:
    """Write a system as one FMU; arguments and errors are those of `export`, `on_build` is told of FMUs of cards."""
    if isinstance(scenario, Card):
        raise InputError("A card is no system: give a scenario (.toml) or an SSP, or leave --as-fmu out.")
    if kinds:
        option = f"--{kinds[0].replace('_', '-')}"
        raise InputError(f"{option} is of a card, and --as-fmu of a system; give one of them.", culprit=option)
    if platform != "host":
        raise InputError(f'--as-fmu builds for this computer; --platform "{platform}" is not there.', culprit=platform)
    return Exported(loaded(EXPORTS, "system")(scenario, out, fmi, force, on_build))


def kinds_of(**asked: bool) -> tuple[str, ...]:
    """Names of what is asked for."""
    return tuple(name for name, wanted in asked.items() if wanted)


@dataclass(frozen=True)
class Plan:
    """What will be written, all of it checked; `others` are by kind: path, and what writes it."""

    archives: tuple[_Archive, ...]
    others: dict[str, tuple[Path, Writer]]
    force: bool
    simulators: Simulators | None = None

    def write(self, on_progress: Progress = lambda done, of: None) -> Exported:
        """Write everything; `on_progress` is told how many FMUs are done, and of how many."""
        for done, one in enumerate(self.archives):
            on_progress(done, len(self.archives))
            directory(one.path.parent)
            _write(one, self.force)
        for path, write in self.others.values():
            write(path, self.force)
        ssp, modelica, flange, c = (self.others.get(one, (None,))[0] for one in ("ssp", *_OTHERS))
        found = Exported(tuple(one.path for one in self.archives), ssp, modelica, flange, c)
        if self.simulators is None:
            return found
        *files, table = self.simulators.paths
        return replace(found, simulators=tuple(files), table=table, held=tuple(self.simulators.write(self.force)))

    def check(self) -> None:
        """Refuse to write over what is there (raises OutputError)."""
        files = self.simulators.paths if self.simulators else ()
        for path in (*(one.path for one in self.archives), *(path for path, _ in self.others.values()), *files):
            check_free(path, self.force)


def _write(one: _Archive, force: bool) -> None:
    """Write an FMU with the experiment by which it can be checked elsewhere."""

    def export(related: Sequence[Related]) -> Path:
        more = force or bool(related)  # the second time it is our own
        files = (*one.related, *related)
        return export_fmu(one.model, one.path, fmi=one.fmi, force=more, platforms=one.machines, related=files)

    with_experiment(export, sines(one.model), one.machines)


def planned(
    card: str | Path | Card,
    out: str | Path,
    fmi: Fmi | Literal["both"],
    platform: str,
    force: bool,
    kinds: Sequence[str] = (),
    recording: Source | None = None,
) -> Plan:
    """Check everything that `export` was given, and return what will be written; arguments and errors are its own.

    `kinds` are the words of what is wanted beside the FMUs: "ssp", "modelica", "mujoco", ...
    """
    if isinstance(card, str | Path) and _is_system(Path(card)):
        raise InputError(f"{card} is a system, not a card; with --as-fmu it becomes one FMU.", culprit=str(card))
    platforms, folder = platforms_of(platform), Path(out)
    read = card if isinstance(card, Card) else read_card(card)
    stem = Path(read.path).stem or read.plant().name
    versions: tuple[Fmi, ...] = (2, 3) if fmi == "both" else (fmi,)
    others = {kind: make(read, folder, stem) for kind, make in _OTHERS.items() if kind in kinds}
    if "ssp" in kinds:
        others = {"ssp": (folder / f"{stem}.ssp", _system_writer(read, versions[0], platforms))} | others
    plan = Plan(
        archives=tuple(_archives(read, folder, stem, versions, platforms)),
        others=others,
        force=force,
        simulators=loaded(EXPORTS, "simulators")(read, folder, stem, kinds, recording) if kinds else None,
    )
    plan.check()
    return plan


def _is_system(path: Path) -> bool:
    """Whether a file is an SSP or a scenario, which has components."""
    if path.suffix == ".ssp":
        return True
    try:
        return path.suffix == ".toml" and path.is_file() and "components" in parsed(path.read_text("utf-8"))
    except (ValueError, OSError):
        return False


def _archives(
    card: Card, out: Path, stem: str, versions: tuple[Fmi, ...], platforms: tuple[str, ...]
) -> list[_Archive]:
    models = {"plant": card.plant().model()}
    if card.controller is not None:
        models["controller"] = card.controller_model()
    related = {"plant": related_of(card, f"{stem}_plant")}
    return [
        _Archive(out / folder / f"{stem}_{part}_fmi{version}.fmu", model, version, machines, related.get(part, ()))
        for part, model in models.items()
        for version in versions
        for folder, machines in _folders(version, platforms).items()
    ]


def _folders(version: Fmi, platforms: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Subfolders for archives and the machines of each: FMI 2 has one place for two kinds of Linux."""
    both = {"x86_64-linux", "aarch64-linux"} <= set(platforms)
    return {"": platforms} | ({"aarch64-linux": ("aarch64-linux",)} if version == 2 and both else {})


def _system_writer(card: Card, fmi: Fmi, platforms: tuple[str, ...]) -> Writer:
    """Return what writes the SSP of a card to a path, by force or not; refuse a card that cannot have one."""
    from cosim.models.system import system_of
    from pyfmi_models.export.ssp import export_ssp

    system = system_of(card)
    return lambda path, force: export_ssp(system, path, fmi=fmi, force=force, platforms=platforms)


def _modelica_writer(card: Card, out: Path, stem: str, flange: bool = False) -> tuple[Path, Writer]:
    """Return the path of the Modelica package of a card's plant, with flanges or without, and what writes it."""
    from pyfmi_models.derivation import derivation_of
    from pyfmi_models.export.flange import export_flange
    from pyfmi_models.export.modelica import export_modelica, package_name

    plant, write = card.plant(), export_flange if flange else export_modelica
    path = out / f"{package_name(stem)}{'Flange' * flange}.mo"
    return path, lambda path, force: write(plant.model(), path, derivation_of(plant), force=force)


def _c_writer(card: Card, out: Path, stem: str) -> tuple[Path, Writer]:
    """The same of the folder with the plant in C."""
    from pyfmi_models.export.c_function import export_c

    plant = card.plant()
    return out / f"{stem}_c", lambda path, force: export_c(plant.model(), path, force=force)


_OTHERS: dict[str, Callable[[Card, Path, str], tuple[Path, Writer]]] = {
    "modelica": _modelica_writer,
    "modelica_flange": partial(_modelica_writer, flange=True),
    "c": _c_writer,
}
