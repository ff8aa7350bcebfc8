"""FMUs for many runs: one for each structure, its numbers set at the start of each run."""

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from pyfmi_models.export import export_fmu
from pyfmi_models.model import Model


@dataclass(frozen=True)
class Built:
    """An FMU with the parameters that make it the model it stands for."""

    path: Path
    parameters: dict[str, float]

    def with_parameters(self, changes: dict[str, float]) -> "Built":
        """Return the same FMU with other numbers."""
        return Built(self.path, {**self.parameters, **changes})


@dataclass(frozen=True)
class Workshop:
    """Builds FMUs in a folder; models that differ in numbers only share one."""

    folder: Path

    def build(self, model: Model) -> Built:
        """Return the model as an FMU.

        Raises:
            ModelError: the model cannot be exported.
        """
        names = [variable.name for group in (model.inputs, model.parameters, model.states) for variable in group]
        structure = " ".join([model.name, *names, model.equations.serialize()])
        path = self.folder / f"{model.name}-{sha256(structure.encode()).hexdigest()[:16]}.fmu"
        if not path.exists():
            export_fmu(model, path)
        return Built(path, {variable.name: variable.start for variable in model.parameters})
