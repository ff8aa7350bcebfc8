"""SWEEP.toml, read and checked."""

import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cosim.support.complaint import Location, complaint
from cosim.support.errors import SweepError
from cosim.support.numbers import Count, Seconds
from cosim.support.plain import Parsed
from cosim.support.toml import parsed
from cosim_sweeps.design import Design, grid, latin_hypercube, monte_carlo
from cosim_sweeps.statistics import Statistic
from cosim_sweeps.variation import LIMIT, Variation, kind_of

OWN = ("run", "seconds", "status", "reason")
"""Columns of every table."""


KEPT = (
    ' It says what is kept of each run, for example: [statistics] error = { signal = "q_d", minus = "q", kind = "rms" }'
)
"""What to write where nothing is kept."""


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    scenario: str
    method: Literal["grid", "latin_hypercube", "monte_carlo"] = "grid"
    runs: int | None = Field(default=None, ge=1)
    seed: int = Field(default=0, ge=0)
    decimation: Count | None = None
    timeout: Seconds | None = None
    record: bool = False
    vary: dict[str, Any] = Field(min_length=1)
    statistics: dict[str, Statistic] = Field(min_length=1)


@dataclass(frozen=True)
class Sweep:
    """A checked sweep; `scenario` is a file or the name of a shipped one."""

    path: str
    scenario: str
    method: str
    variations: Mapping[str, Variation]
    design: Design
    statistics: Mapping[str, Statistic]
    decimation: int | None
    timeout: float | None
    record: bool
    content: str

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the table's columns."""
        return ("run", *self.variations, *self.statistics, "seconds", "status", "reason")

    def fits(self, row: Parsed) -> bool:
        """Whether a row read from a file is one of this sweep: its columns, a run that there is, words and numbers."""
        if set(row) != set(self.columns) or not 0 <= row["run"] < self.design.runs:
            return False
        texts = (row["status"], row["reason"])
        numbers = [row[name] for name in (*self.variations, *self.statistics, "seconds")]
        return all(isinstance(one, str) for one in texts) and all(isinstance(one, int | float) for one in numbers)


def read_sweep(path: Path) -> Sweep:
    """Read a sweep.

    Raises:
        SweepError: one sentence that names file, key, value and rule.
    """
    try:
        raw = _File.model_validate(parsed(path.read_text("utf-8")))
    except OSError as error:
        raise SweepError(f"{path}: no such sweep; a sweep is a .toml file.", culprit=str(path)) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SweepError(f"{path} is not valid TOML: {error}.", culprit=str(path)) from error
    except ValidationError as error:
        said = complaint(error, str(path), "a sweep", _keys)
        said["message"] += KEPT if said["message"].endswith('"statistics" is missing.') else ""
        raise SweepError(**said) from error
    variations = {name: _variation(name, given, path) for name, given in raw.vary.items()}
    _check_names(path, variations, raw.statistics)
    beside = path.parent / raw.scenario
    return Sweep(
        path=str(path),
        scenario=str(beside) if beside.is_file() else raw.scenario,
        method=raw.method,
        variations=variations,
        design=_design(raw, variations, path),
        statistics=raw.statistics,
        decimation=raw.decimation,
        timeout=raw.timeout,
        record=raw.record,
        content=json.dumps(raw.model_dump(mode="json", by_alias=True)),
    )


def _variation(name: str, given: Any, path: Path) -> Variation:
    kind = kind_of(given)
    table = given if isinstance(given, dict) else {"values": given}
    try:
        return kind.model_validate({"of": name} | table)
    except ValidationError as error:
        legal = tuple(kind.model_fields)
        raise SweepError(**complaint(error, f"{path}: vary.{name}", "it", lambda _: legal)) from error


def _check_names(path: Path, variations: Mapping[str, Variation], statistics: Mapping[str, Statistic]) -> None:
    for name in statistics:
        if name in variations or name in OWN:
            taken = f"the columns {', '.join(OWN)} and what is varied have theirs"
            raise SweepError(f"{path}: statistics.{name}: choose another name; {taken}.", culprit=name)
    for name in variations:
        if name in OWN:
            raise SweepError(
                f"{path}: vary.{name}: every table has a column of this name; choose another.", culprit=name
            )
    targets = [target for variation in variations.values() for target in variation.of]
    twice = next((target for target in targets if targets.count(target) > 1), None)
    if twice:
        raise SweepError(f'{path}: "{twice}" is varied twice; once is enough.', culprit=twice)


def _design(raw: _File, variations: Mapping[str, Variation], path: Path) -> Design:
    every = tuple(variations.values())
    if raw.method == "grid":
        _check_grid(raw, variations, path)
        design = grid(every)
    elif raw.runs is None:
        raise SweepError(f'{path}: method = "{raw.method}" needs runs, how many points are drawn.', culprit="runs")
    else:
        _check_drawn(raw, variations, path)
        draw = latin_hypercube if raw.method == "latin_hypercube" else monte_carlo
        design = draw(every, raw.runs, raw.seed)
    if design.runs > LIMIT:
        message = f"{path} asks for {design.runs:,} runs; {LIMIT:,} is the most of one sweep."
        raise SweepError(message, culprit=str(path), value=design.runs)
    return design


def _check_grid(raw: _File, variations: Mapping[str, Variation], path: Path) -> None:
    if raw.runs is not None:
        message = f'{path}: runs = {raw.runs} does not go with method = "grid", whose counts say how many there are.'
        raise SweepError(message, culprit="runs", value=raw.runs)
    for name, variation in variations.items():
        if not variation.grid():
            rule = "a grid needs a list of values, or low, high and count"
            raise SweepError(f"{path}: vary.{name} has no points: {rule}.", culprit=name)


def _check_drawn(raw: _File, variations: Mapping[str, Variation], path: Path) -> None:
    for name, variation in variations.items():
        if getattr(variation, "count", None) is not None:
            message = (
                f'{path}: vary.{name}.count belongs to a grid; method = "{raw.method}" draws as many as runs says.'
            )
            raise SweepError(message, culprit=name)


def _keys(location: Location) -> tuple[str, ...]:
    section = Statistic if location[0] == "statistics" and len(location) > 1 else _File
    return tuple(field.alias or name for name, field in section.model_fields.items())
