"""A foreign plant FMU of a measured machine (EMPS) calibrated on its recordings, next to our own card's fit.

python bench/foreign_machine.py --data DIR --out results/identify    (DIR: that of EMPS, with estimation.parquet)

The FMU is written from the equations of the benchmark (`emps_fmu`). `cosim identify --fmu` fits M, Fv and Fc to the
speed on the estimation run, in windows of 0.5 s with free start values. Our own card is the base that `cosim diagnose`
refits on the same run. Both are judged alike: force - (M a + Fv v + Fc sign v) on the run that neither was fitted to,
100 Hz zero phase on both sides, in clear motion (|v| > 2 mm/s), RMS in N; speed is the slope of the position behind the
same filter.
"""

import argparse
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np
import pandas as pd
from emps_fmu import STARTS, emps
from scipy.signal import butter, sosfiltfilt

import cosim

RATE, CUTOFF, CLEAR = 1000.0, 100.0, 2e-3
WINDOW = 0.5
FREE = ("M", "Fv", "Fc")
TITLE = "## A measured machine"
Table = dict[str, np.ndarray]


def filtered(values: np.ndarray) -> np.ndarray:
    """Low-pass, zero phase."""
    return sosfiltfilt(butter(4, CUTOFF, fs=RATE, output="sos"), values)


def recorded(path: Path) -> Table:
    """Columns by the names of the FMU."""
    frame = pd.read_parquet(path)
    q = frame["q"].to_numpy()
    return {"t": frame["t"].to_numpy(), "F": frame["force"].to_numpy(), "v": np.gradient(filtered(q), 1 / RATE)}


def rms(table: Table, numbers: dict[str, float]) -> float:
    """RMS of the force that the numbers leave in clear motion [N]."""
    v = table["v"]
    model = numbers["M"] * np.gradient(v, 1 / RATE) + numbers["Fv"] * v + numbers["Fc"] * np.sign(v)
    rest = (filtered(table["F"]) - filtered(model))[np.abs(v) > CLEAR]
    return float(np.sqrt(np.mean(rest**2)))


def of_fmu(train: Table, folder: Path) -> tuple[dict[str, float], dict[str, float]]:
    """Numbers of the foreign FMU and their standard errors."""
    done = cosim.identify(train, fmu=emps(folder), free=list(FREE), window=WINDOW, initial="free", starts=1)
    return done.numbers, done.standard_errors


def of_card(train: Path, heldout: Path) -> dict[str, float]:
    """Numbers of our own card, refitted."""
    card = cosim.diagnose(train, heldout, "emps").refitted
    known = {one.name: float(one.start) for one in card.plant().parameters()}
    return {"M": known["axis.inertia"], "Fv": known["friction.sigma2"], "Fc": known["friction.Fc"]}


def section(rows: dict[str, dict[str, float]], errors: dict[str, float], train: Table, kept: Table, took: float) -> str:
    """The text of the page."""
    lines = [
        TITLE,
        "",
        "    python bench/foreign_machine.py --data DIR --out results/identify",
        "",
        "EMPS (Janot, Gautier, Brunot 2019): an FMU written by hand from the benchmark's equations; M, Fv and Fc from",
        f"the estimation run, speed in windows of {WINDOW:g} s with free start values, {took:.0f} s. RMS of the force",
        "that is left in clear motion, 100 Hz on both sides; nothing was fitted to the pulses run, which is held out.",
        "",
        "| numbers | M [kg] | Fv [N s/m] | Fc [N] | estimation [N] | held out [N] |",
        "|---|---|---|---|---|---|",
    ]
    for name, numbers in rows.items():
        cells = [f"{numbers[key]:.2f}" + (f" ± {errors[key]:.2f}" if name.startswith("FMU") else "") for key in FREE]
        lines.append(f"| {name} | {' | '.join(cells)} | {rms(train, numbers):.3f} | {rms(kept, numbers):.3f} |")
    fmu, card = (rms(kept, one) for one in list(rows.values())[1:])
    lines += ["", f"Held out, the FMU is {100 * (fmu / card - 1):+.2f} % from our own card's fit (asked: within 2 %)."]
    return "\n".join(lines) + "\n"


def kept_section(page: Path) -> str:
    """The section of a page that is there; "" where there is none."""
    text = page.read_text("utf-8") if page.exists() else ""
    return text[text.index(TITLE) :] if TITLE in text else ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    files = [given.data / name for name in ("estimation.parquet", "validation_pulses.parquet")]
    train, kept = (recorded(path) for path in files)
    begun = perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        numbers, errors = of_fmu(train, Path(folder))
    took = perf_counter() - begun
    rows = {"as published": dict(STARTS), "FMU, calibrated": numbers, "card, refitted": of_card(*files)}
    page = given.out / "foreign_calibration.md"
    before = page.read_text("utf-8") if page.exists() else ""
    text = before.removesuffix(kept_section(page)).rstrip("\n")
    page.write_text(f"{text}\n\n{section(rows, errors, train, kept, took)}", "utf-8")
    print(section(rows, errors, train, kept, took))


if __name__ == "__main__":
    main()
