"""What a reproduction should show, beside what it shows: numbers with their tolerances."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cosim_studies.paper.tables import ratios_of


@dataclass(frozen=True)
class Check:
    """One number with the range in which it was expected."""

    name: str
    found: float
    low: float
    high: float

    @property
    def met(self) -> bool:
        """Whether the number is in its range."""
        return self.low <= self.found <= self.high


def checks(table: Mapping[str, Any]) -> list[Check]:
    """Compare Table 4 as simulated with the errata's numbers (deterministic) and the paper's ratios (statistical)."""
    base = [("C3b", 0.736, 0.01), ("C2b", 0.353, 0.01), ("C3a", 0.013, 0.002)]
    wide = [("C2a", 0.27, 0.07), ("C2b", 1.55, 0.3), ("C3a", 0.195, 0.06), ("C3b", 0.87, 0.1)]
    found = [Check(f"ideal: {case}/C1", ratios_of(table["ideal"])[case], 0.0, 1e-3) for case in ("C2a", "C3a")]
    found.append(_about("base: C1 [arcsec^2 s]", table["base"]["C1"], 93.2, 0.932))
    found += [_about(f"base: {case}/C1", ratios_of(table["base"])[case], *asked) for case, *asked in base]
    found.append(_about("base, kp 255: C1 [arcsec^2 s]", table["base_kp255"]["C1"], 75.2, 0.752))
    for key, name in (("realistic", "realistic A"), ("realistic_observer", "realistic B")):
        found.append(Check(f"{name}: share of seeds in the paper's order", table[key]["order_share"], 0.9, 1.0))
        found += [_about(f"{name}: mean {case}/C1", ratios_of(table[key])[case], *asked) for case, *asked in wide]
    return found


def _about(name: str, found: float, middle: float, tolerance: float) -> Check:
    return Check(name, found, middle - tolerance, middle + tolerance)
