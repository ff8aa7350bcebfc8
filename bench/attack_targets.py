"""What is attacked: good files of every kind, and what proves that a command has done its work on one."""

import gzip
import io
import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from random import Random

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from attack_mutations import Spoil, of_json, of_text
from attack_worker import Ended

from cosim.cli import main

TESTS = Path(__file__).parents[1] / "tests"


@dataclass(frozen=True)
class Target:
    """One kind of attack: `share` of all; good files, of which one is spoilt; command, and what a success must show."""

    kind: str
    share: int
    seeds: Sequence[tuple[str, bytes]]
    spoil: Spoil
    command: Callable[[Path, Path, Random], list[object] | Callable[[], object]]
    proof: Callable[[Path, Ended, Path, bytes], bool]


def line(arguments: Sequence[object]) -> Callable[[], object]:
    """The command line in this process."""
    return lambda: main([str(one) for one in arguments])


def told(folder: Path, ended: Ended, file: Path, good: bytes) -> bool:
    """`--json` was printed and can be read."""
    with suppress(ValueError):
        return bool(json.loads(ended.out))
    return False


def recorded(folder: Path, ended: Ended, file: Path, good: bytes) -> bool:
    """A recording was written whole, with its statistics, and the path printed."""
    path = folder / "out" / "recording.parquet"
    with suppress(Exception):
        return pq.read_table(path).num_rows > 0 and bool(json.loads((folder / "out" / "run.json").read_text("utf-8")))
    return False


def spoke(folder: Path, ended: Ended, file: Path, good: bytes) -> bool:
    """It said something of what it did."""
    return bool(ended.out.strip() or ended.err.strip())


def same(folder: Path, ended: Ended, file: Path, good: bytes) -> bool:
    """Every number is that of the good recording: only then may a replay be called identical."""
    with suppress(Exception):
        found, before = pq.read_table(file).to_pandas(), pq.read_table(io.BytesIO(good)).to_pandas()
        pairs = [(found[name].astype(float).to_numpy(), before[name].to_numpy()) for name in before.columns]
        return list(found.columns) == list(before.columns) and all(a.tobytes() == b.tobytes() for a, b in pairs)
    return False


def table(rows: int = 600) -> pd.DataFrame:
    """An axis in friction that goes to and fro."""
    t = np.arange(rows) * 1e-2
    v = 0.3 * np.cos(2 * np.pi * 0.5 * t)
    q = 0.3 / np.pi * np.sin(2 * np.pi * 0.5 * t)
    return pd.DataFrame({"t": t, "tau": 2 * v + 0.7 * np.sign(v) - 9.4 * q, "q": q, "q_d": q})


def bytes_of(path: Path) -> tuple[str, bytes]:
    return path.name, path.read_bytes()


CARD = """[mount]
name = "axis"
motion = "rotary"
inertia = 30.0
torque_limit = 50.0
[friction]
model = "lugre"
sigma0 = 1e5
sigma1 = 100.0
sigma2 = { positive = 30.0, negative = 28.0 }
Fc = 2.5
Fs = 3.0
Vs = 1e-3
delta = 2.0
[unbalance]
mgl = 1.0
phase = 0.5
[encoder]
counts_per_rev = 1e6
noise_rms = 1e-7
[controller]
type = "adrc"
kp = 100.0
kd = 20.0
loop_hz = 10000.0
observer_bandwidth = 200.0
compensation = "C2a"
[[effects]]
effect = "cogging"
cycles_per_rev = 20
amplitude = 0.5
phase = 0.1
"""


PLAIN = '[mount]\ninertia = 1.0\n[friction]\nmodel = "coulomb"\nFc = 0.7\nsigma2 = 2.0\n'
"""A card of which a recording is soon identified."""


class Yard:
    """A folder with good files, made once."""

    def __init__(self, folder: Path) -> None:
        from small_loop import TEXT
        from tiny_fmu import build

        self.folder = folder
        self.fmus = {version: build(folder, version) for version in (2, 3)}
        self.scenario = TEXT.replace('"tiny', f'"{folder}/tiny').replace("stop = 0.5", "stop = 0.05")
        (folder / "scenario.toml").write_text(self.scenario)
        self.card = folder / "card.toml"
        self.card.write_text(CARD)
        self.plain = folder / "plain.toml"
        self.plain.write_text(PLAIN)
        self.session = self._session()
        self.recordings = dict(self._recordings())

    def _session(self) -> Path:
        from on_hardware import SCENARIO

        path = self.folder / "session.toml"
        path.write_text(SCENARIO.replace("stop = 0.4", "stop = 0.02"))
        out = self.folder / "session"
        if not out.exists():
            command = [sys.executable, "-m", "cosim", "hardware", "run", str(path), "--fast", "--out", str(out)]
            subprocess.run(command, check=True, capture_output=True)
        return out

    def _recordings(self) -> list[tuple[str, bytes]]:
        from scipy.io import savemat

        given, out = table(), io.BytesIO()
        csv = given.to_csv(index=False).encode()
        made = [("axis.csv", csv), ("axis.csv.gz", gzip.compress(csv))]
        given.to_parquet(out)
        made.append(("axis.parquet", out.getvalue()))
        mat = io.BytesIO()
        savemat(mat, {name: given[name].to_numpy() for name in given})
        return [*made, ("axis.mat", mat.getvalue())]

    def ssp(self) -> tuple[str, bytes]:
        from ssp_files import component, pack, real, system, values, wire

        inside = system(
            component("one", values(real("k", 2.0, "1"))) + component("two"),
            wire("one.y", "two.a") + wire("two.y", "one.b"),
        )
        return bytes_of(pack(self.folder / "pair.ssp", self.fmus[2], inside))

    def of_origin(self, dice: Random, raw: bytes) -> tuple[str, bytes]:
        """Spoil what a recording says of its origin."""
        found = pq.read_table(io.BytesIO(raw))
        meta = dict(found.schema.metadata or {})
        key = dice.choice([one for one in meta if one.startswith(b"cosim")])
        try:
            how, meta[key] = of_json(dice, meta[key])
        except ValueError:
            how, meta[key] = of_text(dice, meta[key])
        out = io.BytesIO()
        pq.write_table(found.replace_schema_metadata(meta), out)
        return how, out.getvalue()

    def of_cells(self, dice: Random, raw: bytes) -> tuple[str, bytes]:
        """Change numbers of a recording, drop or double rows or columns."""
        found = pq.read_table(io.BytesIO(raw))
        meta, frame = found.schema.metadata, found.to_pandas()
        name, row = dice.choice(list(frame.columns)), dice.randrange(len(frame))
        way = dice.randrange(5)
        if way == 0:
            frame[name] = frame[name].astype(float)
            frame.loc[row, name] = float(dice.choice(("nan", "inf", "1e308", "-1", "0", "1e-300", "4294967296")))
        elif way == 1:
            frame.loc[row, name] = np.nextafter(float(frame.loc[row, name]), 1e9)
        elif way == 2:
            frame = frame.drop(index=row)
        elif way == 3:
            frame = frame.drop(columns=name)
        else:
            frame[name] = frame[name].astype(dice.choice(("str", "float32", "category")))
        out = io.BytesIO()
        made = pa.Table.from_pandas(frame, preserve_index=False)
        pq.write_table(made.replace_schema_metadata(meta), out)
        return ("number", "digit", "row", "column", "type")[way], out.getvalue()
