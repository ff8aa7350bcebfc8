"""Good binary recordings whose bytes are spoilt, and recordings that were made to cost memory or time."""

import io
import json
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from random import Random

import attack_files
import numpy as np
from attack_mutations import Spoil
from attack_targets import table
from test_ros1_bags import JOINT_STATE, bag, connection, joints


def crafted(kind: str) -> Spoil:
    """Make one of the crafted files of a kind, none that takes long."""
    names = [one for one in attack_files.FILES if one.startswith(f"{kind}: ") and one not in attack_files.LONG]

    def made(dice: Random, raw: bytes) -> tuple[str, bytes]:
        name, seed = dice.choice(names), dice.randrange(10**6)
        with tempfile.TemporaryDirectory(prefix="crafted-") as folder:
            process = os.fork()  # what making a file takes of memory goes with it
            if process == 0:
                attack_files.made(name, seed, Path(folder))
                os._exit(0)
            os.waitpid(process, 0)
            return name[:80], next(Path(folder).glob("run*")).read_bytes()

    return made


def crafted_kinds() -> dict[str, str]:
    """Kinds of crafted files with their suffixes."""
    return {name.partition(":")[0]: suffix for name, (suffix, _) in attack_files.FILES.items()}


def _by_path(suffix: str, write: Callable[[Path], object]) -> tuple[str, bytes]:
    """A recording that a library writes to a path."""
    with tempfile.TemporaryDirectory(prefix="good-") as folder:
        path = Path(folder) / f"axis{suffix}"
        write(path)
        return path.name, path.read_bytes()


def _mdf(path: Path) -> None:
    from asammdf import MDF, Signal

    given = table()
    with MDF() as made:
        for name, unit in (("tau", "N.m"), ("q", "rad")):
            made.append([Signal(given[name].to_numpy(), given["t"].to_numpy(), name=name, unit=unit)])
        made.save(path, compression=1, overwrite=True)


def _bag(path: Path) -> None:
    bag(path, [connection(0, "/joint_states", "sensor_msgs/JointState", JOINT_STATE)], joints(), "bz2")


def binaries() -> list[tuple[str, bytes]]:
    """Good recordings of the kinds that are read in a process of their own."""
    import attack_files_bags
    import attack_files_hdf5

    dice = Random(1)
    return [
        _by_path(".h5", lambda path: attack_files_hdf5.plain(dice, path)),
        _by_path(".mf4", _mdf),
        _by_path(".db3", lambda path: attack_files_bags.plain_bag(dice, path)),
        _by_path(".bag", _bag),
    ]


def arrays() -> list[tuple[str, bytes]]:
    """Good recordings of NumPy, and of JSON, which are read here."""
    given, out = table(), io.BytesIO()
    np.savez_compressed(out, **{name: given[name].to_numpy() for name in given})
    lines = "\n".join(json.dumps(row) for row in given.to_dict("records"))
    records = json.dumps({name: given[name].tolist() for name in given})
    return [("axis.npz", out.getvalue()), ("axis.jsonl", lines.encode()), ("axis.json", records.encode())]
