"""What two axes do on one star: the error on the sky, what the coupling is worth, and the blind spot at the zenith.

python bench/two_axis.py --out results/master     (--json prints the numbers)

Three parts: the shipped scenario `two_axis`; the same mount slewing both axes at once, with the coupling and without
it; and the scenario without gusts, swept over stars that culminate nearer and nearer to the zenith.
"""

import argparse
import json
import tempfile
from dataclasses import replace
from math import cos, pi, radians
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import cosim
from cosim.data.recording import Recording
from cosim.data.signals import Slews
from cosim.data.star import SIDEREAL_RATE
from cosim.master.simulate import run
from cosim.models.cache import with_fmus
from cosim.system.scenario import Scenario, read_scenario
from cosim_sweeps.conduct import conduct
from cosim_sweeps.file import read_sweep

COMMAND = "python bench/two_axis.py --out results/master"
ARCSEC = pi / 648000
LATITUDE, TUBE = 49.0, 12.0
DISTANCES = (4.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
"""From the zenith, in degrees, at culmination."""
SWEEP = """
scenario = "two_axis"
[vary]
"star.declination_deg" = {declinations}
[statistics]
peak_error = {{ signal = "sky.error", kind = "peak", from = 1.0, unit = "arcsec" }}
peak_cross_elevation = {{ signal = "sky.cross_elevation", kind = "peak", from = 1.0, unit = "arcsec" }}
peak_rate = {{ signal = "star.azimuth_velocity", kind = "peak", unit = "deg/s" }}
peak_torque = {{ signal = "azimuth.tau", kind = "peak", from = 1.0 }}
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    scenario = with_fmus(read_scenario("two_axis"))
    tracked = run(scenario).recording
    with tempfile.TemporaryDirectory() as folder:
        blind = approach(scenario, Path(folder))
    found = {
        "tracking": errors(tracked, begin=1.0),
        "tracking coupling [N.m]": coupling(tracked),
        "slew": slew(scenario),
        "zenith": blind.to_dict("records"),
        "version": f"mount-cosim {cosim.__version__}",
        "command": COMMAND,
    }
    if options.out:
        write(found, tracked, blind, options.out)
    print(json.dumps(found, indent=2) if options.json else page(found))


def errors(recording: Recording, begin: float) -> dict[str, dict[str, float]]:
    """Return RMS and peak of the errors in arcsec, from `begin` [s] on."""
    late = recording.t >= begin
    columns = {
        "on the sky": recording["sky_error"],
        "across the elevation": recording["cross_elevation"],
        "in elevation": recording["elevation"],
        "of the azimuth axis": recording["azimuth_q_d"] - recording["azimuth_position"],
        "of the altitude axis": recording["altitude_q_d"] - recording["altitude_position"],
    }
    rows = {name: x[late] / ARCSEC for name, x in columns.items()}
    return {name: {"rms": float(np.sqrt(np.mean(x * x))), "peak": float(np.abs(x).max())} for name, x in rows.items()}


def calm(scenario: Scenario) -> Scenario:
    """Leave the gusts out."""
    wires = tuple(wire for wire in scenario.wires if not wire.source.startswith("gusts"))
    return replace(scenario, wires=wires)


def slew(scenario: Scenario) -> dict[str, Any]:
    """Move both axes by 40 deg at 5 deg/s at once; without coupling the azimuth has the controller's 30 kg m2."""
    limits = {"max_velocity": radians(5.0), "max_acceleration": radians(5.0), "max_jerk": radians(20.0)}
    motion = {
        name: Slews(kind="slews", positions=[radians(start), radians(start + way)], dwell=1.0, **limits)
        for name, start, way in (("azimuth", 150.0, 40.0), ("altitude", 25.0, 40.0))
    }
    found = {}
    for name, tube in (("with coupling", TUBE), ("without, azimuth 30 kg m2", 0.0)):
        done = run(slewing(calm(scenario), motion, tube)).recording
        found[name] = {"peak error [arcsec]": errors(done, 0.5)["on the sky"]["peak"]} | {
            f"peak {axis} torque [N.m]": float(np.abs(done[f"{axis}_tau"]).max()) for axis in motion
        }
    return found


def slewing(scenario: Scenario, motion: dict[str, Slews], tube: float) -> Scenario:
    """Drive both axes by set points of their own; `tube` is the inertia that couples them [kg m2]."""
    outputs = {"": "position", "_velocity": "velocity", "_acceleration": "acceleration"}
    instead = {f"star.{axis}{kind}": f"set_{axis}.{output}" for axis in motion for kind, output in outputs.items()}
    effects = {"azimuth": "altitude_inertia", "altitude": "azimuth_centrifugal"}
    parameters = {"azimuth_controller": {"inertia": 30.0}, "altitude_controller": {}}
    for axis, effect in effects.items():
        parameters[axis] = {"position": f"set_{axis}.position", f"{effect}.tube_inertia": tube}
    parameters["azimuth"] |= {} if tube else {"axis.inertia": 30.0}
    components = {
        name: one.model_copy(update={"parameters": parameters.get(name, {})})
        for name, one in scenario.components.items()
    }
    return replace(
        scenario,
        signals={f"set_{axis}": signal for axis, signal in motion.items()},
        wires=tuple(replace(one, source=instead.get(one.source, one.source)) for one in scenario.wires),
        records={
            name: replace(one, signal=instead.get(one.signal, one.signal)) for name, one in scenario.records.items()
        },
        components=components,
        ticks=120_000,
        decimation=1,
    )


def approach(scenario: Scenario, folder: Path) -> pd.DataFrame:
    """Sweep over stars that culminate nearer and nearer to the zenith."""
    file = folder / "zenith.toml"
    file.write_text(SWEEP.format(declinations=[LATITUDE - distance for distance in DISTANCES]))
    done = conduct(read_sweep(file), replace(calm(scenario), decimation=1), folder / "out")
    table = pd.read_parquet(done.table)
    assert set(table["status"]) == {"ok"}, table["reason"].tolist()
    table.insert(0, "zenith_distance", LATITUDE - table["star.declination_deg"])
    return table.drop(columns=["run", "star.declination_deg", "seconds", "status", "reason"])


def coupling(recording: Recording) -> dict[str, float]:
    """Return the largest torques [N m] by which the axes pushed each other."""
    double, turning, swinging = 2 * recording["altitude_position"], recording["azimuth_v"], recording["altitude_v"]
    pushes = {"azimuth": np.sin(double) * swinging * turning, "altitude": np.sin(double) * turning**2 / 2}
    return {name: float(TUBE * np.abs(push).max()) for name, push in pushes.items()}


def page(found: dict[str, Any]) -> str:
    """Return the README of the result."""
    blind = {rate: np.degrees(SIDEREAL_RATE * cos(radians(LATITUDE)) / radians(rate)) for rate in (0.5, 2.0, 5.0)}
    pushes = found["tracking coupling [N.m]"]
    lines = [
        "# Two axes on one star",
        "",
        f"    {COMMAND}",
        "",
        f"{found['version']}. Azimuth: friction and tuning of the paper's vertical axis; altitude, coupling and gusts:",
        "assumed (see the cards `altaz_azimuth`, `altaz_altitude` and the scenario `two_axis`). No refraction, no",
        "field rotation.",
        "",
        "## A star through its culmination 4 deg from the zenith, with gusts, 1 to 60 s",
        "",
        "| error [arcsec] | RMS | peak |",
        "| --- | --- | --- |",
        *(f"| {name} | {one['rms']:.3g} | {one['peak']:.3g} |" for name, one in found["tracking"].items()),
        "",
        f"An error of the azimuth axis counts on the sky with the cosine of the altitude, here {cos(radians(86)):.3f}.",
        "",
        "![errors, the altitude's reversal, the blind spot](two_axis.svg)",
        "",
        "## Both axes slew 40 deg at 5 deg/s at once, from 25 to 65 deg of altitude, without gusts",
        "",
        "| | " + " | ".join(next(iter(found["slew"].values()))) + " |",
        "| --- | --- | --- | --- |",
        *(f"| {name} | " + " | ".join(f"{x:.4g}" for x in one.values()) + " |" for name, one in found["slew"].items()),
        "",
        f"While tracking, the axes pushed each other by {pushes['azimuth']:.1g} N m (azimuth) and",
        f"{pushes['altitude']:.1g} N m (altitude) at most: that matters in slews only. The inertia of the azimuth,",
        "24 to 36 kg m2 between zenith and horizon, matters for the tuning.",
        "",
        "## The blind spot, without gusts",
        "",
        "| from the zenith [deg] | azimuth rate [deg/s] | azimuth torque [N m] | error on the sky [arcsec], peaks |",
        "| --- | --- | --- | --- |",
        *(
            "| {zenith_distance:.3g} | {peak_rate:.3g} | {peak_torque:.3g} | {peak_error:.3g} |".format(**one)
            for one in found["zenith"]
        ),
        "",
        "No mount with altitude over azimuth follows a star through the zenith: the azimuth rate it takes grows as the",
        "sidereal rate times cos(latitude) over the distance. Here torque (50 N m) ends it; a mount whose azimuth may",
        f"turn no faster than {', '.join(f'{rate:g}' for rate in blind)} deg/s is blind within",
        f"{', '.join(f'{far:.2g}' for far in blind.values())} deg of the zenith.",
    ]
    return "\n".join(lines) + "\n"


def write(found: dict[str, Any], tracked: Recording, blind: pd.DataFrame, out: Path) -> None:
    import matplotlib
    from matplotlib.figure import Figure

    from cosim.plots.style import AFTER, BEFORE, GREY, MEASURED, STYLE, thin

    out.mkdir(parents=True, exist_ok=True)
    (out / "two_axis.md").write_text(page(found), "utf-8")
    (out / "two_axis.json").write_text(json.dumps(found, indent=2) + "\n", "utf-8")
    late = tracked.t >= 1.0
    t = tracked.t[late]
    with matplotlib.rc_context(rc=STYLE):
        figure = Figure(figsize=(11, 7.5), layout="constrained")
        (sky, axes), (reversal, zenith) = figure.subplots(2, 2)
        for name, colour in (("elevation", BEFORE), ("cross_elevation", AFTER)):
            label = name.replace("_", " ")
            sky.plot(*thin(t, tracked[name][late] / ARCSEC, 500), color=colour, lw=0.9, label=label)
        sky.set_title("error on the sky [arcsec]", loc="left")
        for name, colour in (("altitude", BEFORE), ("azimuth", AFTER)):
            error = (tracked[f"{name}_q_d"] - tracked[f"{name}_position"])[late] / ARCSEC
            axes.plot(*thin(t, error, 500), color=colour, lw=0.9, label=name)
        axes.set_title("error of the axes [arcsec]", loc="left")
        reversal.plot(
            t, (tracked["altitude_q_d"][late] - radians(86)) / ARCSEC, color=GREY, label="altitude − 86° [arcsec]"
        )
        reversal.plot(*thin(t, tracked["altitude_friction"][late], 500), color=MEASURED, lw=0.9, label="friction [N·m]")
        reversal.set_title("the altitude turns back within its bristles", loc="left")
        for panel in (sky, axes, reversal):
            panel.set_xlabel("time [s]")
            panel.grid(axis="y")
            panel.legend(frameon=False, fontsize=10)
        x = blind["zenith_distance"]
        zenith.loglog(x, blind["peak_error"], "o-", color=BEFORE, label="peak error [arcsec]")
        zenith.loglog(x, blind["peak_rate"], "o-", color=AFTER, label="peak azimuth rate [deg/s]")
        law = np.degrees(SIDEREAL_RATE * np.cos(radians(LATITUDE) - np.radians(x)) / np.sin(np.radians(x)))
        zenith.loglog(x, law, ":", color=GREY, label="sidereal rate × cos(dec) / distance")
        zenith.loglog(x, blind["peak_torque"], "o-", color=MEASURED, lw=0.9, ms=3, label="peak azimuth torque [N·m]")
        for axis in (zenith.xaxis, zenith.yaxis):
            axis.set_major_formatter(lambda value, _: f"{value:g}")
        zenith.set_xlabel("distance from the zenith at culmination [deg], no gusts")
        zenith.set_title("the blind spot", loc="left")
        zenith.set_ylim(top=1e5)
        zenith.legend(frameon=False, fontsize=10, loc="upper right")
        figure.savefig(out / "two_axis.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
