"""The mount: the parts of an axis together with the model that they make."""

from dataclasses import dataclass

from pyfmi_models.assembly import LINEAR_UNITS, Assembly, Axis, MotionKind
from pyfmi_models.model import Model
from pyfmi_models.plant import plant

__all__ = ["LINEAR_UNITS", "Axis", "Mount", "MotionKind"]


@dataclass(frozen=True, kw_only=True)
class Mount(Assembly):
    """One axis: its inertia, one friction law and any effects, in the order in which they act."""

    def model(self) -> Model:
        """Write the plant as a `Model`: inputs tau and disturbance, output q and more, continuous."""
        return plant(self)
