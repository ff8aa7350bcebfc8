"""Where a model is proven: the operational domain that an FMU states in its metadata (SRMD).

A classification has an entry for each end and the unit: `operational_domain.speed.low`, `.high`, `.unit`; and
`.variable`, where the quantity is called otherwise than the variable of the FMU.
Reference: SSP Traceability, Simulation Resource Meta Data 1.0.0, Modelica Association.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from cosim.fmi.manifest import Manifest, manifest_of
from cosim.fmi.xml_member import plain, xml_in
from cosim.support.errors import FmuError

SRMD = "application/x-srmd-meta-data"
KEY = "operational_domain"


@dataclass(frozen=True)
class Domain:
    """A quantity and the range within which the model is proven; `variable` is what the FMU calls it."""

    name: str
    low: float
    high: float
    unit: str
    variable: str = ""

    def __str__(self) -> str:
        return f"{self.name} {self.low:.4g} to {self.high:.4g} {self.unit}".rstrip()


def entries_of(domains: tuple[Domain, ...]) -> dict[str, dict[str, str]]:
    """The facts that metadata hold of domains, by name."""
    return {
        one.name: {"low": repr(one.low), "high": repr(one.high), "unit": one.unit}
        | ({"variable": one.variable} if one.variable else {})
        for one in domains
    }


def domains_of(entries: object) -> tuple[Domain, ...]:
    """The domains that facts hold, as `entries_of` makes them; those that are no ranges are left out."""
    if not isinstance(entries, Mapping):
        return ()
    return tuple(one for name, ends in entries.items() if (one := _domain(str(name), ends)) is not None)


def domains_in(path: Path, manifest: Manifest) -> tuple[Domain, ...]:
    """Read the domains that the metadata of an FMU state; those that are no ranges are left out.

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
    return domains_of(found)


def domains_at(path: Path) -> tuple[Domain, ...]:
    """The domains of an FMU; none where its metadata cannot be read, which does not keep it from running."""
    try:
        manifest = manifest_of(path)
        return domains_in(path, manifest) if manifest else ()
    except FmuError:
        return ()


def _domain(name: str, ends: Any) -> Domain | None:
    try:
        found = Domain(name, float(ends["low"]), float(ends["high"]), ends.get("unit", ""), ends.get("variable", ""))
    except (KeyError, ValueError, TypeError, AttributeError):
        return None
    return found if isfinite(found.high - found.low) and found.low <= found.high else None
