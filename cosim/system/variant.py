"""An archive may hold several systems: `FILE.ssp#VARIANT.ssd` names one of them."""

from pathlib import Path


def ssp_of(source: str | Path) -> tuple[Path | None, str]:
    """Return the SSP or SSD that a source means, and which of its systems; None where it means neither.

    The second is the file of another SSD at the root, or the name that it has; "" is the system that is run by default.
    """
    whole, (file, _, variant) = Path(source), str(source).partition("#")
    found, variant = (whole, "") if whole.exists() else (Path(file), variant)
    return (found if found.suffix in (".ssp", ".ssd") else None), variant
