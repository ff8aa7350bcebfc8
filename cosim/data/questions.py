"""What a file leaves open: each question is a refusal in one sentence that names the option which decides it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import quote

import numpy as np

from cosim.data.columns import Columns
from cosim.data.limits import listed, short
from cosim.data.roles import Guess
from cosim.data.text.names import unit_of_name
from cosim.support.errors import UndecidedError

READ_COLUMNS, READ_ROWS = 6, 3
"""Columns and rows that a question shows as they were read."""
PERIOD = "period"
"""Key of `--layout` for rows without a time: their distance, `1ms`."""
EMPTY, REPEATED = "nan", "repeated"
"""Keys of `--layout` for rows without a value, `gap`, and for rows of one time that differ, `first` or `last`."""
OF_ROWS = (PERIOD, EMPTY, REPEATED)
"""Keys of `--layout` that say what becomes of rows, whatever the format; the others say how a text is written."""


def first_rows(values: Mapping[str, np.ndarray], names: Sequence[str] = ()) -> str:
    """Return the first rows of columns as they were read, for a question: `t 0, 0.001, 0.002; tau 1.2, 1.3, 1.4`."""
    chosen = [*(names or values)][:READ_COLUMNS]
    texts = (f"{short(name)} {', '.join(_cell(one) for one in values[name][:READ_ROWS])}" for name in chosen)
    return f"First rows as read: {'; '.join(texts)}."


def _cell(value: object) -> str:
    return f"{value:.7g}" if isinstance(value, float | np.floating) else short(str(value))


def _question(
    path: Path, text: str, deciding: dict[str, dict[str, str]], value: object, choices: tuple[str, ...] = ()
) -> UndecidedError:
    return UndecidedError(text, decided_by=deciding, culprit=str(path), value=value, choices=choices)


def ambiguous(path: Path, found: Columns, guessed: Guess) -> UndecidedError:
    """Ask which of several columns it is."""
    option = f"--columns {quote(f'{guessed.role}={guessed.among[0]}')}"
    text = (
        f"{path}: {guessed.role} may be any of {listed(guessed.among)}; say which, for example {option}. "
        f"{first_rows(found.values, guessed.among)}"
    )
    return _question(path, text, {"columns": {guessed.role: guessed.among[0]}}, guessed.role, guessed.among)


def current(path: Path, guessed: Guess) -> UndecidedError:
    """Ask for the torque constant of a motor whose current was recorded."""
    name = guessed.among[0]
    text = (
        f'{path} has no torque but a current, "{short(name)}". With the torque constant KT of the motor [N.m/A] it '
        f'becomes one: --columns {quote(f"tau={name}")} --units "tau=KT N.m", for example "tau=0.12 N.m".'
    )
    return _question(path, text, {"columns": {"tau": name}, "units": {"tau": "1 N.m"}}, name, guessed.among)


def share(path: Path, name: str, stated: str) -> UndecidedError:
    """Ask what one unit of a torque is that was recorded as a share of the rated one."""
    text = (
        f'{path}: "{short(name)}" is in {stated} of a torque that the file does not name; say how much one of it is, '
        'for example --units "tau=0.04 N.m".'
    )
    return _question(path, text, {"units": {"tau": "1 N.m"}}, name)


def counted(path: Path, role: str, name: str) -> UndecidedError:
    """Ask how large a count of an encoder is."""
    per_second = "/s" if role == "v" else ""
    text = (
        f'{path}: "{short(name)}" is in counts{per_second}; say how large one is, for example --units '
        f'"{role}=0.0055 deg{per_second}" where a turn has 65,536 of them.'
    )
    return _question(path, text, {"units": {role: f"1 rad{per_second}"}}, name)


def scaled(path: Path, role: str, name: str, text: str) -> UndecidedError:
    """Ask how much one unit of a sensor is, as of a position that is in volts."""
    one = {"tau": "0.5 N.m", "q": "0.1 rad", "v": "0.1 rad/s"}[role]
    sentence = (
        f'{path}: "{short(name)}" is in {text}; say how much one {text} is, for example --units "{role}={one}", or '
        f"which other column is {role} with --columns."
    )
    return _question(path, sentence, {"units": {role: f"1 {one.split()[1]}"}}, text)


def two_units(path: Path, found: Columns, role: str, name: str, both: Sequence[str]) -> UndecidedError:
    """Ask which of two units a column is in that a file states for it, in its name and beside it."""
    text = (
        f'{path} states two units for "{short(name)}", {both[0]} and {both[1]}; say which it is in, --units '
        f"{quote(f'{role}={both[0]}')} or --units {quote(f'{role}={both[1]}')}. {first_rows(found.values, [name])}"
    )
    return _question(path, text, {"units": {role: both[0]}}, name, tuple(both))


FITTING = {"tau": ("N.m", "mN.m"), "q": ("deg", "rad", "mm"), "v": ("rpm", "deg/s", "rad/s", "mm/s")}
"""Units that are offered for a column which states none."""


def no_unit(path: Path, role: str, name: str, why: str) -> UndecidedError:
    """Ask for the unit of a column that states none, and whose values are hardly in SI units."""
    options = " or ".join(f"{role}={text}" for text in FITTING[role])
    number = ', or how much one of it is, "tau=0.04 N.m"' if role == "tau" else ""
    text = (
        f'{path}: "{short(name)}" states no unit and {why}; say which it is in, for example --units {options}{number}.'
    )
    return _question(path, text, {"units": {role: FITTING[role][0]}}, name, FITTING[role])


EXAMPLES = {"t": "ms", "tau": "mN.m", "q": "deg", "v": "deg/s", "q_d": "deg", "temperature": "degC"}
"""A unit for each of our columns, to show how an option is written."""


def unknown_unit(path: Path, role: str, name: str, text: str) -> UndecidedError:
    """Ask for the unit of a column whose own is not known."""
    option = EXAMPLES.get(role, "1")
    kind = "unit of time" if role == "t" else "unit known here"
    sentence = f'{path}: "{short(text)}" of column "{short(name)}" is no {kind}; say which it is in, for example '
    return _question(path, f"{sentence}--units {role}={option}.", {"units": {role: option}}, text)


def may_serve(found: Columns, lacking: Sequence[str], free: Sequence[str]) -> bool:
    """Whether as many columns without a name hold numbers as there are columns of ours to be named beside the time."""
    measured = [name for name in free if _is_measured(found.values[name])]
    others = [rule for rule in lacking if rule != "t"]
    growing = "t" in lacking and any(grows(found.values[name]) for name in measured)
    return len(measured) >= len(others) + growing if measured else "t" in lacking and len(free) >= len(others)


def unnamed(path: Path, found: Columns, lacking: Sequence[str], free: Sequence[str]) -> UndecidedError:
    """Ask for the names of columns without any, of those that are `free`; the first that grows is offered as time."""
    growing = next((name for name in free if grows(found.values[name])), "") if "t" in lacking else ""
    rest = [name for name in free if name != growing and _is_measured(found.values[name])]
    ours = [rule.split("|")[0] for rule in lacking if rule != "t" or growing]
    columns = dict(zip(ours, [growing, *rest] if "t" in ours else rest, strict=False))
    pairs = " ".join(f"{our}={theirs}" for our, theirs in columns.items())
    layout = {} if growing or "t" not in lacking else {PERIOD: "1ms"}
    options = [f"--columns {pairs}"] if pairs else []
    options += [f"--layout {key}={value}" for key, value in layout.items()]
    has = f'has names that do not fit its {len(found.values)} columns, "{short(found.header)}"' if found.header else ""
    text = (
        f"{path} {has or f'does not name its {len(found.values)} columns'}; say which is which, for example "
        f"{' '.join(options)}. {first_rows(found.values)}"
    )
    return _question(path, text, {"columns": columns, "layout": layout}, len(found.values), tuple(found.values))


def counting(path: Path, name: str, step: float, fitting: Sequence[str]) -> UndecidedError:
    """Ask what a column counts that is not named as a time and grows by whole numbers: samples, or a unit of time.

    The example is the first unit that makes the step one of a servo.
    """
    unit = (*fitting, "ms")[0]
    text = (
        f'{path}: "{short(name)}" steps by {step:.6g}; say what one is, for example --units t={unit}, or for samples '
        'that are 0.5 ms apart --units "t=0.5 ms".'
    )
    return _question(path, text, {"units": {"t": unit}}, step)


def rates(path: Path, name: str, step: float, fitting: Sequence[str], said: str) -> UndecidedError:
    """Ask for the unit of a time that may count in several, or in none that is known."""
    unit = (*fitting, "ms")[0]
    text = f'{path}: "{short(name)}" steps by {step:.6g}, which is {said}. Say which with --units t={unit}.'
    return _question(path, text, {"units": {"t": unit}}, step, tuple(fitting))


def too_fast(path: Path, name: str, step: float) -> UndecidedError:
    """Ask for the unit of a time that steps by less than any servo does in seconds, as a spreadsheet's days do."""
    text = (
        f'{path}: "{short(name)}" steps by {step:.3g}, which is {1 / step:.3g} Hz in seconds and '
        f"{1 / (step * 86_400):.4g} Hz in days. Say which with --units t=day, or --units t=s."
    )
    return _question(path, text, {"units": {"t": "day"}}, step, ("day", "s"))


def coarse_time(path: Path, message: str, t: np.ndarray) -> UndecidedError:
    """Ask how far apart rows are whose time [s] is written with too few digits; its whole steps tell about how far."""
    ends = np.flatnonzero(np.diff(t) > 0)
    step = float(t[ends[-1]] - t[ends[0]]) / float(ends[-1] - ends[0]) if len(ends) > 1 else 1e-3
    period = f"{1e3 * step:.3g}ms"
    text = (
        f"{message} It is written with too few digits; if the rows are evenly spaced, say --layout {PERIOD}={period}."
    )
    return _question(path, text, {"layout": {PERIOD: period}}, step)


def empty(path: Path, name: str, said: str) -> UndecidedError:
    """Ask what becomes of rows in which a column that is needed has no value."""
    text = f'{path}: column "{short(name)}" holds {said}. --layout {EMPTY}=gap leaves such rows out: a gap in time.'
    return _question(path, text, {"layout": {EMPTY: "gap"}}, name)


def repeated(path: Path, message: str) -> UndecidedError:
    """Ask which of several rows of one time is the reading; `message` says how they differ."""
    text = f"{message} Leave one of the two out: --layout {REPEATED}=first keeps the first of them, last the last."
    return _question(path, text, {"layout": {REPEATED: "first"}}, REPEATED, ("first", "last"))


def untimed(path: Path, values: Mapping[str, np.ndarray], message: str) -> UndecidedError:
    """Ask which column is the time, or how far apart the rows are; `message` says what there is."""
    growing = next((name for name, column in values.items() if name and grows(column)), "")
    unit, typed = unit_of_name(growing, "t"), f"--columns {quote(f't={growing}')}"
    deciding: dict[str, dict[str, str]] = {"columns": {"t": growing}} if growing else {"layout": {PERIOD: "1ms"}}
    deciding |= {"units": {"t": unit}} if unit else {}
    example = f" (for example {typed}{f' --units t={unit}' if unit else ''})" if growing else ""
    text = f"{message}{example} or, if its rows are evenly spaced, say --layout {PERIOD}=1ms. {first_rows(values)}"
    return _question(path, text, deciding, "t", tuple(values))


def time_by_speed(path: Path, stated: str, fitting: str, name: str, what: str = "the slope") -> UndecidedError:
    """Ask for the unit of a time that the file states, and that makes a speed no slope of the position.

    `what` of the position the column is: its slope, or its second derivative.
    """
    text = (
        f'{path} states its time in {stated}, but "{short(name)}" is {what} of the position only in {fitting}; say '
        f"which it is, --units t={fitting} or --units t={stated}."
    )
    return _question(path, text, {"units": {"t": fitting}}, stated, (fitting, stated))


def position_by_speed(
    path: Path, name: str, fitting: str, is_stated: bool, values: Mapping[str, np.ndarray], what: str = "the slope"
) -> UndecidedError:
    """Ask for the unit of a position whose slope is a speed only in another unit; `what` as in `time_by_speed`."""
    states = "states another unit" if is_stated else "states no unit"
    text = (
        f'{path}: "{short(name)}" is {what} of the position only if that is in {fitting}, and the file {states}; '
        f"say which it is, --units {quote(f'q={fitting}')} or --units q=rad. {first_rows(values, ['t', 'q', name])}"
    )
    return _question(path, text, {"units": {"q": fitting}}, fitting)


def _is_measured(column: np.ndarray) -> bool:
    """Whether a column may be a signal: numbers, and not empty."""
    return column.dtype.kind in "iub" or (column.dtype.kind == "f" and not bool(np.isnan(column).all()))


def grows(column: np.ndarray) -> bool:
    """Whether a column grows from row to row, as a time does."""
    if column.dtype == object or len(column) < 2:
        return column.dtype.kind in "mM"
    return bool(np.all(np.diff(column.astype(np.float64)) > 0)) if column.dtype.kind in "if" else True
