"""Measured recordings of six machines: how each is read, and how its README judges it. The tool knows none of this.

A machine conceals physics from the card below; recordings, columns and units go through the public interface.
"""

import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cosim.data.recording import Recording
from cosim.diagnosis.diagnose import Outcome, diagnose
from cosim.reading import read_recordings
from pyfmi_models.card import parse_card
from pyfmi_models.mount import Mount

sys.path.append(str(Path(__file__).parent))
from judges import PER_SPEED, Judge, moving, slow_volts
from official import position_error

Score = Judge | Callable[[Mount, Sequence[Recording]], float]


@dataclass(frozen=True)
class Machine:
    """Recordings of one machine, what its owner believes, and how its README judges a model."""

    name: str
    concealed: str
    card: str
    train: dict[str, pd.DataFrame]
    heldout: dict[str, pd.DataFrame]
    score: Score
    unit: str
    bar: float
    first_look: str
    columns: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    elsewhere: dict[str, dict[str, pd.DataFrame]] = field(default_factory=dict)
    """Further recordings that only judge: what does the model say of them?"""
    otherwise: dict[str, tuple[Score, str]] = field(default_factory=dict)
    """Further judges of the held-out recordings, each with its unit."""
    derived: Callable[[Outcome], str] = lambda outcome: ""
    """What its README asks of the answer beside an error."""


def rows(machine: Machine) -> Iterator[dict[str, Any]]:
    """Diagnose one machine and judge base and improved model as its README does."""
    card = parse_card(machine.card, "card.toml")
    with tempfile.TemporaryDirectory() as folder:
        train, held = (_read(machine, tables, Path(folder)) for tables in (machine.train, machine.heldout))
        others = {name: _read(machine, tables, Path(folder)) for name, tables in machine.elsewhere.items()}
    outcome = diagnose(train, held, card)
    models = {
        "refitted": outcome.refitted,
        "names alone": outcome.named,
        "with what is learned": outcome.card,
        "no veto": outcome.proposed,
    }
    found = outcome.diagnosis
    judged = [("", held, machine.score, machine.unit)]
    judged += [(name, recordings, machine.score, machine.unit) for name, recordings in others.items()]
    judged += [(name, held, score, unit) for name, (score, unit) in machine.otherwise.items()]
    for name, recordings, score, unit in judged:
        numbers = {key: f"{score(model.plant(), recordings):.3g}" for key, model in models.items()}
        yield {
            "machine": f"{machine.name}{', ' if name else ''}{name}",
            "concealed": machine.concealed if not name else "",
            "verdict": " + ".join(found.verdict) or "none" if not name else "",
            "sets": "; ".join(" or ".join(group) for group in found.ambiguous_with) if not name else "",
            **numbers,
            "95 %": score.interval(outcome.card.plant(), recordings) if isinstance(score, Judge) else "",
            "unit": unit,
            "first look": machine.first_look if not name else "",
            "bar": f"{machine.bar:g}" if not name else "",
            "asked besides": machine.derived(outcome) if not name else "",
            "seconds": f"{found.seconds:.0f}" if not name else "",
        }


def _read(machine: Machine, tables: dict[str, pd.DataFrame], folder: Path) -> list[Recording]:
    paths = [folder / f"{name}.parquet" for name in tables]
    for path, table in zip(paths, tables.values(), strict=True):
        table.to_parquet(path, index=False)
    card = parse_card(machine.card, "card.toml")
    return read_recordings(paths, card.columns, machine.columns, machine.units, card.mount.motion)


def machines(data: Path) -> Iterator[Machine]:
    """All machines whose folder is there."""
    from measured_later import anticogging, pendulum

    makers = {"emps": emps, "screw_drives": screws, "servo_pendulum_sts3215": servo, "bldc_cogging": motor}
    makers |= {"quasi_direct_pendulum": pendulum, "anticogging_motor": anticogging}
    for folder, make in makers.items():
        if (data / folder).exists():
            yield from make(data / folder)


def emps(folder: Path) -> Iterator[Machine]:
    names = ("estimation", "validation_pulses")
    train, held = ({name: pd.read_parquet(folder / f"{name}.parquet")} for name in names)
    yield Machine(
        name="EMPS, ball screw",
        concealed="friction_asymmetry, delay, stribeck",
        card=(files("pyfmi_models") / "cards" / "emps.toml").read_text("utf-8"),
        train=train,
        heldout=held,
        score=moving(2e-3, 100.0),
        unit="N",
        bar=2.1,
        first_look="5.35 -> 2.06",
        otherwise={"official protocol: open loop from the force": (position_error, "mm")},
    )


SCREW = """
[mount]
inertia = 2.186e-6
[friction]
model = "coulomb"
Fc = 3e-3
sigma2 = 3e-5
"""


def screws(folder: Path) -> Iterator[Machine]:
    """One recording a constant speed; every second speed is fitted."""
    table = pd.read_parquet(folder / "screw_drives.parquet")
    steady = table[table.test == "steady"]
    looks = {"lead_screw": "12.6 -> 1.3", "antibacklash_lead_screw": "2.8 -> 2.2"}
    concealed = {"lead_screw": "torque_offset, stribeck", "antibacklash_lead_screw": "torque_offset, no stribeck"}
    for drive, look in looks.items():
        runs = [run[["t", "v", "tau"]] for _, run in steady[steady.drive == drive].groupby("speed_set_file_rpm")]
        named = {f"{drive}_{number}": run for number, run in enumerate(runs)}
        halves = [dict(list(named.items())[first::2]) for first in (0, 1)]
        for number, (train, held) in enumerate((halves, halves[::-1])):
            yield Machine(
                name=drive.replace("_", " ") + (", halves exchanged" if number else ""),
                concealed=concealed[drive],
                card=SCREW,
                train=train,
                heldout=held,
                score=PER_SPEED,
                unit="%",
                bar=1.5 if drive == "lead_screw" else 2.8,
                first_look=look,
                units=("t=s",),
            )


VOLTS = 12.0 * 3.5555 / 7.1214
"""Torque at full duty [N m]: supply times torque constant over resistance, as its owners state them."""
SERVO = """
[mount]
inertia = 0.045
[friction]
model = "coulomb"
Fc = 0.1
sigma2 = 1.8
[[effects]]
effect = "known_load"
[[effects]]
effect = "torque_offset"
torque = 0.0
"""


def servo(folder: Path) -> Iterator[Machine]:
    """Slow runs up and down; two of four masses are fitted. The known load changes from run to run."""
    runs = pd.read_parquet(folder / "runs.parquet")
    table = pd.read_parquet(folder / "recordings.parquet").astype({"t": float, "q": float, "duty": float})
    table = table[(table.q > -3.1) & (table.q < 3.1)]
    slow = runs[(runs.trajectory == "up_and_down") & (runs.kp >= 12) & (runs.repetition <= 2)]

    def tables(masses: tuple[float, ...]) -> dict[str, pd.DataFrame]:
        wanted = slow[slow.mass_kg.round(2).isin([round(mass, 2) for mass in masses])]
        return {f"run_{one.run}": loaded(one) for one in wanted.itertuples()}

    def loaded(one: Any) -> pd.DataFrame:
        run = table[table.run == one.run][["t", "q", "duty"]]
        return run.assign(load_torque=one.gravity_torque_max * np.sin(run.q))

    yield Machine(
        name="geared servo lifting a pendulum",
        concealed="stribeck, load_dependent_friction",
        card=SERVO,
        train=tables((0.535, 1.1682)),
        heldout=tables((0.741, 0.969)),
        score=slow_volts(VOLTS),
        unit="V",
        bar=0.28,
        first_look="0.384 -> 0.270",
        columns=("tau=duty",),
        units=(f"tau={VOLTS!r} N.m", "q=rad", "load_torque=N.m"),
    )


MOTOR = """
[mount]
inertia = 2.5e-4
[friction]
model = "coulomb"
Fc = 9e-3
sigma2 = 1e-3
"""


def motor(folder: Path) -> Iterator[Machine]:
    """Slow turns of a motor; its current times its torque constant is the torque."""
    table = pd.read_parquet(folder / "slow_rotation.parquet")

    def tables(*names: str) -> dict[str, pd.DataFrame]:
        return {name: table[table.run == name][["t", "q", "i_q"]] for name in names}

    again = [f"slow_goodgains_2_nocomp_{k}" for k in range(3)]
    yield Machine(
        name="motor with cogging",
        concealed="cogging",
        card=MOTOR,
        train=tables("slow2_nocomp_0", "slow2_nocomp_1"),
        heldout=tables("slow2_nocomp_2", *again),
        score=moving(0.0, 30.0, 1e3),
        unit="mN.m",
        bar=12,
        first_look="35.8 -> 11.0",
        columns=("tau=i_q",),
        units=("tau=0.0551 N.m", "q=rad"),
        elsewhere={
            "at 0.03 turns a second": tables("slow2_slower_nocomp_0"),
            "neighbour motor turned": tables("slow2_slower_crosstalk_nocomp_0"),
        },
    )
