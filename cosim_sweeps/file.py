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
from cosim_sweeps.statistics import Statistic
from cosim_sweeps.variation import LIMIT, Design, Variation, drawn, grid, kind_of

OWN = ("run", "seconds", "status", "reason")
"""Columns of every table."""
KEPT = (
    ' It says what is kept of each run, for example: [statistics] error = { signal = "q_d", minus = "q", kind = "rms" }'
)
"""What to write where nothing is kept."""


class Settings(BaseModel):
    """The file as it is written."""

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
    variations: Mapping[str, Variation]
    design: Design
    settings: Settings

    @property
    def statistics(self) -> Mapping[str, Statistic]:
        """What is kept of a run, by name."""
        return self.settings.statistics

    @property
    def content(self) -> str:
        """The file as JSON, its defaults written out."""
        return json.dumps(self.settings.model_dump(mode="json", by_alias=True))

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the table's columns."""
        return (OWN[0], *self.variations, *self.statistics, *OWN[1:])

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
        raw = Settings.model_validate(parsed(path.read_text("utf-8")))
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
    scenario = path.parent / raw.scenario
    known = str(scenario) if scenario.is_file() else raw.scenario
    return Sweep(str(path), known, variations, _design(raw, variations, path), raw)


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
            text = f"{path}: vary.{name}: every table has a column of this name; choose another."
            raise SweepError(text, culprit=name)
    targets = [target for variation in variations.values() for target in variation.of]
    twice = next((target for target in targets if targets.count(target) > 1), None)
    if twice:
        raise SweepError(f'{path}: "{twice}" is varied twice; once is enough.', culprit=twice)


def _design(raw: Settings, variations: Mapping[str, Variation], path: Path) -> Design:
    every = tuple(variations.values())
    if raw.method == "grid":
        if raw.runs is not None:
            rule = 'does not go with method = "grid", whose counts say how many there are'
            raise SweepError(f"{path}: runs = {raw.runs} {rule}.", culprit="runs", value=raw.runs)
        if empty := [name for name, one in variations.items() if not one.grid()]:
            rule = "a grid needs a list of values, or low, high and count"
            raise SweepError(f"{path}: vary.{empty[0]} has no points: {rule}.", culprit=empty[0])
        design = grid(every)
    else:
        if raw.runs is None:
            raise SweepError(f'{path}: method = "{raw.method}" needs runs, how many points are drawn.', culprit="runs")
        if counted := [name for name, one in variations.items() if getattr(one, "count", None) is not None]:
            rule = f'belongs to a grid; method = "{raw.method}" draws as many as runs says'
            raise SweepError(f"{path}: vary.{counted[0]}.count {rule}.", culprit=counted[0])
        design = drawn(every, raw.runs, raw.seed, latin=raw.method == "latin_hypercube")
    if design.runs > LIMIT:
        message = f"{path} asks for {design.runs:,} runs; {LIMIT:,} is the most of one sweep."
        raise SweepError(message, culprit=str(path), value=design.runs)
    return design


def _keys(location: Location) -> tuple[str, ...]:
    section = Statistic if location[0] == "statistics" and len(location) > 1 else Settings
    return tuple(field.alias or name for name, field in section.model_fields.items())
