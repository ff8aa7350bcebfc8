"""Units as tools and people write them, and how they are written here: `msec`, `Grad/s`, `U/min`, `oz-in`, `0.001°`.

A text is tried as it is, then by its words: whole (`deg/sec`), then part by part of a quotient, then with the number
in front of it taken off.
"""

import re
from functools import lru_cache

from cosim.support.errors import UnitError
from cosim.support.units import unit

SPELLINGS = {
    "s": "sec, secs, second, seconds, sek, sekunde, sekunden",
    "ms": "msec, msecs, msek, millisecond, milliseconds, millis, millisec, millisekunden",
    "us": "usec, usecs, microsecond, microseconds, micros, microsec",
    "ns": "nsec, nsecs, nanosecond, nanoseconds, nanosec, nanos", "min": "minute, minutes", "h": "hour, hours, hrs",
    "deg": "degree, degrees, degs, grad", "0.9 deg": "gon",
    "0.001 deg": "mdeg, millideg, millidegree, millidegrees, mgrad, milligrad", "1e-06 deg": "udeg",
    "rad": "radian, radians, rads", "mrad": "milliradian, milliradians", "urad": "microrad, microradian, microradians",
    "arcmin": "\N{PRIME}, ', arc-min, arcminute, arcminutes",
    "arcsec": '\N{DOUBLE PRIME}, ", arc-sec, arcsecond, arcseconds, arcsecs',
    "rev": "revs, revolution, revolutions, rotation, rotations, rot, umdrehung, umdrehungen, umdr", "turn": "turns",
    "deg/s": "dps, degps", "0.001 deg/s": "mdps", "rev/s": "rps", "rad/s": "radps", "rpm": "r.p.m.", "m/s": "mps",
    "mm/s": "mmps",
    "N.m": (
        "n-m, nm, n m, newton-meter, newton-metre, newtonmeter, newton meter, newton metre, "
        "newton-meters, newton-metres, newton meters, newton metres"
    ),
    "mN.m": "mnm, mnewtonmeter, millinewtonmeter, millinewton-meter, newton-mm", "N": "newton, newtons",
    "mm": "millimeter, millimetre, millimeters, millimetres", "m": "meter, metre, meters, metres",
    "um": "micron, microns, micrometer, micrometers", "A": "amp, amps, ampere", "mA": "milliamp, milliamps",
    "V": "volt, volts", "degC": "celsius, degc, c", "K": "kelvin", "%": "percent",
    "0.1 %": "permille, \N{PER MILLE SIGN}", "count": "inc, incs, increment, increments, ticks, pulses, cnt, cnts",
    "Hz": "hz", "24 h": "day, days", "2.54 cm": "inch, inches",
}  # fmt: skip
"""Units as they are written here, and how tools write them in words, in small letters."""
WORDS = {word: name for name, words in SPELLINGS.items() for word in words.split(", ")}
OUNCE, POUND, KILOPOND = 0.27801385095, 4.4482216153, 9.80665
"""Forces of the units that weigh [N]: ounce, pound and kilogram on Earth."""
FOOT, INCH, CENTIMETRE = 0.3048, 0.0254, 0.01
"""Lengths of levers [m]."""
WEIGHED = {
    "oz-in": OUNCE * INCH, "ozf-in": OUNCE * INCH, "in-oz": OUNCE * INCH,
    "lb-ft": POUND * FOOT, "lbf-ft": POUND * FOOT, "ft-lb": POUND * FOOT, "ft-lbf": POUND * FOOT,
    "lb-in": POUND * INCH, "lbf-in": POUND * INCH, "in-lb": POUND * INCH, "in-lbf": POUND * INCH,
    "kgf-cm": KILOPOND * CENTIMETRE, "kg-cm": KILOPOND * CENTIMETRE, "kgf-m": KILOPOND,
}  # fmt: skip
"""Torques of units that weigh [N.m]; the sign between may be a point, a blank, a star or none."""
TURNS = {"1/min", "u/min", "rev/min", "min-1", "min^-1", "r/min", "umin", "umdr/min", "tr/min", "rot/min", "giri/min"}
"""Speeds of shafts, turns a minute, of which most write no turn."""
SHOUTED = {"Ms": "ms", "mS": "ms", "MS": "ms", "uS": "us", "Us": "us", "US": "us", "nS": "ns"}
"""Times whose letters are not as they should be: no recording counts megaseconds or siemens where a time is."""
SIGNS = {
    "\N{SUPERSCRIPT MINUS}": "-", "\N{SUPERSCRIPT ONE}": "1", "\N{MULTIPLICATION SIGN}": ".", "\N{BULLET}": ".",
    "\N{DOT OPERATOR}": ".", "\N{BULLET OPERATOR}": ".", "\N{MASCULINE ORDINAL INDICATOR}": "°", "\N{RING ABOVE}": "°",
    " per ": "/", "\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u",
}  # fmt: skip
"""Signs that stand for others."""
NO_LETTERS = "%‰°'\"′″"
"""Signs that are units without a letter."""
INVERSE = re.compile(r"(\w) ?[. ·] ?s-1")
"""A quotient that is written as a power, `rad s-1`."""
NUMBERED = re.compile(r"(?:10(-\d+)|1/(10+)(?= ?[^\d\s])|([\d.]+(?:[eE][+-]?\d+)?))\s*[*x.]?\s*(?=[^\d\s.*])(.+)")
"""A number in front of a unit: `0.001°`, `1e-3 deg`, `10^-3 deg`, `1/100 mm`, `0.01*Nm`."""


@lru_cache(maxsize=4096)
def spelled(text: str) -> str:
    """Return a unit as it is written here, or the text itself where it is no unit that is known."""
    text = text.strip()
    plain = text.rstrip(".") or text
    for sign, other in SIGNS.items():
        plain = plain.replace(sign, other)
    return _spelled(INVERSE.sub(r"\1/s", plain.replace("^", ""))) or text


def _spelled(text: str) -> str:
    """Return a unit as it is written here, empty where it is none."""
    if text.lower() in TURNS:
        return "rpm"
    if text in SHOUTED:
        return SHOUTED[text]
    text = re.sub(r"\bGrad\b", "deg", text)
    if weight := _weighed(text.lower()):
        return weight
    shouted = text.lower() if text.isupper() else ""
    for one in (text, WORDS.get(text.lower(), ""), text.replace("_", "/"), shouted, _quotient(text)):
        if one and _is_known(one):
            return one
    found = NUMBERED.fullmatch(text)
    base = _spelled(found[4]).replace("°C", "degC").replace("°", "deg") if found else ""
    return f"{_number(found):.12g} {base}" if found and base and not base[0].isdigit() else ""


def _number(found: re.Match[str]) -> float:
    power, fraction, number = found[1], found[2], found[3]
    try:
        return 10.0 ** int(power) if power else 1 / int(fraction) if fraction else float(number)
    except (ValueError, OverflowError):
        return 1.0


def _quotient(text: str) -> str:
    """Return a quotient whose parts are words: `degrees/second`, `Grad/sec`; empty where one of them is unknown."""
    parts = text.split("/")
    if not 1 < len(parts) <= 3:
        return ""
    ours = [WORDS.get(part.strip().lower(), part.strip()) for part in parts]
    return "/".join(ours) if all(ours) and all(part[0].isalpha() for part in ours[1:]) else ""


def _weighed(text: str) -> str:
    """Return a torque as weight times lever in N.m: `oz-in`, `lbf.ft`, `kgf cm`; empty where it is none."""
    bare = re.sub(r"[-.*·⋅ ]", "", text)
    return next((f"{size:.10g} N.m" for name, size in WEIGHED.items() if name.replace("-", "") == bare), "")


def is_unit(text: str) -> bool:
    """Whether a text is a unit that is known, however it is spelled."""
    return any(sign.isalpha() or sign in NO_LETTERS for sign in text) and _is_known(spelled(text))


def is_known(text: str) -> bool:
    """Whether a text is a unit that is known, or says that there is none."""
    return text == "1" or is_unit(text)


def _is_known(text: str) -> bool:
    try:
        unit(text)
    except (UnitError, OverflowError):
        return False
    return True


def contradict(one: str, other: str) -> bool:
    """Whether two known units are of one kind of quantity and not of one size."""
    first, second = unit(spelled(one)), unit(spelled(other))
    alike = abs(first.factor - second.factor) <= 1e-6 * abs(first.factor) and first.offset == second.offset
    return first.dimension == second.dimension and not alike
