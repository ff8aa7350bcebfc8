"""A scenario or SSP to one FMU; `cosim.export(..., as_fmu=True)`."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal

from cosim.models.cache import with_fmus
from cosim.support.files import check_free, directory
from cosim.system.scenario import Scenario, read_scenario
from cosim_nesting.nest import nest

Fmi = Literal[2, 3]


def export_system(
    scenario: str | Path | Scenario,
    out: str | Path,
    fmi: Fmi | Literal["both"] = "both",
    force: bool = False,
    on_build: Callable[[str], None] = lambda text: None,
) -> tuple[Path, ...]:
    """Write a system as one FMU for co-simulation, NAME_fmi2.fmu and NAME_fmi3.fmu; returns the paths.

    Raises:
        ScenarioError, WiringError, FmuError, SignalError: the system is not good, or has what cannot be nested.
        OutputError: a file is there already; nothing was written then.
    """
    wanted = scenario if isinstance(scenario, Scenario) else read_scenario(str(scenario))
    versions: tuple[Fmi, ...] = (2, 3) if fmi == "both" else (fmi,)
    stem = Path(wanted.path.partition("#")[0]).stem or wanted.name
    paths = {version: Path(out) / f"{stem}_fmi{version}.fmu" for version in versions}
    for path in paths.values():
        check_free(path, force)
    system = with_fmus(wanted, on_build).system()
    directory(Path(out))
    return nest(system, paths)
