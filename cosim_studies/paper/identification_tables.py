"""The paper's Tables 2 and 3 beside what identification gives back from a plant that has the paper's numbers."""

import numpy as np

from cosim.estimation.identify.estimate import Estimate
from cosim.support.plain import Parsed
from cosim_studies.paper.identification import (
    CUT,
    PAPER_NOMINAL,
    PEAK,
    SIDES,
    STATIC,
    Identification,
    curve,
    side_of,
    spread,
    true_numbers,
)


def table2(found: Identification) -> list[Parsed]:
    """Rows of Table 2: the paper's numbers, which the plant has, and what the map gives back with standard errors."""
    names = {"positive": "omega > 0", "negative": "omega < 0", "both": "nominal"}
    v = np.linspace(CUT, 0.98 * PEAK, 200)
    rows = []
    for side, title in names.items():
        fit = found.map.fits[side]
        known = true_numbers(side) if side in SIDES else PAPER_NOMINAL
        values = dict(zip(fit.names, fit.values, strict=True))
        errors = dict(zip(fit.names, fit.standard_errors, strict=True))
        row: Parsed = {"case": title}
        for name in STATIC:
            row |= {f"{name}_paper": known[name], name: _short(values[name]), f"{name}_se": _short(errors[name])}
        row["curve_apart_N_m"] = _short(float(np.abs(found.map.curve(side, v)[0] - curve(known, v)).max()))
        rows.append(row)
    return rows


def table3(found: Identification) -> list[Parsed]:
    """Rows of Table 3: bristle stiffness and damping by (16) and by the direct fit, for each step."""
    rows = []
    for step in found.steps:
        known = true_numbers(side_of(step.torque))
        row: Parsed = {
            "step_N_m": step.torque,
            "directions": step.directions,
            "sigma0_paper": known["sigma0"],
            "sigma1_paper": known["sigma1"],
        }
        for way, fit in (("linear", step.found.linear), ("direct", step.found.direct)):
            for place, name in enumerate(("sigma0", "sigma1")):
                row |= {
                    f"{name}_{way}": _short(fit.values[place]),
                    f"{name}_{way}_se": _short(fit.standard_errors[place]),
                }
                row[f"{name}_{way}_ratio"] = _short(fit.values[place] / known[name])
        rows.append(row)
    return rows


def varying(found: Identification) -> list[Parsed]:
    """Rows of what varies: static parameters of each period, fitted to the positive direction."""
    rows = []
    for number, fit in enumerate(found.maps, 1):
        values = dict(zip(fit.names, fit.values, strict=True))
        errors = dict(zip(fit.names, fit.standard_errors, strict=True))
        cells = {
            key: _short(value) for name in STATIC for key, value in ((name, values[name]), (f"{name}_se", errors[name]))
        }
        rows.append({"period": number, **cells})
    return rows


def identified(found: Identification) -> Parsed:
    """Return what the page says of it all."""
    torques = [abs(torque) for _, torque in found.breakaways]
    return {
        "table2": _table2_text(found),
        "table3": _table3_text(found),
        "breakaways": ", ".join(f"{torque:+.2f}" for _, torque in found.breakaways),
        "least": f"{min(torques):.1f}",
        "most": f"{max(torques):.1f}",
        "spread": f"{spread(found.periods):.1f}",
        "seed": found.seed,
        "joint": f"{curve(_values(found.map.fits['both']), np.array([PEAK]))[0]:.2f}",
        "nominal": f"{curve(PAPER_NOMINAL, np.array([PEAK]))[0]:.2f}",
    }


def _table2_text(found: Identification) -> str:
    lines = [f"| case | {' | '.join(STATIC)} | curves apart by at most [N m] |", "|---" * 7 + "|"]
    for row in table2(found):
        cells = [f"{row[n]:.4g} ± {row[f'{n}_se']:.1g} ({row[f'{n}_paper']:g})" for n in STATIC]
        lines.append(f"| {row['case']} | {' | '.join(cells)} | {row['curve_apart_N_m']:.4f} |")
    return "\n".join(lines) + "\n"


def _table3_text(found: Identification) -> str:
    lines = [
        "| step [N m] | plant | (16): sigma0 | (16): sigma1 | direct: sigma0 | direct: sigma1 |",
        "|---|---|---|---|---|---|",
    ]
    plants = {"one": "numbers of this direction both ways", "both": "both directions"}
    for row in table3(found):
        cells = [
            f"{row[f'{name}_{way}']:.5g} ± {row[f'{name}_{way}_se']:.1g} (x {row[f'{name}_{way}_ratio']:.3g})"
            for way in ("linear", "direct")
            for name in ("sigma0", "sigma1")
        ]
        lines.append(f"| {row['step_N_m']:+g} | {plants[row['directions']]} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _values(fit: Estimate) -> dict[str, float]:
    return dict(zip(fit.names, fit.values.tolist(), strict=True))


def _short(value: float) -> float:
    return float(f"{value:.5g}")
