"""Recordings of a machine whose physics is partly concealed, with the card its owner believes in and the sealed truth.

    case = make_case(3, ["cogging"])                     # two training recordings, one held out, a card, the truth
    case = make_case(3, ["cogging"], machine="any")      # the same of a machine of any class, see machines.py
    write_case(case, Path("case"))                       # three Parquet recordings, card.toml, truth.json

    python -m cosim_studies.proof.generator --seed 3 --effects cogging --machine any --out case

Everything is drawn from the seed; the same arguments give the same bits on one machine.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cosim.support.plain import Parsed
from cosim_studies.proof.drivetrain import BETWEEN_COMMAND_AND_READING
from cosim_studies.proof.families import AT_THE_AXIS
from cosim_studies.proof.machines import MACHINES
from cosim_studies.proof.outside import OUTSIDE_EFFECTS
from cosim_studies.proof.recorder import columns_of, decoys, oracle
from cosim_studies.proof.rough import roughen
from cosim_studies.proof.simulated_axis import FRICTIONS, RECORDINGS, SimulatedAxis, draw_axis, stream
from cosim_studies.proof.truth import TICK, Array, simulate
from cosim_studies.proof.workshop import draw_workshop

__all__ = ["FAMILIES", "OUTSIDE", "Case", "make_case", "write_case", "write_given"]

ANY = "any"
"""A machine of any class."""
EFFECTS = {**AT_THE_AXIS, **BETWEEN_COMMAND_AND_READING, **OUTSIDE_EFFECTS}
SWUNG = 3.0
"""A loop that holds its axis stays near 1; one that does not reached 1e69 (rough deck of seed 1128193107, case 52)."""
DRAWN = 20
"""Machines that are drawn at most: of 150 rough ones one swung up, so as many in a row are no accident."""
FAMILIES = (*AT_THE_AXIS, *BETWEEN_COMMAND_AND_READING)
OUTSIDE = tuple(OUTSIDE_EFFECTS)


@dataclass(frozen=True)
class Case:
    """What the tool is given (`card`, `train`, `heldout`) and what it is not (`truth`, `oracle`)."""

    name: str
    card: dict[str, Parsed]
    train: list[pd.DataFrame]
    heldout: pd.DataFrame
    truth: Parsed
    oracle: list[pd.DataFrame]


def make_case(
    seed: int,
    effects: Sequence[str] | None = None,
    size: float = 1.0,
    *,
    friction: str = "mixed",
    noise: float = 1.0,
    rate_hz: int = 1000,
    duration: float = 60.0,
    decoy_columns: bool = True,
    machine: str = "",
    rough: bool = False,
) -> Case:
    """Draw a machine from `seed`, conceal `effects` of relative `size` in it (none: a null) and record it three times.

    Without `machine` it is a telescope mount with a LuGre card: `friction` is then the truth at contact level, "lugre"
    (a bristle), "maxwell_slip" (a row of slip blocks) or "mixed" (30 to 60 % slip blocks in half of the seeds); `noise`
    scales every disturbance; `rate_hz` must divide 10 kHz. A class of machines.py, or "any", draws all of these, the
    card, the loop and the set points too, and recordings of half to all of the duration. `rough`: a machine that is not
    quite what equations say, see rough.py. A machine whose loop does not hold what is concealed (a torque that comes
    late makes fast loops swing up) could not be recorded: then another is drawn.
    """
    _check(effects or (), friction, rate_hz, machine)
    own = seed
    for _ in range(DRAWN):
        if machine:
            bench = draw_workshop(own, tuple(effects or ()), duration, machine.removeprefix(ANY))
        else:
            bench = draw_axis(own, friction, noise, rate_hz, duration)
        found = [conceal(bench, name, own, size) for name in effects or ()]
        if rough:
            roughen(bench, own)
        extra = decoys(stream(own, "decoy"), bench, bench.rate_hz) if decoy_columns else {}
        case = assemble(bench, found, seed, bench.rate_hz, extra)
        if is_held(bench, case):
            return case
        own = int(stream(own, "another machine").integers(2**31))
    raise ValueError(f"seed {seed}: the loops of {DRAWN} machines with {', '.join(effects or ())} swing up")


def is_held(bench: SimulatedAxis, case: Case) -> bool:
    """Whether the axis keeps to what it is asked for: never beyond `SWUNG` times the range of its set points."""
    asked = max(float(np.ptp(drive.target)) for drive in bench.drives.values())
    return all(float(np.ptp(hidden["angle"])) < SWUNG * asked for hidden in case.oracle)


def _check(effects: Sequence[str], friction: str, rate_hz: int, machine: str) -> None:
    if machine and machine not in (ANY, *MACHINES):
        raise ValueError(f"no class of machines is called {machine!r}; choices: {ANY}, {', '.join(MACHINES)}")
    if unknown := [name for name in effects if name not in EFFECTS]:
        raise ValueError(f"no effect is called {unknown[0]!r}; choices: {', '.join(EFFECTS)}")
    if friction not in FRICTIONS:
        raise ValueError(f"friction {friction!r} is none of {', '.join(FRICTIONS)}")
    if rate_hz <= 0 or round(1 / TICK) % rate_hz:
        raise ValueError(f"rate_hz {rate_hz} does not divide the loop rate of {round(1 / TICK)} Hz")


def conceal(bench: SimulatedAxis, name: str, seed: int, size: float) -> Parsed:
    """Write the effect into the bench; its entry of the truth."""
    parameters = EFFECTS[name](bench, stream(seed, f"effect {name}"), size)
    where = parameters.pop("where", None)
    entry: Parsed = {"effect": name, "size": size, "listed": name in FAMILIES, "parameters": parameters}
    return dict(plain(entry | ({"where": where} if where else {})))


def assemble(
    bench: SimulatedAxis, found: list[Parsed], seed: int, rate_hz: int, extra: dict[str, dict[str, Array]]
) -> Case:
    """Run the three recordings and put card and truth beside them."""
    bench.mount["loop_inertia"] = 0.0
    card = perturbed(bench, stream(seed, "card"), 0.25 if bench.setup else 0.15)
    bench.mount["loop_inertia"] = card["mount"]["inertia"]
    tables, hidden = [], []
    for name in RECORDINGS:
        raw = simulate(bench.mount, bench.drives[name], bench.temperature[name])
        tables.append(
            columns_of(bench, name, raw, rate_hz, stream(seed, f"clock {name}")).assign(**extra.get(name, {}))
        )
        hidden.append(oracle(raw, rate_hz))
    label = "+".join(entry["effect"] for entry in found) or "null"
    truth = {"seed": seed, "verdict": verdict(found), "effects": found, **facts(bench)}
    return Case(f"{label}-{seed}", card, tables[:2], tables[2], truth, hidden)


def verdict(found: list[Parsed]) -> list[str]:
    """The right answer: the listed names; "unknown" for what is outside the list; empty for a null."""
    names = [entry["effect"] for entry in found if entry["listed"]]
    return names + ["unknown"] * (len(names) < len(found))


def plain(value: Any) -> Any:
    """`value` with NumPy numbers and arrays as Python's own, so that JSON and TOML can hold it."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def facts(bench: SimulatedAxis) -> Parsed:
    """True base parameters and noise levels, as plain numbers and lists."""
    return {
        "mount": plain(bench.mount),
        "friction_rms": bench.friction_rms,
        "noise": bench.noise,
        "pace": bench.pace._asdict(),
        "setup": plain(bench.setup),
    }


def perturbed(bench: SimulatedAxis, rng: np.random.Generator, by: float = 0.15) -> dict[str, Parsed]:
    """The card: the owner's belief with every number of inertia and friction off by about as much."""
    card = {section: dict(values) for section, values in bench.belief.items()}
    card["mount"]["inertia"] *= 1 + float(rng.uniform(-by, by))
    friction = card["friction"]
    same = friction.get("Fs", friction["Fc"]) == friction["Fc"]
    for key in ("sigma0", "sigma1", "sigma2", "Fc", "Fs", "Vs"):
        factor = float(np.exp(np.clip(by * rng.standard_normal(), -2 * by, 2 * by)))
        if key in friction:
            friction[key] *= factor
    if "Fs" in friction:
        friction["Fs"] = friction["Fc"] if same else max(friction["Fs"], 1.02 * friction["Fc"])
    return dict(plain(card))


def to_toml(card: dict[str, Parsed]) -> str:
    """A card as TOML; strings, integers and floats only."""
    lines: list[str] = []
    for section, values in card.items():
        lines += [f"[{section}]", *(f"{key} = {json.dumps(value)}" for key, value in values.items()), ""]
    return "\n".join(lines)


def write_case(case: Case, directory: Path) -> None:
    """Three Parquet recordings, card.toml and truth.json; the folder is made."""
    write_given(case, directory)
    (directory / "truth.json").write_text(json.dumps(case.truth, indent=1) + "\n", encoding="utf-8")


def write_given(case: Case, directory: Path) -> None:
    """What the tool may see: three Parquet recordings and card.toml; the folder is made."""
    directory.mkdir(parents=True, exist_ok=True)
    for name, table in zip(RECORDINGS, [*case.train, case.heldout], strict=True):
        table.to_parquet(directory / f"{name}.parquet", index=False)
    (directory / "card.toml").write_text(to_toml(case.card), encoding="utf-8")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Write one concealed case.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--effects", nargs="*", default=[], metavar="EFFECT", help=", ".join(EFFECTS))
    parser.add_argument("--size", type=float, default=1.0)
    parser.add_argument("--friction", choices=FRICTIONS, default="mixed")
    parser.add_argument("--noise", type=float, default=1.0)
    parser.add_argument("--rate-hz", type=int, default=1000)
    parser.add_argument("--duration", type=float, default=60.0)
    parser.add_argument("--machine", choices=("", ANY, *MACHINES), default="")
    parser.add_argument("--out", type=Path, required=True)
    return parser.parse_args()


if __name__ == "__main__":
    given = vars(_arguments())
    folder = given.pop("out")
    write_case(make_case(**given), folder)
