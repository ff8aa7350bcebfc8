"""Commands that are ended at any moment: is a file half written, does anything still run, is anything left behind?

    python bench/kills.py --trials 50 --out results/robustness [--only run sweep] [--journal FILE [--so-far]]

Each command is run once to its end, and then again and again, ended by SIGKILL, SIGINT or SIGTERM at a moment drawn
from that time. Afterwards every file under its own name must be whole. After SIGINT and SIGTERM there must be no
partial file and no temporary folder, and the exit code says how it ended. After SIGKILL nobody is left to tidy up: what
is partial then is named so, and is counted; the same command, run again, must end well and remove it. Folders for
temporary files (unpacked FMUs) stay where SIGKILL came. Before its first line of ours Python answers SIGINT with a
traceback of its own and exit code 1: such a wrong code without a traceback of ours is Python's.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from random import Random
from shutil import rmtree

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "tests/tools")]

import pyarrow.parquet as pq  # noqa: E402

from cosim.hardware.blackbox import read_black_box  # noqa: E402
from cosim.support.files import replacing  # noqa: E402
from cosim.support.plain import JsonObject  # noqa: E402
from cosim.support.version import __version__  # noqa: E402

SIGNALS = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM)
CODES = {signal.SIGKILL: (-9, 0), signal.SIGINT: (130, 0, -2), signal.SIGTERM: (143, 0, -15)}
"""Exit codes that are right: a command may be just done, or Python not yet begun."""
HOME = Path(__file__).parents[1]
"""Of this project: a traceback of an interpreter that had not begun with it yet is not its own."""
LEAVE = 30.0
"""Seconds that a command and what it started have to end."""
PATIENCE = 600.0
"""Seconds after which a process that was ended and still runs is killed: a busy computer may need most of them."""
COUNTED = ("ended", "half written", "wrong exit code", "still running", "temporary left", "partial left", "traceback")


def whole(path: Path) -> bool:
    """Whether a file can be read to its end as what its name says."""
    readers: dict[str, Callable[[], object]] = {
        ".parquet": lambda: pq.read_table(path),
        ".json": lambda: json.loads(path.read_text("utf-8")),
        ".toml": lambda: tomllib.loads(path.read_text("utf-8")),
        ".html": lambda: path.read_text("utf-8").rstrip().endswith("</html>") or 1 / 0,
        ".fmu": lambda: zipfile.ZipFile(path).testzip(),
        ".ssp": lambda: zipfile.ZipFile(path).testzip(),
        ".svg": lambda: path.read_text("utf-8").rstrip().endswith("</svg>") or 1 / 0,
        ".bin": lambda: read_black_box(path).torn and 1 / 0,
    }
    try:
        readers.get(path.suffix, lambda: None)()
    except Exception:
        return False
    return True


@dataclass
class Counts:
    """What was found in the trials of a command with a signal, and how many there were."""

    trials: int = 0
    seed: int = 1
    found: dict[str, int] = field(default_factory=lambda: dict.fromkeys(COUNTED, 0))

    def add(self, **found: int) -> None:
        self.trials += 1
        for name, value in found.items():
            self.found[name.replace("_", " ")] += value


def running(folder: Path) -> list[int]:
    """Processes that were started in a folder and still are."""
    found = []
    for process in Path("/proc").iterdir():
        with suppress(OSError):
            if process.name.isdigit() and os.readlink(process / "cwd") == str(folder):
                found.append(int(process.name))
    return found


def _left(process: "subprocess.Popen[bytes]") -> tuple[int, int]:
    """Wait until a process ends, on a computer that may be busy; its exit code, and 1 where it had to be killed."""
    try:
        return process.wait(PATIENCE), 0
    except subprocess.TimeoutExpired:
        print(f"still running: {Path(f'/proc/{process.pid}/status').read_text()}", flush=True)
        process.send_signal(signal.SIGABRT)  # for which it shows what it is doing
        return process.wait(), 1


def trial(command: list[str], folder: Path, kill: signal.Signals | None, after: float) -> tuple[dict[str, int], float]:
    """Run a command in a folder of its own and end it; what was found, and its seconds."""
    (folder / "tmp").mkdir(parents=True)
    environment = os.environ | {"TMPDIR": str(folder / "tmp"), "PYTHONFAULTHANDLER": "1"}
    began = time.monotonic()
    with (folder / "said").open("wb") as said:
        process = subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=said)
    if kill is not None:
        with suppress(subprocess.TimeoutExpired):
            process.wait(after)
        process.send_signal(kill)
    code, stuck = _left(process)
    seconds = time.monotonic() - began
    last = time.monotonic() + LEAVE
    while running(folder) and time.monotonic() < last:
        time.sleep(0.05)
    files = [one for one in (folder / "out").rglob("*") if one.is_file()] if (folder / "out").exists() else []
    partial = [one for one in files if one.name.endswith((".partial", ".lock"))]
    text = (folder / "said").read_text("utf-8", "replace")
    wrong = code != 0 if kill is None else code not in CODES[kill]
    traced = "Traceback (most recent call last)" in text and str(HOME) in text
    if wrong or traced:
        print(f"exit {code} after {after:.3f} s: ...{text[-1500:]}", flush=True)
    found = {
        "ended": int(code != 0),
        "half_written": sum(not whole(one) for one in files if one not in partial),
        "wrong_exit_code": int(wrong),
        "still_running": stuck + len(running(folder)),
        "temporary_left": len(list((folder / "tmp").iterdir())),
        "partial_left": len(partial),
        "traceback": int(traced),
    }
    return found, seconds


def commands(folder: Path) -> dict[str, list[str]]:
    """The commands, all of which write to `out` in the folder that they run in."""
    from attack_targets import PLAIN, table
    from on_hardware import SCENARIO
    from small_loop import TEXT
    from tiny_fmu import build

    for version in (2, 3):
        build(folder, version)
    (folder / "run.toml").write_text(TEXT.replace('"tiny', f'"{folder}/tiny').replace("stop = 0.5", "stop = 500.0"))
    short = TEXT.replace('"tiny', f'"{folder}/tiny').replace("stop = 0.5", "stop = 20.0")
    (folder / "short.toml").write_text(short)
    (folder / "sweep.toml").write_text(
        f'scenario = "{folder}/short.toml"\n[vary]\n"controller.k" = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]\n'
        '[statistics]\nend = { signal = "q", kind = "final" }\n'
    )
    (folder / "session.toml").write_text(SCENARIO.replace("stop = 0.4", "stop = 3.0"))
    (folder / "card.toml").write_text(PLAIN)
    for name, rows in {"one": 2000, "two": 2100, "held": 2200}.items():
        table(rows).to_csv(folder / f"{name}.csv", index=False)
    tool, out = [sys.executable, "-m", "cosim"], ["--out", "out"]
    given = [str(folder / name) for name in ("one.csv", "two.csv", "held.csv")]
    return {
        "run": [*tool, "run", str(folder / "run.toml"), *out],
        "sweep": [*tool, "sweep", str(folder / "sweep.toml"), "--workers", "1", *out],
        "export": [*tool, "export", "paper_mount", "--fmi", "3", *out],
        "diagnose": [*tool, "diagnose", *given[:2], "--heldout", given[2], "--card", str(folder / "card.toml"), *out],
        "hardware": [*tool, "hardware", "run", str(folder / "session.toml"), *out],
    }


def again(command: list[str], folder: Path, name: str) -> int:
    """Run a killed command again, over what it left; returns what is wrong then: partial files, or no success."""
    more = [] if name == "sweep" else ["--force"]
    environment = os.environ | {"TMPDIR": str(folder / "tmp")}
    done = subprocess.run([*command, *more], cwd=folder, env=environment, capture_output=True, check=False)
    left = [one for one in (folder / "out").rglob("*") if one.name.endswith((".partial", ".lock"))]
    return len(left) + (done.returncode != 0)


def page(found: dict[tuple[str, str], Counts], undone: dict[str, int], command: str) -> str:
    """The table for people."""
    lines = [
        "# Commands that are ended at any moment",
        "",
        f"    {command}",
        "",
        f"mount-cosim {__version__}. What the columns mean stands at the top of `bench/kills.py`.",
        "",
        "| command | signal | seed | trials | " + " | ".join(COUNTED) + " |",
        "|---|---|" + "--:|" * (2 + len(COUNTED)),
        *(
            f"| {name} | {how} | {one.seed} | {one.trials} | "
            + " | ".join(str(one.found[key]) for key in COUNTED)
            + " |"
            for (name, how), one in found.items()
        ),
        "",
        "Where there are fewer trials than asked for, that part was run with fewer; "
        "a part of another seed was run apart.",
        "",
        "Run again after the last SIGKILL, what was wrong: "
        + ", ".join(f"{name} {count}" for name, count in undone.items())
        + ".",
    ]
    return "\n".join(lines) + "\n"


def journalled(journal: Path | None) -> tuple[dict[tuple[str, str], Counts], dict[str, int]]:
    """What a journal has of commands ended so often by each signal, and of commands run again; nothing without one."""
    found: dict[tuple[str, str], Counts] = {}
    undone: dict[str, int] = {}
    for line in journal.read_text("utf-8").splitlines() if journal and journal.exists() else []:
        one = json.loads(line)
        found[one["command"], one["signal"]] = Counts(one["trials"], one["seed"], one["found"])
        undone |= one["undone"]
    return found, undone


def ended(name: str, command: list[str], kill: signal.Signals, given: argparse.Namespace, folder: Path) -> JsonObject:
    """End a command by a signal, as often as asked, at moments of the time that it takes now; a line of the journal."""
    good, seconds = trial(command, folder / "good", None, 0)
    if any(good.values()):
        raise SystemExit(f"{name} does not end well by itself: {good}: {(folder / 'good/said').read_text()}")
    rmtree(folder / "good")
    dice, counts, undone = Random(f"{given.seed}.{name}.{kill.name}"), Counts(seed=given.seed), {}
    for number in range(given.trials):
        here = folder / f"{name}{kill.name}{number}"
        counts.add(**trial(command, here, kill, dice.uniform(0, seconds))[0])
        if kill == signal.SIGKILL and number == given.trials - 1:
            undone[name] = again(command, here, name)
        rmtree(here)
    return {"command": name, "signal": kill.name, **vars(counts), "undone": undone}


def main() -> None:
    """Kill, count, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=["run", "sweep", "export", "diagnose", "hardware"])
    parser.add_argument("--journal", type=Path, help="file of what is done: a run that ended early goes on from there")
    parser.add_argument("--so-far", action="store_true", help="only write the table of what the journal has")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    if given.so_far:
        written(given)
        return
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell lets what runs in its background ignore it
    folder = Path(tempfile.mkdtemp(prefix="kills-"))
    journal = given.journal or folder / "journal"
    try:
        todo = {name: one for name, one in commands(folder).items() if name in given.only}
        for (name, command), kill in product(todo.items(), SIGNALS):
            if (name, kill.name) not in journalled(journal)[0]:
                line = json.dumps(ended(name, command, kill, given, folder))
                print(line, flush=True)
                with journal.open("a", encoding="utf-8") as file:
                    file.write(line + "\n")
        written(argparse.Namespace(**{**vars(given), "journal": journal}))
    finally:
        rmtree(folder, ignore_errors=True)


def written(given: argparse.Namespace) -> None:
    """Write the table of what the journal has; rows may be of runs with other seeds."""
    found, undone = journalled(given.journal)
    given.out.mkdir(parents=True, exist_ok=True)
    line = f"python bench/kills.py --trials {given.trials} --seed {given.seed} --out results/robustness"
    with replacing(given.out / "kills.md", force=True) as partial:
        partial.write_text(page(found, undone, line), "utf-8")


if __name__ == "__main__":
    main()
