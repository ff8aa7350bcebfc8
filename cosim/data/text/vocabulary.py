"""What tools call the columns of a plain table, and the units that their manuals give to them.

A name tells a tool only together with others: `POSITION` may stand in any table, beside `MODE` and `Q_CURRENT` it is
moteus'. Sources: moteus, `lib/python/examples/csv_output.py` and the register table of its reference; ODrive, property
reference of firmware 0.5 and later (positions in turns); VESC Tool, its log files; LabVIEW, specification of its
measurement files (.lvm); PlotJuggler, its CSV export;
SINAMICS S120 list manual (r0063, r0079, r0080); Siemens' trace shows the parameter in front of its name.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from cosim.data.columns import Columns


@dataclass(frozen=True)
class Vocabulary:
    """The columns of a tool: which tell it, their units, and which of them serve as ours, best first."""

    tool: str
    told_by: tuple[str, ...]
    """Patterns of names that must all be there."""
    units: Mapping[str, str]
    """Pattern of a name to its unit."""
    roles: Mapping[str, tuple[str, ...]]
    """Our name to patterns of theirs, best first."""


VOCABULARIES = (
    Vocabulary(
        "moteus",
        ("MODE", "POSITION", "VELOCITY"),
        {
            "time": "s",
            "(CONTROL_)?POSITION|ENCODER_\\d_POSITION|ABS_POSITION": "rev",
            "(CONTROL_)?VELOCITY": "rev/s",
            "(CONTROL_)?TORQUE": "N.m",
            "[DQ]_CURRENT": "A",
            "(MOTOR_)?TEMPERATURE": "degC",
            "VOLTAGE": "V",
        },
        {
            "t": ("time",),
            "tau": ("CONTROL_TORQUE", "TORQUE"),
            "q": ("POSITION",),
            "q_d": ("CONTROL_POSITION",),
            "v": ("VELOCITY",),
            "temperature": ("MOTOR_TEMPERATURE", "TEMPERATURE"),
        },
    ),
    Vocabulary(
        "ODrive",
        (
            r".*\bpos_(estimate|rel|abs)",
            r".*\b(Iq_(setpoint|measured)|(effective_)?torque_setpoint|torque_estimate|input_torque)",
        ),
        {
            r".*\b(pos_(estimate|rel|abs|setpoint)|input_pos)": "turn",
            r".*\b(vel(_estimate|_setpoint)?|input_vel)": "turn/s",
            r".*\b((effective_)?torque_setpoint|torque_estimate|input_torque)": "N.m",
            r".*\bI[qd]_(setpoint|measured)": "A",
            r".*\btemperature": "degC",
        },
        {
            "tau": (r".*\beffective_torque_setpoint", r".*\btorque_setpoint", r".*\btorque_estimate"),
            "q": (r".*\bpos_estimate", r".*\bpos_rel", r".*\bpos_abs"),
            "q_d": (r".*\bpos_setpoint", r".*\binput_pos"),
            "v": (r".*\bvel_estimate",),
        },
    ),
    Vocabulary(
        "VESC Tool",
        ("ms_today", "current_motor", "erpm"),
        {"ms_today": "ms", "encoder_position": "deg", "current_(motor|in)|[dq]_axis_current": "A", "temp_.*": "degC"},
        {"t": ("ms_today",), "q": ("encoder_position",), "temperature": ("temp_motor",)},
    ),
    Vocabulary(
        "SINAMICS",
        (r"(.*[.:])?r0*(80|79)\b.*",),
        {r"(.*[.:])?r0*(80|79)\b.*": "N.m", r"(.*[.:])?r0*6[0-3]\b.*": "rpm", r"(.*[.:])?r0*482\b.*": "count"},
        {"tau": (r"(.*[.:])?r0*79\b.*", r"(.*[.:])?r0*80\b.*"), "v": (r"(.*[.:])?r0*63\b.*", r"(.*[.:])?r0*61\b.*")},
    ),
    Vocabulary("LabVIEW", ("X_Value",), {}, {"t": ("X_Value",)}),
    Vocabulary("PlotJuggler", ("__time",), {"__time": "s"}, {"t": ("__time",)}),
)


def with_vocabulary(columns: Columns) -> Columns:
    """Give columns whose names tell their tool the units and meanings that its manual gives them."""
    one = next((one for one in VOCABULARIES if all(_matching(name, columns) for name in one.told_by)), None)
    if one is None:
        return columns
    units = {name: unit for pattern, unit in one.units.items() for name in _matching(pattern, columns)}
    found = {
        ours: next((_matching(name, columns) for name in names if _matching(name, columns)), [])
        for ours, names in one.roles.items()
    }
    roles = {ours: names[0] for ours, names in found.items() if len(names) == 1}
    return replace(columns, format=one.tool, units=units | columns.units, roles=roles)


def _matching(pattern: str, columns: Columns) -> list[str]:
    full = [name for name, column in columns.values.items() if column.dtype.kind != "f" or not np.isnan(column).all()]
    return [name for name in full if re.fullmatch(pattern, name)]
