"""Write what was identified: JSON, the new card, a figure for each way, and the summary for a terminal."""

import json
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from cosim.data.recording import Recording
from cosim.estimation.determined import NotDetermined
from cosim.estimation.identify.estimate import Estimate
from cosim.estimation.identify.friction_map import FrictionMap
from cosim.estimation.identify.identify import Identified
from cosim.plots.quantities import number
from cosim.support.files import check_free, directory, replacing
from cosim.support.plain import JsonObject
from cosim.support.version import __version__
from pyfmi_models.card import Card
from pyfmi_models.card_writer import card_text

JSON, CARD = "identify.json", "card.toml"
FILES = (JSON, CARD, "friction_map.svg", "presliding.svg", "output_error.svg")


def check_out(out: Path, force: bool) -> None:
    """Refuse, before any work is done, a folder that holds such files already (raises OutputError)."""
    for name in FILES:
        check_free(out / name, force)


def deliver(found: Identified, recordings: Sequence[Recording], card: Card, out: Path, seconds: float) -> Identified:
    """Write all files into `out`; return the result with the card's origin filled in."""
    from cosim.estimation.identify.figures import FIGURES

    directory(out)
    origin = _origin(recordings)
    found = replace(found, card=replace(found.card, origin=origin))
    with replacing(out / CARD, True) as partial:
        partial.write_text(card_text(found.card, _comment(found, card)), "utf-8")
    for name, draw in FIGURES.items():
        draw(found, recordings, card, out / name)
    with replacing(out / JSON, True) as partial:
        text = json.dumps(as_json(found, card) | {"seconds": round(seconds, 3)}, indent=2, allow_nan=False)
        partial.write_text(text + "\n", "utf-8")
    return found


def as_json(found: Identified, card: Card) -> JsonObject:
    """Return the result as plain data; every estimate has numbers with standard errors."""
    return {
        "friction_map": _map(found),
        "presliding": {
            name: {"torque": one.torque, "linear": _estimate(one.linear), "direct": _estimate(one.direct)}
            for name, one in found.presliding.items()
        },
        "output_error": [_estimate(one) for one in found.output_error],
        "not_determined": {one.variable.name: one.as_json() for one in not_determined(found, card)},
        "not_done": list(found.not_done),
        "origin": found.card.origin,
        "card": CARD,
        "given_card": card.path,
        "version": __version__,
    }


def not_determined(found: Identified, card: Card) -> list[NotDetermined]:
    """Numbers that were to be identified and that nothing determines: the given card's are kept."""
    known = {variable.name: variable for variable in card.plant().parameters()}
    simulated = bool(found.output_error)
    return [NotDetermined(known[name], known[name].start, is_simulated=simulated) for name in found.kept]


def _comment(found: Identified, card: Card) -> str:
    kept = f"\nNot determined by them, and as in the given card: {', '.join(found.kept)}." if found.kept else ""
    return f"{card.mount.name}, identified from recordings; see {JSON}.{kept}"


def _origin(recordings: Sequence[Recording]) -> JsonObject:
    names = [{"name": one.name, "sha256": one.sha256} for one in recordings]
    today = datetime.now(UTC).date().isoformat()
    return {"recordings": names, "version": __version__, "date": today, "command": "cosim identify"}


def _map(found: Identified) -> JsonObject | None:
    if found.map is None:
        return None
    v = np.linspace(found.map.cut, float(np.abs(found.map.samples.v).max()), 60)
    curves = {name: found.map.curve(name, v) for name in found.map.fits}
    return {
        "cut": found.map.cut,
        "keep_inertia": found.map.keep_inertia,
        "directions": {
            name: _estimate(fit)
            | {"speed": v.tolist(), "torque": curves[name][0].tolist(), "band": curves[name][1].tolist()}
            for name, fit in found.map.fits.items()
        },
    }


def _estimate(one: Estimate) -> JsonObject:
    return {
        "parameters": dict(zip(one.names, one.values.tolist(), strict=True)),
        "standard_errors": dict(zip(one.names, one.standard_errors.tolist(), strict=True)),
        "start": dict(zip(one.names, one.start.tolist(), strict=True)),
        "correlation": np.round(one.correlation, 6).tolist(),
        "not_determined": dict(one.held),
        "rms": one.rms.tolist(),
        "evaluations": one.evaluations,
        "warnings": list(one.warnings),
    }


def summary(found: Identified, card: Card) -> str:
    """Return the numbers as lines for a terminal."""
    before = {variable.name: variable.start for variable in card.plant().parameters()}
    lines: list[str] = []
    if found.map:
        lines.append(f"Friction map, above {found.map.cut:.3g} rad/s (or m/s)")
        lines += [line for name in found.map.fits for line in _mapped(found.map, name)]
    for name, one in found.presliding.items():
        lines.append(f"Presliding step {name}, {one.torque:.3g} N.m (or N)")
        lines += [line for way, fit in (("linear", one.linear), ("direct", one.direct)) for line in _lines_of(way, fit)]
    if found.best:
        best = found.best
        lines.append(f"Output error in closed loop, best of {len(found.output_error)} starts")
        lines += [
            f"  {name:24} {number(before[name], 5):>12} -> {number(value, 6):>12} +- {number(error, 2)}"
            for name, value, error in zip(best.names, best.values, best.standard_errors, strict=True)
        ]
        lines += [f"  Mind: {warning}" for warning in best.warnings]
    lines += [one.statement.replace("\N{NO-BREAK SPACE}", " ") for one in not_determined(found, card)]
    return "\n".join([*lines, *(f"Not done: {reason}" for reason in found.not_done)])


def _mapped(found: FrictionMap, name: str) -> list[str]:
    """One map as lines: where single numbers depend on each other, how well the curve is known all the same."""
    fit, line = found.fits[name], f"  {name:9}{_numbers(found.fits[name])}"
    if not fit.warnings:
        return [line]
    band = found.curve(name, np.linspace(found.cut, float(np.abs(found.samples.v).max()), 60))[1].max()
    rule = "these numbers cannot be told apart here, their curve can"
    return [line, f"  Mind, {name}: {rule}: within {band:.2g} N.m or N (95 %)."]


def _lines_of(name: str, fit: Estimate) -> list[str]:
    """One fit as lines: its numbers, and what the recording cannot tell."""
    return [f"  {name:9}{_numbers(fit)}", *(f"  Mind, {name}: {warning}" for warning in fit.warnings)]


def _numbers(fit: Estimate) -> str:
    """Numbers with standard errors; those that these swamp are no numbers."""
    certain, told = fit.certain, []
    for name, error in zip(fit.names, fit.standard_errors.tolist(), strict=True):
        said = f"{number(certain[name], 5)} +- {number(error, 1)}" if name in certain else "not determined"
        told.append(f"{name.split('.')[-1]} {said}")
    told += [f"{name.split('.')[-1]} not determined ({number(value, 4)} is kept)" for name, value in fit.held.items()]
    return ", ".join(told)
