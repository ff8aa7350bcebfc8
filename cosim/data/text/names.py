"""Names of columns and the units in them: `q [deg]`, `tau (Nm)`, `M / Nm`, `Torque_mNm`, `timeMs`, `ms`."""

import re

from cosim.data.text.unit_words import is_unit, spelled
from cosim.support.units import unit

CLOCKS = {"millis": "ms", "micros": "us", "nanos": "ns", "seconds": "s"}
"""What microcontrollers call their clocks."""
BRACKETED = re.compile(r"(.*?)[\s_]*[\[({<]([^\[\](){}<>]*(?:\([^()]*\))?[^\[\](){}<>]*)[\])}>](?:\s*\.?:?\d+)?\s*")
"""A name with brackets behind it, and the number that a spreadsheet or pandas adds to the second of a name."""
ALONE = re.compile(r"[\[(]([^\[\]()]+)[\])]|in (\w+)")
"""A unit that names a column alone, as oscilloscopes do: `[s]`, `in s`."""
SECONDS = ("s", "ms", "us", "ns")
TIME = (0, 0, 1, 0, 0)
"""Dimension of a time."""
SLASHED = re.compile(r"([^/]*[^/\s])/([^/\s]+)")
"""A unit behind a stroke without blanks, `Lageistwert/mm`; a path has more strokes, or begins with one."""
DIVIDED = re.compile(r"(.+?)(?:\s+/\s+|\s+in\s+|\s*[,:|]\s*)(\S+)")
QUOTIENT = re.compile(r"(.+?)[_.\s]([A-Za-z°]+/[A-Za-z]+2?)")
"""A quotient at the end of a name, `speed_deg/s`."""
PARTS = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-zäöüßµμ]+|[A-Z]+|\d+|[%°]")
ENDINGS = re.compile(
    r"(?:.*?)[a-zäöü0-9)_.\s-]((?:[mkunµ]?N\.?m+)|(?:[mkunµ]?N[.·*]m)|rad/s|deg/s|°/s|°|1/min|min-1|U/min|mA|mN)"
)
"""Units that stand at the end of a name without a sign between, `torqueNm`, or hold a sign that parts words."""
PREFIXES = ("m", "u", "n", "k", "µ")
"""Prefixes that may be glued to a unit which begins with a capital."""
LONGEST = 3
"""Words of the longest unit at the end of a name: `vel_deg_per_s`."""
LETTERS = {"t": ("s",), "tau": ("N", "V"), "v": ("V",), "q": ("V",), "q_d": ("V",), "temperature": ("C", "F", "K")}
"""Units of one letter that may end the name of a column of ours: `q_m` may be the position of a motor."""
ONE_LETTER = {"C": "degC", "F": "degF", "K": "K"}
"""Temperatures by their letter."""


def words_of(name: str) -> tuple[str, ...]:
    """Cut a name into words in small letters: `MAIN.fActPos_2` becomes main, f, act, pos, 2."""
    return tuple(word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-zäöüß]+|\d+", name))


def split_unit(header: str) -> tuple[str, str]:
    """Part the name of a column from the unit in it; the unit is empty where there is none.

    What stands in square brackets is always a unit, unless it is a number (`effort[0]`); elsewhere only what is one.
    """
    header = header.strip()
    if "/" in header and is_unit(header):
        return header, spelled(header)
    if (alone := ALONE.fullmatch(header)) and is_unit(alone[1] or alone[2]):
        text = spelled(alone[1] or alone[2])
        return ("time" if text in SECONDS else header), text
    if found := BRACKETED.fullmatch(header):
        name, text = found[1].strip(), found[2].strip()
        if name and (is_unit(text) or (header.endswith("]") and not text.isdigit())):
            return name, spelled(text)
    for pattern in (DIVIDED, QUOTIENT, SLASHED):
        if (found := pattern.fullmatch(header)) and is_unit(found[2]):
            return found[1].strip(), spelled(found[2])
    return header, ""


def bracketed(name: str) -> str:
    """Return what stands in brackets behind a name and may be a unit, `N*inch` of `Torque (N*inch)`, else nothing."""
    found = BRACKETED.fullmatch(name)
    text = found[2].strip() if found else ""
    return "" if text.removeprefix("#").isdigit() else text


def unit_of_name(name: str, role: str = "") -> str:
    """Return the unit that a name of a column states, wherever it stands in it; empty where it states none.

    Args:
        name: the name as the file has it.
        role: which of our columns it is, which decides what a single letter means and that `ms` anywhere in the name
            of a time is its unit; empty for any other column.
    """
    whole = split_unit(name)[1]
    if not is_unit(whole) and bracketed(name):  # it is asked for: `Winkel (kGrad)` is not in degrees
        return _of_time(name) if role == "t" else ""
    text = whole if is_unit(whole) else suffixed_unit(name, role)
    if role == "tau" and text == "nm":
        return "N.m"  # in small letters as the rest of such names; a torque is in no nanometres
    return text or (_of_time(name) if role == "t" else "")


def suffixed_unit(name: str, role: str = "") -> str:
    """Return the unit that a name ends with, `Torque_mNm`, `pos_deg`, `vel_rad_s`; empty where it ends with none.

    A single letter is no unit here but `s`, `N` and `V`: `q_m` may be the position of a motor.
    """
    if name.lower() in CLOCKS:
        return CLOCKS[name.lower()]
    if (found := ENDINGS.fullmatch(name)) and is_unit(found[1]):
        return spelled(found[1])
    parts = PARTS.findall(name)
    if len(parts) > 1 and parts[-2] in PREFIXES and name.endswith(parts[-2] + parts[-1]):
        texts = (f"{parts[-2]}{parts[-1]}", f"{parts[-2]}{parts[-1].lower()}")  # `pos_mDeg`: thousandths, not degrees
        return next((spelled(text) for text in texts if is_unit(text)), "")
    for count in range(min(LONGEST, len(parts)), 0, -1):
        text = _joined(parts[-count:])
        if text and is_unit(text) and _is_certain(text, len(parts) == count, role):
            return ONE_LETTER.get(text) or spelled(text)
    return ""


def _joined(parts: list[str]) -> str:
    """Return words as the unit that they are together: `rad`, `s` are rad/s; `N`, `m` are N.m."""
    parts = [part.lower() if part[1:].islower() and part != "Nm" else part for part in parts]
    if len(parts) == 1:
        return parts[0]
    if len(parts) == 3:
        if parts[1:] == ["s", "2"]:
            return f"{parts[0]}/s2"
        return f"{parts[0]}/{parts[2]}" if parts[1].lower() in ("per", "p") else ""
    first, second = parts
    if second in ("s", "S", "sec", "min", "s2"):
        return f"{first}/{second.lower()}"
    return f"{first}{second}" if first in ("N", "mN", "kN") and second in ("m", "mm", "cm") else ""


def _is_certain(text: str, alone: bool, role: str) -> bool:
    """Whether the end of a name is a unit, and no other word of the field."""
    if len(text) == 1:
        return text in LETTERS.get(role, ("s", "N", "V")) or (role == "" and alone)
    return role in ("", "t") or alone or unit(spelled(text)).dimension != TIME


def _of_time(name: str) -> str:
    """Return the unit of time that is one of the words of a name, `ms_since_start`; empty where it is not one."""
    units = {spelled(word) for word in words_of(name) if is_unit(word) and unit(spelled(word)).dimension == TIME}
    return units.pop() if len(units) == 1 else ""
