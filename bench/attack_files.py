"""Recordings made to cost memory or time, or to read other files: what does `cosim show` say, how long, how much?

    python bench/attack_files.py [--seed 1] [--only hdf5] [--cosim COSIM] [--json]

Each maker writes one small file from a seed; `FILES` has them by name. Every file of up to 50 MB must end in an answer
or a sentence within 20 s and 1 GB; those of `FOREIGN` try to read other files and must be refused.
tests/data/test_bounds_of_readers.py reads a sample of them.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from random import Random
from typing import IO

sys.path.insert(0, str(Path(__file__).parent))

import attack_files_bags
import attack_files_hdf5
import attack_files_mcap
import attack_files_tables
from tree_cost import megabytes

Maker = Callable[[Random, Path], None]
"""Writes a file at the path, as the dice say."""

FILES: dict[str, tuple[str, Maker]] = {
    f"{kind}: {make.__doc__.rstrip('.').lower()}": (suffix, make)
    for module in (attack_files_hdf5, attack_files_bags, attack_files_mcap, attack_files_tables)
    for kind, (suffix, makers) in module.KINDS.items()
    for make in makers
}
"""Name to suffix and maker."""
FOREIGN = frozenset(name for name, (_, make) in FILES.items() if make.__name__.endswith("_elsewhere"))
"""Those that try to read another file."""
LONG = frozenset(
    name
    for name, (_, make) in FILES.items()
    if make.__name__.startswith(("many_", "unwritten_small", "zeros_as_text", "wide_messages", "zeros_in_archive"))
)
"""Those that take seconds to make or to refuse: all of the packed texts."""
SECRET = bytes(range(33, 126)) * 4
"""What the file beside them holds, that none may read."""
SECONDS, MEGABYTES, PATIENCE = 20.0, 1000.0, 90.0
"""Seconds of a processor and MB that a file may cost; seconds of the clock, which has other things to do."""


@dataclass(frozen=True)
class Cost:
    """What a file cost: bytes, exit code, seconds of the clock and of a processor, peak of memory of all its
    processes together [MB], last line.
    """

    name: str
    size: int
    code: int
    seconds: float
    busy: float
    megabytes: float
    said: str

    @property
    def is_fine(self) -> bool:
        """Whether it ended in an answer or a sentence within the limits."""
        ended = self.code == 0 or (self.code in (1, 2) and self.said.startswith("cosim: "))
        return ended and "Traceback" not in self.said and self.busy < SECONDS and self.megabytes < MEGABYTES


def sampled(count: int, seed: int) -> list[str]:
    """Return so many names of each kind that a seed draws, none of which takes long."""
    kinds = {name.partition(":")[0] for name in FILES}
    short = {kind: [name for name in FILES if name.startswith(f"{kind}:") and name not in LONG] for kind in kinds}
    return [name for kind in sorted(kinds) for name in Random(seed).sample(short[kind], min(count, len(short[kind])))]


def made(name: str, seed: int, folder: Path) -> Path:
    """Write the file of a name for a seed, with the secret beside it."""
    suffix, make = FILES[name]
    (folder / "secret.bin").write_bytes(SECRET)
    path = folder / f"run{suffix}"
    path.unlink(missing_ok=True)
    make(Random(f"{seed}.{name}"), path)
    return path


def cost(name: str, path: Path, command: list[str]) -> Cost:
    """Run a command on a file; without a command, read it in a fork of this process."""
    began = time.monotonic()
    with tempfile.TemporaryFile("w+") as out:
        process = (
            subprocess.Popen([*command, str(path)], stdout=out, stderr=out).pid if command else _reading(path, out)
        )
        most = 0.0
        while (ended := os.wait4(process, os.WNOHANG))[0] == 0:
            most = max(most, megabytes(process))
            if time.monotonic() - began > PATIENCE:
                os.kill(process, signal.SIGKILL)
                ended = os.wait4(process, 0)
                break
            time.sleep(0.05)
        _, status, used = ended
        out.seek(0)
        text = out.read()
    said = "Traceback" if "Traceback" in text else (text.strip().splitlines() or [""])[-1]
    return Cost(
        name,
        path.stat().st_size,
        os.waitstatus_to_exitcode(status),
        time.monotonic() - began,
        used.ru_utime + used.ru_stime,
        most,
        said.replace(str(path), path.name),
    )


def _reading(path: Path, out: IO[str]) -> int:
    """Read a file in a fork; returns the number of its process."""
    import cosim
    from cosim.data.binary import apart
    from cosim.support.errors import CosimError

    process = os.fork()
    if process == 0:
        code = 70
        try:
            cosim.read(path)
            code = 0
        except CosimError as error:
            print(f"cosim: {error}", file=out)
            code = 2
        except BaseException:
            traceback.print_exc(file=out)
        finally:
            out.flush()
            apart.close()
            os._exit(code)
    return process


def main() -> None:
    """Make the files, show each, print what each cost."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="part of the name")
    parser.add_argument("--cosim", default="cosim")
    parser.add_argument("--read", action="store_true", help="cosim.read in a fork, in place of the command")
    parser.add_argument("--sample", type=int, default=0, help="so many files of each kind, none that takes long")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    command = [] if given.read else [given.cosim, "show"]
    costs = []
    with tempfile.TemporaryDirectory() as folder:
        for name in sampled(given.sample, given.seed) if given.sample else FILES:
            if given.only in name:
                one = cost(name, made(name, given.seed, Path(folder)), command)
                costs.append(one)
                if not given.json:
                    mark = "     " if one.is_fine and (name not in FOREIGN or one.code) else "FAULT"
                    print(
                        f"{mark} {name:60} {one.size / 1e6:8.3f} MB {one.seconds:6.1f} s {one.busy:6.1f} s "
                        f"{one.megabytes:6.0f} MB {one.code:4} {one.said[:230]}",
                        flush=True,
                    )
    if given.json:
        print(json.dumps([asdict(one) for one in costs], indent=1))
    elif costs:
        worst = max(one.busy for one in costs), max(one.seconds for one in costs), max(one.megabytes for one in costs)
        print("{} files; worst: {:.1f} s of a processor, {:.1f} s, {:.0f} MB".format(len(costs), *worst))


if __name__ == "__main__":
    main()
