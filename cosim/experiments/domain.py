"""Where a model is proven: the operational domain that an FMU states in its metadata (SRMD).

A classification has an entry for each end and the unit: `operational_domain.speed.low`, `.high`, `.unit`.
Reference: SSP Traceability, Simulation Resource Meta Data 1.0.0, Modelica Association.
"""

from dataclasses import dataclass
from pathlib import Path

from cosim.experiments.manifest import Manifest
from cosim.experiments.xml_member import plain, xml_in

SRMD = "application/x-srmd-meta-data"
KEY = "operational_domain"


@dataclass(frozen=True)
class Domain:
    """A quantity and the range within which the model is proven."""

    name: str
    low: float
    high: float
    unit: str

    def __str__(self) -> str:
        return f"{self.name} {self.low:.4g} to {self.high:.4g} {self.unit}".rstrip()


def entries_of(domains: tuple[Domain, ...]) -> dict[str, dict[str, str]]:
    """The facts that metadata hold of domains, by name."""
    return {one.name: {"low": repr(one.low), "high": repr(one.high), "unit": one.unit} for one in domains}


def domains_in(path: Path, manifest: Manifest) -> tuple[Domain, ...]:
    """Read the domains that the metadata of an FMU state; those that are no numbers are left out.

    Raises:
        FmuError: the metadata cannot be read.
    """
    found: dict[str, dict[str, str]] = {}
    for file in manifest.related:
        if file.kind != SRMD or file.main_role != "meta-data":
            continue
        for element in xml_in(path, file.member).iter():
            first, _, rest = element.get("keyword", "").partition(".")
            if plain(element) == "ClassificationEntry" and first == KEY:
                name, _, end = rest.rpartition(".")
                found.setdefault(name, {})[end] = (element.text or "").strip()
    return tuple(one for name, ends in found.items() if (one := _domain(name, ends)) is not None)


def _domain(name: str, ends: dict[str, str]) -> Domain | None:
    try:
        return Domain(name, float(ends["low"]), float(ends["high"]), ends.get("unit", ""))
    except (KeyError, ValueError):
        return None
