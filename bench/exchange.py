"""How far apart other tools are on what this project exports: the SSP in FMPy, ecos and libcosim, the Modelica text.

python bench/exchange.py --out results/exchange

With --copies DIR, a folder of fetched copies of other projects with a copies.toml, also what becomes of their archives
here (`exchange_archives`). The folder is no part of this project; without it that part is left as it is.
"""

import argparse
import importlib
import math
import subprocess
import sys
import tempfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

import cosim
from cosim.master.simulate import run
from cosim.models.cache import with_fmus
from cosim.models.system import system_of
from cosim.system.scenario import read_scenario
from pyfmi_models.card import read_card
from pyfmi_models.derivation import derivation_of
from pyfmi_models.export.modelica import modelica_text
from pyfmi_models.export.ssp import export_ssp

sys.path.append(str(Path(__file__).parents[1] / "tests/tools"))
from exchange_archives import page, rows_of
from ssp_tools import SIGNALS, TOOLS

CARD, STEP = "paper_mount", 1e-4
PACKAGES = {"fmpy": "fmpy", "ecos": "ecospy", "libcosim": "libcosimpy"}
OTHERS = ["", "What becomes of archives of others here: [archives.md](archives.md)."]
CAUSES = {
    "fmpy": "adds up the time step by step, so the set point is late by the rounding of the sum",
    "ecos": "adds up the time step by step, as FMPy does",
    "libcosim": "counts time in ns; the last bit of it differs",
    "sidereal": "the encoder's quantum of 1.46e-9 rad, for which SSP has no word",
}
SCENARIO = {"mount.q": "position", "mount.v": "v", "mount.friction": "friction", "reference.position": "q_d"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--copies", type=Path, default=Path("nowhere"), help="folder with copies.toml")
    parser.add_argument("--only-archives", action="store_true", help="leave out what others make of our exports")
    given = parser.parse_args()
    if not given.only_archives:
        exported(given.out)
    if (given.copies / "copies.toml").is_file():
        write(given.out / "archives.md", page(list(rows_of(given.copies))))
    else:
        print(f"Archives of others: skipped, because there is no {given.copies / 'copies.toml'}.", file=sys.stderr)


def exported(out: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        ssp = export_ssp(system_of(read_card(CARD)), Path(folder) / "paper_mount.ssp")
        own = columns(read_scenario(ssp), {name: name for name in SIGNALS})
        rows = [(tool, apart(own, in_tool(tool, ssp, len(own) - 1))) for tool in TOOLS if present(TOOLS[tool])]
        rows.append(("sidereal", apart(own, columns(with_fmus(read_scenario("sidereal")), SCENARIO))))
    write(out / "README.md", report(rows, np.ptp(own, axis=0)) + modelica() + OTHERS)


def write(path: Path, text: list[str]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(text) + "\n", "utf-8")
    print("\n".join(text))


def columns(scenario, names: dict[str, str]) -> np.ndarray:
    """The signals in the order of SIGNALS; nan where a run has none."""
    recording = run(scenario).recording
    nothing = np.full(len(recording), math.nan)
    return np.column_stack([recording[names[name]] if name in names else nothing for name in SIGNALS])


def present(module: str) -> bool:
    try:
        return bool(importlib.import_module(module))
    except (ImportError, OSError) as error:
        print(f"left out, {module}: {error}")
        return False


def in_tool(tool: str, ssp: Path, steps: int) -> np.ndarray:
    runner, out = Path(__file__).parent / "ssp_tools.py", ssp.with_suffix(f".{tool}.npy")
    command = [sys.executable, str(runner), tool, str(ssp), str(STEP), str(steps), str(out)]
    subprocess.run(command, check=True, capture_output=True)
    return np.load(out)


def apart(own: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.abs(own - other).max(axis=0)


def report(rows: list[tuple[str, np.ndarray]], range_: np.ndarray) -> list[str]:
    def cells(values: np.ndarray) -> str:
        return " | ".join("-" if math.isnan(value) else f"{value:.1e}" for value in values)

    lines = [
        "# What other tools make of our exports",
        "",
        "    python bench/exchange.py --out results/exchange",
        "",
        f"mount-cosim {cosim.__version__}; the card `{CARD}`, its SSP over 15 s at 0.1 ms. Greatest difference to",
        "`cosim run` on the same SSP, in rad, rad/s and N m; the first row is the range of each signal.",
        "",
        f"| tool | {' | '.join(SIGNALS)} | cause |",
        "|---|" + "---|" * (len(SIGNALS) + 1),
        f"| (range) | {cells(range_)} | |",
    ]
    for tool, values in rows:
        name = f"{tool} {version(PACKAGES[tool])}" if tool in PACKAGES else f"scenario `{tool}`"
        lines.append(f"| {name} | {cells(values)} | {CAUSES[tool]} |")
    return lines


def modelica() -> list[str]:
    """Three reversals under a torque of 6 N m at 1 Hz, by rumoca's BDF from the text and by Radau from the model."""
    try:
        import rumoca
    except ImportError:
        return ["", "The Modelica compiler rumoca was not installed."]
    mount = read_card(CARD).plant()
    model = mount.model()
    text = modelica_text(model, "PaperMount", derivation_of(mount))
    text += f"model Run PaperMount.Plant plant(tau = 6*sin({2 * math.pi!r}*time), disturbance = 0); end Run;"
    settings = rumoca.SimConfig(rtol=1e-9, atol=1e-12, solver="bdf")
    found = rumoca.Session().loads(text, model="Run", filename="Run.mo").simulate(t=(0, 1.5), dt=0.01, config=settings)
    p = [one.start for one in model.parameters]

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        return np.asarray(model.equations(t, x, [6 * math.sin(2 * math.pi * t), 0], p)[0]).ravel()

    exact = solve_ivp(rates, (0, 1.5), np.zeros(3), method="Radau", rtol=1e-10, atol=1e-14, t_eval=found.time)
    lines = [
        "",
        f"The Modelica text of the plant in rumoca {installed('rumoca')} (BDF, rtol 1e-9), beside scipy's Radau",
        "(rtol 1e-10) on the model: three reversals under 6 N m at 1 Hz, 1.5 s.",
        "",
        "| state | greatest difference | greatest value |",
        "|---|---|---|",
    ]
    for name, values in zip(("position", "speed", "friction.bristle"), exact.y, strict=True):
        difference = np.abs(found[f"plant.{name}"] - values).max()
        lines.append(f"| {name} | {difference:.1e} | {np.abs(values).max():.1e} |")
    return lines


def installed(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "?"


if __name__ == "__main__":
    main()
