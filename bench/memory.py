"""Memory of a long run: an hour at 10 kHz, six signals of every step streamed to Parquet.

python bench/memory.py --out results/master      (a few minutes, needs 2.5 GB of disk while it runs)

The process `cosim run` is looked at from outside every half second: its resident memory, the file growing meanwhile.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from importlib.resources import files
from pathlib import Path

import cosim

COMMAND = "python bench/memory.py --out results/master"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3600.0, help="simulated")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        seen, told, size = watched(Path(folder), options.seconds)
    text = page(seen, told, size)
    print(text)
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "memory.md").write_text(text, "utf-8")


def watched(folder: Path, seconds: float) -> tuple[list[float], dict[str, float], int]:
    """Return the resident memory in MB over time, the statistics of the run and the bytes of its recording."""
    text = (files("cosim") / "scenarios" / "sidereal.toml").read_text("utf-8")
    (folder / "long.toml").write_text(text.replace("stop = 15.0", f"stop = {seconds}"))
    command = [sys.executable, "-m", "cosim", "run", str(folder / "long.toml"), "--out", str(folder), "--json"]
    seen = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        while process.poll() is None:
            seen.append(resident(process.pid))
            time.sleep(0.5)
        assert process.stdout is not None
        told = json.loads(process.stdout.read())
    assert process.returncode == 0
    return seen, told, (folder / "recording.parquet").stat().st_size


def resident(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text() if Path(f"/proc/{pid}").exists() else ""
    lines = [line.split() for line in status.splitlines() if line.startswith("VmRSS")]
    return float(lines[0][1]) / 1000 if lines else 0.0


def page(seen: list[float], told: dict[str, float], size: int) -> str:
    used = [one for one in seen if one > 0]
    lines = [
        "# Memory of a long run",
        "",
        f"    {COMMAND}",
        "",
        f"mount-cosim {cosim.__version__}, Python {platform.python_version()}, {os.cpu_count()} cores, "
        f"{platform.machine()}, shared. The sidereal scenario for {told['simulated_seconds']:g} s at 0.1 ms: "
        f"{told['steps']:,} steps in {told['seconds']:.0f} s ({told['microseconds_per_step']:.2f} us a step), "
        f"{told['rows']:,} rows, {size / 1e9:.2f} GB of Parquet.",
        "",
        "| part of the run | resident memory [MB] |",
        "| --- | --- |",
    ]
    lines += [f"| {share:.0%} | {used[min(int(share * len(used)), len(used) - 1)]:.0f} |" for share in SHARES]
    return "\n".join([*lines, f"| greatest | {max(used):.0f} |"]) + "\n"


SHARES = (0.1, 0.25, 0.5, 0.75, 0.95)

if __name__ == "__main__":
    main()
