"""How well `cosim identify --fmu` finds the numbers of a Modelica tool's FMU of a rotating mass with a damper.

python bench/modelica_calibration.py edrive_mass.fmu [--cases 20] --out results/identify/modelica.json

The FMU is an argument and no part of this project: `edrive_mass.fmu` of the test data of OMSimulator (made by Dymola
2024x; FMI 2.0), input M_A [N m], output wA [rad/s], numbers inertia.J [kg m2] and damper.d [N m s/rad]. True values are
drawn within a factor of the start values, white noise is added to the speed.
"""

import argparse
import json
import tempfile
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import cosim

STARTS = {"inertia.J": 0.002, "damper.d": 0.001}
GAIN = "M_gain.k"
"""Free beside the others it makes all three known only together, which must be named."""
FACTOR, NOISE = 1.6, 0.02
"""Of the true values at most, and of the speed's spread."""
SCENARIO = """
step = 0.01
stop = 20.0
[components.a]
fmu = "{fmu}"
parameters = {{ "inertia.J" = {J!r}, "damper.d" = {d!r} }}
[signals.u]
kind = "sine"
amplitude = 0.01
frequency = 0.3
unit = "N.m"
[[connections]]
from = "u.position"
to = "a.M_A"
[record]
signals = {{ M_A = "u.position", wA = "a.wA" }}
"""


def main() -> int:
    """Play the cases and write what came out."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fmu", type=Path)
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    begun, dice = process_time(), np.random.default_rng(given.seed)
    cases = [case(given.fmu.resolve(), dice) for _ in range(given.cases)]
    errors = [abs(error) for one in cases for error in one["errors"]]
    result = {
        "cases": len(cases),
        "within_2_standard_errors": float(np.mean([error <= 2 for error in errors])),
        "of": len(errors),
        "undetermined_named": sum(one["named"] for one in cases),
        "processor_seconds_a_case": (process_time() - begun) / len(cases),
        "rows": cases,
    }
    given.out.write_text(json.dumps(result, indent=1) + "\n", "utf-8")
    print(json.dumps({key: value for key, value in result.items() if key != "rows"}))
    return 0


def case(fmu: Path, dice: np.random.Generator) -> dict[str, Any]:
    """Errors of both numbers in their standard errors, and whether a set that is known only together is named."""
    true = {name: start * FACTOR ** dice.uniform(-1, 1) for name, start in STARTS.items()}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.toml"
        path.write_text(SCENARIO.format(fmu=fmu, J=float(true["inertia.J"]), d=float(true["damper.d"])), "utf-8")
        table = cosim.run(path).frame()[["t", "M_A", "wA"]]
    table["wA"] += NOISE * table["wA"].std() * dice.standard_normal(len(table))
    found = cosim.identify([table], fmu=fmu, free=list(STARTS))
    errors = [float((found.numbers[name] - true[name]) / found.standard_errors[name]) for name in STARTS]
    more = str(cosim.identify([table], fmu=fmu, free=[*STARTS, GAIN]))
    return {"true": true, "errors": errors, "named": GAIN in more and ("only together" in more)}


if __name__ == "__main__":
    raise SystemExit(main())
