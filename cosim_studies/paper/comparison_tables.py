"""The comparison of controllers as data, as CSV and as Markdown."""

import csv
import io
import json
from collections.abc import Iterable, Mapping, Sequence

from cosim.support.plain import Parsed
from cosim_studies.paper.comparison import FEW, A, B, Comparison, Row, Survival
from cosim_studies.paper.frontier import GAIN, GUARD, NOISE, PHASE, Design, frontier
from cosim_studies.paper.margins import Margins

NOMINAL = "nominal"


def tables(found: Comparison) -> Parsed:
    """Return everything as plain data: seeds, rows, designs, the chosen one, robustness."""
    return {
        "test_seeds": list(found.plan.seeds),
        "design_seeds": list(found.plan.design_seeds),
        "asked": {"ratio": GAIN, "phase_deg": PHASE},
        "chosen": design_row(found.chosen, found),
        "options": [option_row(row) for row in found.rows],
        "designs": [design_row(one, found) for one in found.designs],
        "robustness": [survival_row(one) for one in found.survivals],
    }


def option_row(row: Row) -> Parsed:
    """Return one controller in one condition: gain and price."""
    return {
        "condition": row.condition,
        "controller": row.option.key,
        "title": row.option.title,
        "ise_to_C3a": _short(row.ratio),
        "std": _short(row.spread),
        "worst": _short(row.worst),
        "ise_arcsec2_s": _short(row.ise),
        **_priced(row.price),
        "torque_rms_N_m": _short(row.torque),
        "noise_torque_N_m": _short(row.noise),
        "seeds": row.seeds,
        "believes": row.option.knows,
        "controller_keys": json.dumps(row.option.keys),
    }


def design_row(one: Design, found: Comparison) -> Parsed:
    """Return one design as tried on the design seeds in condition A."""
    honest = [design for design in found.designs if design.option.knows == NOMINAL]
    return {
        "controller": one.option.key,
        "title": one.option.title,
        "ise_to_C3a": _short(one.ratio),
        **_priced(one.price),
        "torque_rms_N_m": _short(one.torque),
        "noise_torque_N_m": _short(one.noise),
        "on_frontier_of_phase": one in frontier(honest, "phase"),
        "on_frontier_of_delay": one in frontier(honest, "delay"),
        "chosen": one is found.chosen,
    }


def survival_row(one: Survival) -> Parsed:
    """Return one controller under one stress; the ISE is as a share of that of C3a as designed."""
    stress = one.stress
    return {
        "controller": one.option.key,
        "stress": stress.key,
        "kind": stress.kind,
        "value": stress.value,
        "damping": stress.damping,
        "stable": one.stable,
        "ise_to_C3a": _short(one.ratio),
    }


def _priced(price: Margins) -> Parsed:
    return {
        "stable": price.stable,
        "phase_margin_deg": _short(price.phase),
        "delay_margin_ms": _short(1e3 * price.delay),
        "Ms": _short(price.Ms),
        "crossover_rad_s": _short(price.crossover),
    }


def _short(value: float) -> float:
    return float(f"{value:.5g}")


def rows_csv(rows: Sequence[Parsed]) -> str:
    """Write rows with the same keys as CSV."""
    text = io.StringIO()
    table = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return text.getvalue()


def gain_text(found: Comparison) -> str:
    """Write gain against margin as Markdown, controllers as they compare in conditions A and B."""
    lines = [
        "| controller | ISE/C3a in A | phase | delay | Ms | torque | ISE/C3a in B | phase | delay | Ms | torque |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    others = {row.option.key: row for row in found.of(B)}
    for row in found.of(A):
        if row.option.key in others:
            cells = [*_cells(row), *_cells(others[row.option.key])]
            lines.append(f"| `{row.option.key}`: {row.option.title} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _cells(row: Row) -> list[str]:
    price = row.price
    spread = f" ± {row.spread:.2g}" if row.spread else ""
    margins = [f"{price.phase:.0f}°", f"{1e3 * price.delay:.1f}", f"{price.Ms:.2f}"]
    return [f"{ratio(row.ratio)}{spread}", *margins, f"{row.torque:.1f}"]


def ratio(value: float) -> str:
    """Write a ratio with two digits that count, three above 0.1."""
    return f"{value:.3f}" if value >= 0.01 else f"{value:.1g}"


def frontier_text(found: Comparison) -> str:
    """Write the frontier as Markdown: what each phase margin costs in ISE, on test seeds."""
    lines = [
        "| design | phase | delay margin [ms] | Ms | noise [N m] | ISE/C3a, design seeds | first test seeds |",
        "|---|---|---|---|---|---|---|",
    ]
    tested = {row.option.key: row for row in found.of(A)}
    for one in frontier(design for design in found.designs if design.option.knows == NOMINAL):
        price, row = one.price, tested[one.option.key]
        cells = [f"{price.phase:.1f}°", f"{1e3 * price.delay:.1f}", f"{price.Ms:.2f}", f"{one.noise:.2g}"]
        cells += [ratio(one.ratio), f"{ratio(row.ratio)} ± {row.spread:.2g}"]
        lines.append(f"| {one.option.title} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def learning_text(found: Comparison) -> str:
    """Write what time to learn is worth as Markdown: friction that wanders, friction that repeats."""
    keys = [key for key in ("C3a", "adapting", "learning") if any(row.option.key == key for row in found.rows)]
    lines = [f"| condition | {' | '.join(keys)} |", "|---" * (len(keys) + 1) + "|"]
    for condition, title in _LEARNED.items():
        rows = {row.option.key: row for row in found.of(condition)}
        if rows.keys() >= set(keys):
            cells = [f"{rows[key].ise:.2f} ({ratio(rows[key].ratio)})" for key in keys]
            lines.append(f"| {title} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


_LEARNED = {
    A: "A, from the start",
    f"{A}_settled": "A, after 30 s",
    f"{A}_settled_repeating": "A, after 30 s, friction that repeats",
    B: "B, from the start",
    f"{B}_settled": "B, after 30 s",
    f"{B}_settled_repeating": "B, after 30 s, friction that repeats",
}


def limits_text(found: Comparison) -> str:
    """Write what limits the error as Markdown: ISE [arcsec^2 s] in A with friction that wanders, and without."""
    wandering = {row.option.key: row for row in found.of(A)}
    repeating = {row.option.key: row for row in found.of(f"{A}_repeating")}
    lines = ["| controller | friction wanders | friction repeats |", "|---|---|---|"]
    lines += [f"| {row.option.title} | {wandering[key].ise:.3g} | {row.ise:.3g} |" for key, row in repeating.items()]
    return "\n".join(lines) + "\n"


def lost(survivals: Iterable[Survival], key: str) -> list[str]:
    """Return the stresses under which a controller's loop is not stable."""
    return [one.stress.key for one in survivals if one.option.key == key and not one.stable]


def better(found: Comparison) -> Parsed:
    """Return what the page says of it all."""
    in_a, in_b = ({row.option.key: row for row in found.of(key)} for key in (A, B))
    mine, usual = in_b["chosen"], in_b["C3a"]
    return {
        "seeds": found.plan.seeds,
        "design_seeds": found.plan.design_seeds,
        "gain": gain_text(found),
        "asked": GAIN,
        "phase": PHASE,
        "guarded": f"{GUARD * GAIN:g}",
        "most_noise": f"{NOISE:g}",
        "tried": len(found.designs),
        "title": found.chosen.option.title,
        "ratio_a": in_a["chosen"].ratio,
        "worst_a": in_a["chosen"].worst,
        "ratio_b": mine.ratio,
        "phase_found": min(in_a["chosen"].price.phase, mine.price.phase),
        "delay_found": 1e3 * mine.price.delay,
        "delay_c3a": 1e3 * usual.price.delay,
        "ms_found": mine.price.Ms,
        "ms_c3a": usual.price.Ms,
        "noise_found": mine.noise,
        "noise_c3a": usual.noise,
        **_limits(found, in_a),
        "noise_raw": in_a["C3a"].noise,
        **_advice(in_a, in_b),
        "frontier": frontier_text(found),
        "limits": limits_text(found),
        "learning": learning_text(found),
        "few": FEW,
        "stressed": len(found.plan.stresses),
        "lost": _lost(found, "chosen"),
        "card_keys": [f"{key} = {json.dumps(value)}" for key, value in found.chosen.option.keys.items()],
        "unstable": unstable_text(found),
    }


def _limits(found: Comparison, in_a: Mapping[str, Row]) -> dict[str, str]:
    """What an exact mean friction law leaves of C3a's error in A, and what noise alone leaves of it."""
    repeating = {row.option.key: row for row in found.of(f"{A}_repeating")}
    if "refitted" not in repeating:
        return {"refitted": "-", "floor": "-"}
    floor = repeating["refitted"].ise / in_a["C3a"].ise
    return {"refitted": ratio(in_a["refitted"].ratio), "floor": ratio(floor)}


def _advice(in_a: Mapping[str, Row], in_b: Mapping[str, Row]) -> dict[str, str]:
    """Gains in A as divisors of the ISE, margins as ranges over A and B; of what was compared."""
    gains = {"free_gain": "blend_refitted", "chosen_gain": "chosen", "fourth_gain": "fourth_220"}
    found = {name: f"{1 / in_a[key].ratio:.2g}" if key in in_a else "-" for name, key in gains.items()}
    fourth = [rows["fourth_220"].price for rows in (in_a, in_b) if "fourth_220" in rows]
    return found | {
        "fourth_phase": _range([one.phase for one in fourth], 0),
        "fourth_delay": _range([1e3 * one.delay for one in fourth], 1),
    }


def _range(values: Sequence[float], digits: int) -> str:
    low, high = (f"{edge:.{digits}f}" for edge in (min(values), max(values))) if values else ("-", "-")
    return low if low == high else f"{low} to {high}"


def _lost(found: Comparison, key: str) -> str:
    places = lost(found.survivals, key)
    if places:
        return f"It becomes unstable with {', '.join(places)}."
    worst = max((one for one in found.survivals if one.option.key == key), key=lambda one: one.ratio)
    at = f"at worst ({worst.stress.key}) its ISE is {ratio(worst.ratio)} of C3a's as designed"
    return f"It is stable in every situation of the map below; {at}."


def unstable_text(found: Comparison) -> str:
    """List, for each controller that loses its stability somewhere, where."""
    keys = dict.fromkeys(one.option.key for one in found.survivals)
    lines = [f"- `{key}`: {', '.join(places)}" for key in keys if (places := lost(found.survivals, key))]
    return "\n".join(["Unstable are:", "", *lines, ""]) if lines else "No loop becomes unstable.\n"
