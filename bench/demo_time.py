"""Time `cosim demo` as a whole process, with an empty compiler cache and with a filled one.

python bench/demo_time.py --out results/master
"""

import argparse
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cosim

WARM = 3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    out = parser.parse_args().out
    with tempfile.TemporaryDirectory() as folder:
        seconds = [timed(Path(folder), k) for k in range(1 + WARM)]
    warm = sorted(seconds[1:])[WARM // 2]
    text = [
        "# Time of `cosim demo`",
        "",
        "    python bench/demo_time.py --out results/master",
        "",
        f"mount-cosim {cosim.__version__}, Python {platform.python_version()}, {os.cpu_count()} cores, "
        f"{platform.machine()}; whole process, wall clock, a shared machine.",
        "",
        "| compiler cache | seconds |",
        "| --- | --- |",
        f"| empty | {seconds[0]:.1f} |",
        f"| filled, median of {WARM} | {warm:.1f} |",
    ]
    out.mkdir(parents=True, exist_ok=True)
    (out / "demo.md").write_text("\n".join(text) + "\n", "utf-8")
    print("\n".join(text))


def timed(folder: Path, number: int) -> float:
    environment = os.environ | {"MOUNT_COSIM_CACHE": str(folder / "cache")}
    started = time.perf_counter()
    command = [sys.executable, "-m", "cosim", "demo", "--out", str(folder / f"demo{number}")]
    subprocess.run(command, env=environment, check=True, capture_output=True)
    return time.perf_counter() - started


if __name__ == "__main__":
    main()
