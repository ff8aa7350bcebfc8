"""SSP 1.0 and 2.0 archives of any team, read as the scenario they mean.

What is read: FMUs in the archive, nested systems, SSDs and SSPs (flattened, named `outer/inner`), connections with
transformations, signal dictionaries, parameter bindings with values and mappings, inline or in files, and the default
experiment. Units are converted before a transformation acts. Parameters of an outer system win over those of an inner
one, a later binding over an earlier one. Inputs of the whole system stay at their start values. All outputs that have a
connector are recorded. The step is that of an annotation (Open Simulation Platform, OMSimulator), or the smallest that
an FMU proposes. An SSD in a folder is read as the archive that it would be. Where an archive has several SSDs at its
root, `FILE.ssp#VARIANT.ssd` chooses one.

Reference: System Structure and Parameterization 2.0, Modelica Association 2024.
"""

from pathlib import Path

from cosim.system.ssp.archive import Archive
from cosim.system.ssp.folder import Folder
from cosim.system.ssp.reading import read_structure
from cosim.system.ssp.scenario import scenario_of
from cosim.system.ssp.structure import Structure


def read_ssp(path: Path, outside: bool = False, variant: str = "") -> str:
    """Return the scenario that an SSP means, as the text of a scenario file.

    Args:
        path: the archive, or an SSD of one that lies unpacked.
        outside: sources may lead out of the archive, to files beside it.
        variant: the file or the name of another SSD at the root of the archive than its SystemStructure.ssd.

    Raises:
        ScenarioError: one sentence with the archive, what breaks a rule, and the choices.
        FmuError: one of its FMUs cannot run here.
    """
    archive = Folder(path, outside) if path.suffix == ".ssd" else Archive(path, outside)
    structure = read_structure(archive, variant)
    return scenario_of(structure, _unpacked(structure))


def _unpacked(structure: Structure) -> dict[tuple[str, ...], Path]:
    """Put the FMUs where they can be opened, and return their files by their element."""
    wanted: dict[Archive, list[str]] = {}
    for node in structure.components.values():
        wanted.setdefault(node.file.archive, []).append(node.file.path(node.source))
    found = {archive: archive.unpacked(sources) for archive, sources in wanted.items()}
    nodes = structure.components.items()
    return {path: found[node.file.archive][node.file.path(node.source)] for path, node in nodes}


__all__ = ["read_ssp"]
