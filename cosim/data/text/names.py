"""Names of columns and the units in them: `q [deg]`, `tau (Nm)`, `M / Nm`, `Torque_mNm`."""

import re
from functools import lru_cache

from cosim.support.errors import UnitError
from cosim.support.units import unit

WORDS = {
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "sek": "s", "sekunden": "s",
    "msec": "ms", "msecs": "ms", "millisecond": "ms", "milliseconds": "ms", "millis": "ms",
    "usec": "us", "usecs": "us", "microsecond": "us", "microseconds": "us", "micros": "us",
    "nsec": "ns", "nanosecond": "ns", "nanoseconds": "ns", "nanosec": "ns",
    "degree": "deg", "degrees": "deg", "grad": "deg", "gon": "0.9 deg", "mdeg": "0.001 deg",
    "radian": "rad", "radians": "rad",
    "\N{PRIME}": "arcmin", "'": "arcmin", "\N{DOUBLE PRIME}": "arcsec", '"': "arcsec",
    "arc-sec": "arcsec", "arcsecond": "arcsec", "arcseconds": "arcsec", "arc-min": "arcmin", "arcminutes": "arcmin",
    "revs": "rev", "revolution": "rev", "revolutions": "rev", "turns": "turn", "rotations": "rev",
    "rps": "rev/s", "r/min": "rpm",
    "n-m": "N.m", "nm": "N.m", "mnm": "mN.m", "n m": "N.m", "newton": "N", "newtons": "N",
    "newton-meter": "N.m", "newton-metre": "N.m", "newtonmeter": "N.m", "mnewtonmeter": "mN.m", "newton-mm": "mN.m",
    "amp": "A", "amps": "A", "ampere": "A", "volt": "V", "volts": "V", "celsius": "degC", "degc": "degC", "c": "degC",
    "percent": "%", "permille": "0.1 %", "\N{PER MILLE SIGN}": "0.1 %",
    "inc": "count", "incs": "count", "increments": "count", "ticks": "count", "pulses": "count",
    "hz": "Hz", "day": "24 h", "days": "24 h", "inch": "2.54 cm", "inches": "2.54 cm",
}  # fmt: skip
"""Units as tools write them in words, in small letters, and how they are written here."""
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
TURNS = {"1/min": "rpm", "u/min": "rpm", "rev/min": "rpm", "min-1": "rpm", "min^-1": "rpm"}
"""Speeds of shafts: turns a minute, though no turn is written."""
CLOCKS = {"millis": "ms", "micros": "us", "nanos": "ns", "seconds": "s"}
"""What microcontrollers call their clocks."""
BRACKETED = re.compile(r"(.*?)\s*[\[(]([^\[\]()]*(?:\([^()]*\))?[^\[\]()]*)[\])]\s*")
ALONE = re.compile(r"[\[(](\w+)[\])]|in (\w+)")
"""A unit that names a column alone, as oscilloscopes do: `[s]`, `in s`."""
SECONDS = ("s", "ms", "us", "ns")
SLASHED = re.compile(r"([^/]*[^/\s])/([^/\s]+)")
"""A unit behind a stroke without blanks, `Lageistwert/mm`; a path has more strokes, or begins with one."""
DIVIDED = re.compile(r"(.+?)(?:\s+/\s+|\s+in\s+|,\s*)(\S+)")
SUFFIXED = re.compile(r"(.+?)_([A-Za-z%]+(?:_(?:s|s2))?)")


@lru_cache(maxsize=4096)
def spelled(text: str) -> str:
    """Return a unit as it is written here, or the text itself where it is no unit that is known."""
    text = text.strip()
    if text.lower() in TURNS:
        return TURNS[text.lower()]
    if text == "Grad":  # the German degree, not 1e9 rad
        return WORDS["grad"]
    if weight := _weighed(text.lower()):
        return weight
    shouted = text.lower() if text.isupper() else ""
    for one in (text, WORDS.get(text.lower(), ""), text.replace("_", "/"), shouted):
        if one and _is_known(one):
            return one
    return text


def _weighed(text: str) -> str:
    """Return a torque as weight times lever in N.m: `oz-in`, `lbf.ft`, `kgf cm`; empty where it is none."""
    bare = re.sub(r"[-.*·⋅ ]", "", text)
    return next((f"{size:.10g} N.m" for name, size in WEIGHED.items() if name.replace("-", "") == bare), "")


def is_unit(text: str) -> bool:
    """Whether a text is a unit that is known, however it is spelled."""
    return bool(text) and not text.isdigit() and _is_known(spelled(text))


def _is_known(text: str) -> bool:
    try:
        unit(text)
    except UnitError:
        return False
    return True


def split_unit(header: str) -> tuple[str, str]:
    """Part the name of a column from the unit in it; the unit is empty where there is none.

    What stands in square brackets is always a unit, unless it is a number (`effort[0]`); elsewhere only what is one.
    """
    header = header.strip()
    if (alone := ALONE.fullmatch(header)) and spelled(alone[1] or alone[2]) in SECONDS:
        return "time", spelled(alone[1] or alone[2])
    if found := BRACKETED.fullmatch(header):
        name, text = found[1].strip(), found[2].strip()
        if name and (is_unit(text) or (header.endswith("]") and not text.isdigit())):
            return name, spelled(text)
    for pattern in (DIVIDED, SLASHED):
        if (found := pattern.fullmatch(header)) and is_unit(found[2]):
            return found[1].strip(), spelled(found[2])
    return header, ""


def bracketed(name: str) -> str:
    """Return what stands in brackets behind a name and may be a unit, `N*inch` of `Torque (N*inch)`, else nothing."""
    found = BRACKETED.fullmatch(name)
    text = found[2].strip() if found else ""
    return "" if text.removeprefix("#").isdigit() else text


def suffixed_unit(name: str) -> str:
    """Return the unit that a name ends with, `Torque_mNm`, `pos_deg`, `vel_rad_s`; empty where it ends with none.

    A single letter is no unit here but `s` and `N`: `q_m` may be the position of a motor.
    """
    if name.lower() in CLOCKS:
        return CLOCKS[name.lower()]
    found = SUFFIXED.fullmatch(name)
    text = found[2] if found else ""
    return spelled(text) if (len(text) > 1 or text in ("s", "N")) and is_unit(text) else ""
