"""Model -> files: C, shared library, FMU. Knows no physics."""

from pyfmi_models.export.archive import export_fmu
from pyfmi_models.export.build import build_library

__all__ = ["build_library", "export_fmu"]
