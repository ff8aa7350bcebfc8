"""Small files as machines' tools write them, made here in the documented formats: `python bench/samples.py`.

All hold the same motion of an axis, 0.8 s at 200 Hz: a torque [N.m], a position [rad] and its set point. What each
format looks like, and where that is documented, stands in docs/reading.md. Text is kept in tests/samples; what is
binary is made when a test needs it.
"""

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

ROWS, DT = 160, 0.005
T = np.arange(ROWS) * DT
Q_D = 0.2 * np.sin(2 * np.pi * T)
Q = 0.2 * np.sin(2 * np.pi * (T - 0.01))
TAU = 1.5 * np.tanh(np.gradient(Q, DT) / 0.1) + 0.02 * np.gradient(np.gradient(Q, DT), DT)
DEG, TURN, KT = np.pi / 180, 2 * np.pi, 0.12
START = np.datetime64("2024-03-01T22:13:04.000", "ms")
FILETIME = 133_538_047_840_000_000
"""START in units of 100 ns since 1601."""
PERIOD, TRAIN = 480.0, 4.2
"""Period of a worm [s] and its amplitude [arcsec], in the guide log."""


def table(
    names: Sequence[str], columns: Iterable[np.ndarray], separator: str, decimal: str = ".", form: str = ".9g"
) -> str:
    lines = [separator.join(names)] if names else []
    for row in zip(*columns, strict=True):
        lines.append(separator.join(f"{x:{form}}".replace(".", decimal) for x in row))
    return "\n".join(lines) + "\n"


def stamps() -> list[str]:
    return [str(START + np.timedelta64(round(1000 * t), "ms")) for t in T]


def twincat() -> str:
    """One time column for all channels of a sample time; German Windows."""
    names = ["MAIN.fTorqueCmd", "MAIN.fActPos", "MAIN.fSetPos"]
    head = [
        "Name\tAzimuth\nFile\tC:\\Scope\\Azimuth.csv",
        f"Starttime of export\t{FILETIME}\tFreitag, 1. März 2024\t22:13:04.000",
    ]
    head += [f"Endtime of export\t{FILETIME + 8 * 10**6}\tFreitag, 1. März 2024\t22:13:04.800", "", ""]
    facts = {
        "Name": [name.removeprefix("MAIN.f") for name in names],
        "SymbolComment": [""] * 3,
        "Data-Type": ["REAL64"] * 3,
    }
    facts |= {"SampleTime[ms]": ["5"] * 3, "VariableSize": ["8"] * 3, "SymbolBased": ["True"] * 3, "SymbolName": names}
    facts |= {"NetID": ["5.35.12.1.1.1"] * 3, "Port": ["851"] * 3, "Offset": ["0"] * 3, "ScaleFactor": ["1"] * 3}
    facts |= {"Unit": ["Nm (Torque)", "° (Angle)", "° (Angle)"]}
    head += ["\t".join([key, *values]) for key, values in facts.items()]
    return "\n".join(head) + "\n\n" + table((), (1000 * T, TAU, Q / DEG, Q_D / DEG), "\t", ",")


def twincat_times() -> str:
    """A time column for every channel, full time stamps, a slow channel that ends early, and the mark of the end."""
    names = ("TorqueCmd", "ActPos", "MotorTemp")
    head = [
        f"Name;Azimuth\nFile;Azimuth.csv\nStarttime of export;{FILETIME}\nEndtime of export;{FILETIME + 8 * 10**6}\n"
    ]
    head += [
        ";".join(x for name in names for x in ("Name", name)),
        ";".join(x for _ in names for x in ("Data-Type", "REAL64")),
    ]
    head += [";".join(x for step in (5, 5, 50) for x in ("SampleTime[ms]", str(step)))]
    head += [";".join(x for unit in ("Nm (Torque)", "rad (Angle)", "(None)") for x in ("Unit", unit))]
    rows = []
    for row in range(ROWS):
        stamp = FILETIME + round(T[row] * 1e7)
        cells = [f"{stamp}", f"{TAU[row]:.9g}", f"{stamp}", f"{Q[row]:.9g}"]
        cells += [f"{FILETIME + round(T[row] * 1e8)}", "21.5"] if row < ROWS // 10 else []
        rows.append(";".join(cells))
    return "\n".join([*head, "", *rows, "EOF"]) + "\n"


def tia_trace() -> str:
    """A table of an engineering tool on a German Windows: units in the names, semicolons, decimal commas."""
    names = (
        "Zeit [ms]",
        "Axis_1.StatusTorqueData.ActualTorque [Nm]",
        "Axis_1.ActualPosition [°]",
        "Axis_1.Position [°]",
    )
    return table(names, (1000 * T, TAU, Q / DEG, Q_D / DEG), ";", ",").replace(
        "Axis_1.Position", "Axis_1.PositionSetpoint"
    )


def sinamics() -> str:
    names = ("Time", "Drive_1.r79: Torque setpoint total", "Drive_1.r80: Torque actual value smoothed")
    names += ("Drive_1.r482[0]: Encoder actual position value Gn_XIST1",)
    units = ",".join(["ms", "Nm", "Nm", ""])
    head, body = table(names, (1000 * T, TAU, 0.98 * TAU, np.round(Q / TURN * 2**20)), ",").split("\n", 1)
    return f"{head}\n{units}\n{body}"


def halscope() -> str:
    lines = (
        f"joint.0.torque-cmd {a:+.14f} joint.0.motor-pos-fb {b:+.14f} joint.0.motor-pos-cmd {c:+.14f} "
        for a, b, c in zip(TAU, Q / DEG, Q_D / DEG, strict=True)
    )
    return "Sampling period is 5000000 ns \n\n" + "\n".join(lines)


def halsampler() -> str:
    return table((), (TAU, Q / DEG), " ", form=".6f").replace("\n", " \n")


def halsampler_tagged() -> str:
    return "".join(f"{row} {a:.6f} {b:.6f} \n" for row, (a, b) in enumerate(zip(TAU, Q / DEG, strict=True)))


def odrive_capture() -> str:
    """`numpy.savetxt` of the data of a BulkCapture: time, pos_estimate, torque_setpoint, without names."""
    return table((), (T, Q / TURN, TAU), " ", form=".18e")


def odrive() -> str:
    names = ("time", "axis0.pos_estimate", "axis0.controller.pos_setpoint", "axis0.motor.foc.Iq_measured")
    return table(names, (T, Q / TURN, Q_D / TURN, TAU / KT), ",")


def moteus() -> str:
    names = ("time", "MODE", "POSITION", "VELOCITY", "TORQUE", "Q_CURRENT", "VOLTAGE", "TEMPERATURE", "FAULT")
    velocity, still = np.gradient(Q, DT) / TURN, np.ones(ROWS)
    return table(
        names, (T, 10 * still, Q / TURN, velocity, TAU, TAU / KT, 24 * still, 31 * still, 0 * still), ",", form=".8g"
    )


def vesc() -> str:
    names = ("ms_today", "input_voltage", "temp_motor", "current_motor", "erpm", "duty_cycle", "encoder_position")
    still = np.ones(ROWS)
    columns = (80_069_026 + 1000 * T, 55.3 * still, 26.9 * still, TAU / KT, 100 * still, 0.1 * still, Q / DEG)
    return table((*names, ""), (), ";") + table((), columns, ";", form=".10g").replace("\n", ";\n")


def plotjuggler() -> str:
    names = (
        "__time",
        "/joint_states/azimuth/effort",
        "/joint_states/azimuth/position",
        "/joint_states/azimuth/velocity",
    )
    return table(names, (1709331184.0 + T, TAU, Q, np.gradient(Q, DT)), ",", form=".13g")


def guide_log() -> str:
    head = "PHD2 version 2.6.13, Log version 2.5. Log enabled at 2024-03-01 21:58:11\n\n"
    head += "Guiding Begins at 2024-03-01 22:13:04\nDither = both axes, Image noise reduction = none\n"
    head += "Pixel scale = 1.03 arc-sec/px, Binning = 1\n"
    head += "Mount = EQMOD, connected, guiding enabled, xAngle = 91.2, xRate = 6.1\n"
    head += (
        "Frame,Time,mount,dx,dy,RARawDistance,DECRawDistance,RAGuideDistance,DECGuideDistance,RADuration,RADirection,"
    )
    head += "DECDuration,DECDirection,XStep,YStep,StarMass,SNR,ErrorCode\n"
    rows, corrected = [], 0.0
    for frame in range(1, 421):
        time = 2.31 * frame
        free = (TRAIN * np.sin(2 * np.pi * time / PERIOD) + 0.02 * time) / 1.03
        seen = free - corrected
        guide = 0.7 * seen
        if frame % 100 == 50:
            rows.append(f'{frame},{time:.3f},"DROP",,,,,,,,,,,,,0,0.00,2,"Star lost"')
            continue
        pulse = f"{abs(round(160 * guide))},{'W' if guide > 0 else 'E'}"
        fields = f"{seen:.3f},0.010,{seen:.3f},0.010,{guide:.3f},0.000,{pulse},0,,,,"
        rows.append(f'{frame},{time:.3f},"Mount",{fields}20145,31.20,0')
        corrected += float(f"{guide:.3f}")
        if frame == 200:
            rows.append("INFO: SETTLING STATE CHANGE, Settling complete")
    return head + "\n".join(rows) + "\nGuiding Ends at 2024-03-01 22:29:14\n"


def german_excel() -> str:
    head = "Messung 17;Achse Azimut\nDatum;01.03.2024\n\n"
    head += "Uhrzeit;Drehmoment-Sollwert;Lageistwert;Lagesollwert;Bemerkung\nhh:mm:ss;Nm;°;°;\n"
    rows = zip(stamps(), TAU, Q / DEG, Q_D / DEG, strict=True)
    return head + "".join(f"{t[11:]};{a:.9g};{b:.9g};{c:.9g};\n".replace(".", ",") for t, a, b, c in rows)


def labview() -> str:
    """LabVIEW's measurement file (.lvm), version 2."""
    head = "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
    head += "X_Columns\tOne\nTime_Pref\tRelative\nDate\t2024/03/01\nTime\t22:13:04.1234567\n***End_of_Header***\t\n\t\n"
    head += f"Channels\t2\t\t\nSamples\t{ROWS}\t{ROWS}\t\nY_Unit_Label\tN.m\trad\t\nX_Dimension\tTime\tTime\t\n"
    head += f"X0\t0.0E+0\t0.0E+0\t\nDelta_X\t{DT}\t{DT}\t\n***End_of_Header***\t\t\t\n"
    body = table((), (T, TAU, Q), "\t").replace("\n", "\t\n")
    return head + table(("X_Value", "Torque", "Position", "Comment"), (), "\t") + body


def oscilloscope() -> str:
    head = "Model,MSO46\nFirmware Version,1.28\n,,\nHorizontal Units,s\nSample Interval,0.005\nRecord Length,160\n\n"
    return head + table(("TIME", "CH1", "CH2"), (T - 0.4, TAU, Q), ",")


def iso_logger() -> str:
    names = "timestamp,state,motor_torque_cmd_mNm,load_encoder_arcsec,set_position_arcsec\n"
    arcsec = DEG / 3600
    rows = zip(stamps(), 1000 * TAU, Q / arcsec, Q_D / arcsec, strict=True)
    return names + "".join(f"{t}Z,TRACKING,{a:.9g},{b:.9g},{c:.9g}\n" for t, a, b, c in rows)


def micro_controller() -> str:
    """Microseconds since it was switched on, a torque in mNm, counts of an encoder."""
    columns = (8_000_000 + 1e6 * T, np.round(1000 * TAU), np.round(Q / TURN * 65536))
    return "Serial monitor, firmware 1.4\n" + table(("micros", "torque_mNm", "counts"), columns, "\t", form=".0f")


def pandas_index() -> str:
    body = table(("t", "tau", "q"), (T, TAU, Q), ",")
    return "".join(f"{row if row >= 0 else ''},{line}\n" for row, line in enumerate(body.splitlines(), -1))


def two_joints() -> str:
    names = ("stamp_ns", "az.effort", "az.position", "alt.effort", "alt.position")
    first = 1_709_331_184_000_000_000
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(
        [first + 5_000_000 * k, f"{TAU[k]:.9g}", f"{Q[k]:.9g}", "0.0", f"{0.1 + Q[k] / 9:.9g}"] for k in range(ROWS)
    )
    return out.getvalue()


TEXTS: dict[str, Callable[[], str]] = {
    "twincat_scope.csv": twincat,
    "twincat_scope_all_times.csv": twincat_times,
    "tia_trace.csv": tia_trace,
    "sinamics_trace.csv": sinamics,
    "halscope.log": halscope,
    "halsampler_tagged.txt": halsampler_tagged,
    "halsampler.txt": halsampler,
    "odrive_capture.txt": odrive_capture,
    "odrive.csv": odrive,
    "moteus.csv": moteus,
    "vesc_tool.csv": vesc,
    "plotjuggler.csv": plotjuggler,
    "PHD2_GuideLog.txt": guide_log,
    "german_excel.csv": german_excel,
    "labview.lvm": labview,
    "oscilloscope.csv": oscilloscope,
    "iso_logger.csv": iso_logger,
    "micro_controller.txt": micro_controller,
    "pandas_index.csv": pandas_index,
    "two_joints.csv": two_joints,
}
ENCODED = {"german_excel.csv": "cp1252", "twincat_scope.csv": "utf-8-sig", "tia_trace.csv": "utf-16"}


def encoded(name: str) -> bytes:
    """Return the bytes of a sample."""
    return TEXTS[name]().encode(ENCODED.get(name, "utf-8"))


if __name__ == "__main__":
    for name in TEXTS:
        (Path(__file__).parents[1] / "tests" / "samples" / name).write_bytes(encoded(name))
