"""SSP 1.0 archives of any team, read as the scenario they mean.

What is read: FMUs in the archive, nested systems (flattened, named `outer/inner`), connections with linear
transformations, parameter bindings with values and mappings, inline or in files, and the default experiment. A
transformation acts before units are converted. Parameters of an outer system win over those of an inner one, a later
binding over an earlier one. Inputs of the whole system stay at their start values. All outputs that have a connector
are recorded. The step is that of the annotation of the Open Simulation Platform, or the smallest that an FMU proposes.

Reference: System Structure and Parameterization 1.0, Modelica Association 2019.
"""

from pathlib import Path

from cosim.ssp.archive import Archive
from cosim.ssp.meaning import scenario_of
from cosim.ssp.structure import read_structure


def read_ssp(path: Path) -> tuple[str, Path]:
    """Return the scenario that an SSP means, as the text of a scenario file, and the folder of its FMUs.

    Raises:
        ScenarioError: one sentence with the archive, what breaks a rule, and the choices.
        FmuError: one of its FMUs cannot run here.
    """
    structure = read_structure(Archive(path))
    sources = structure.archive.unpacked([node.source for node in structure.components.values()])
    return scenario_of(structure, sources), next(iter(sources.values())).parent


__all__ = ["read_ssp"]
