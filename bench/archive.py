"""What an archive costs: its size, the time to build it for all platforms, to load it in a tool and to step it once.

python bench/archive.py --out results/exchange
"""

import argparse
import importlib
import os
import platform
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np

import cosim
from pyfmi_models.card import read_card
from pyfmi_models.export import build_library, export_fmu
from pyfmi_models.export.platforms import PLATFORMS, host

sys.path.append(str(Path(__file__).parents[1] / "tests/tools"))
from fmu_tools import TOOLS

ROUNDS = 9
PACKAGES = {"fmpy": "fmpy", "ecos": "ecospy", "libcosim": "libcosimpy"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    out = parser.parse_args().out
    with tempfile.TemporaryDirectory() as folder:
        text = [*head(), *building(Path(folder)), *sizes(Path(folder)), *loading(Path(folder))]
    out.mkdir(parents=True, exist_ok=True)
    (out / "archive.md").write_text("\n".join(text) + "\n", "utf-8")
    print("\n".join(text))


def head() -> list[str]:
    return [
        "# What an archive costs",
        "",
        "    python bench/archive.py --out results/exchange",
        "",
        f"mount-cosim {cosim.__version__}, ziglang {version('ziglang')}; the plant of `paper_mount`.",
        f"{platform.machine()}, {os.cpu_count()} cores shared with others, so times are rough; medians of {ROUNDS}.",
    ]


def seconds(work, *arguments) -> float:
    begun = perf_counter()
    work(*arguments)
    return perf_counter() - begun


def building(folder: Path) -> list[str]:
    """First build with an empty cache one after another, an unchanged model, and one that changed."""
    model = read_card("paper_mount").plant().model()
    os.environ["MOUNT_COSIM_CACHE"] = str(folder / "cache")
    order = sorted(PLATFORMS, key=lambda name: name != host())
    cold = {name: seconds(build_library, model, name) for name in order}
    warm = {name: median(seconds(build_library, model, name) for _ in range(ROUNDS)) for name in order}
    other = read_card("emps").plant().model()
    changed = {name: seconds(build_library, other, name) for name in order}
    rows = [f"| {name} | {cold[name]:.1f} | {changed[name]:.1f} | {warm[name]:.2f} |" for name in order]
    return [
        "",
        "| library for | cache empty [s] | another model [s] | nothing changed [s] |",
        "|---|---|---|---|",
        *rows,
    ]


def sizes(folder: Path) -> list[str]:
    model = read_card("paper_mount").plant().model()
    rows = []
    for fmi in (2, 3):
        one, five = (
            export_fmu(model, folder / f"{len(names)}{fmi}.fmu", fmi=fmi, platforms=names).stat().st_size / 1024
            for names in ((host(),), tuple(PLATFORMS))
        )
        rows.append(f"| FMI {fmi} | {one:.0f} | {five:.0f} |")
    return ["", "| archive | one platform [KiB] | five [KiB] |", "|---|---|---|", *rows]


def loading(folder: Path) -> list[str]:
    """From the path of the file to the end of the first step, each time in a fresh process, its imports not counted."""
    cases = [(tool, fmi) for tool, (module, versions) in TOOLS.items() for fmi in versions if present(module)]
    rounds = [{case: load(*case, folder) for case in cases} for _ in range(ROUNDS)]
    rows = []
    for tool, fmi in cases:
        own = median(one[tool, fmi] for one in rounds)
        ratio = median(one[tool, fmi] / one["fmpy", fmi] for one in rounds)
        rows.append(f"| {tool} {version(PACKAGES[tool])} | {fmi} | {1e3 * own:.1f} | {ratio:.2f} |")
    return ["", "| load and first step in | FMI | [ms] | to FMPy |", "|---|---|---|---|", *rows]


def present(module: str) -> bool:
    try:
        return bool(importlib.import_module(module))
    except (ImportError, OSError) as error:
        print(f"left out, {module}: {error}")
        return False


def load(tool: str, fmi: int, folder: Path) -> float:
    runner, out = Path(__file__).parent / "fmu_tools.py", folder / "rows.npz"
    command = [sys.executable, str(runner), tool, str(folder / f"1{fmi}.fmu"), "1", str(out)]
    subprocess.run(command, check=True, capture_output=True)
    return float(np.load(out)["seconds"])


if __name__ == "__main__":
    main()
