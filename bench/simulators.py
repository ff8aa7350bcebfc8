"""Five measured machines in three simulators: error on recordings that were not fitted, beside that of the FMU.

python bench/simulators.py --data FOLDER --out results/exchange

FOLDER holds a folder for each machine with its recordings (results/measured says where they are from). The card is that
of a quick diagnosis of the training recordings; each simulator's file is then compared with it along the others.
"""

import argparse
import platform
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from cosim.api.diagnose import diagnose
from cosim.api.recordings import read
from cosim.support.version import __version__
from cosim_simulators import FORMATS
from cosim_simulators.measure import Held, hold
from cosim_simulators.motion import along_recording
from pyfmi_models.card import Card, read_card


@dataclass(frozen=True)
class Machine:
    """A machine: its folder, its card there or a shipped one, and which recordings are fitted and which judge."""

    folder: str
    card: str
    train: tuple[str, ...]
    heldout: str


MACHINES = (
    Machine("emps", "emps", ("estimation",), "validation_pulses"),
    Machine("frc_flywheel", "card.toml", ("fast_forward", "slow_forward", "slow_backward"), "fast_backward"),
    Machine("ur10e_joints", "card_j1.toml", ("j1_a",), "j1_b"),
    Machine("staubli_tx40", "card_j1.toml", ("j1_a",), "j1_b"),
    Machine("moteus_dynamometer", "card_ex8.toml", ("ex8_a", "ex8_b"), "ex8_c"),
)


def main() -> None:
    """Write simulators.csv and simulators.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    chosen = parser.parse_args()
    rows = [row for machine in MACHINES for row in _rows(machine, chosen.data / machine.folder)]
    table = pd.DataFrame(rows)
    chosen.out.mkdir(parents=True, exist_ok=True)
    table.to_csv(chosen.out / "simulators.csv", index=False)
    (chosen.out / "simulators.md").write_text(_page(table), "utf-8")
    print(table.to_string(index=False))


def _rows(machine: Machine, folder: Path) -> Iterator[dict[str, object]]:
    card = read_card(folder / machine.card if machine.card.endswith(".toml") else machine.card)
    columns = dict(card.columns)
    train = [read(folder / f"{name}.parquet", columns=columns) for name in machine.train]
    heldout = read(folder / f"{machine.heldout}.parquet", columns=columns)
    found: Card = diagnose(train, [heldout], card, quick=True).card
    mount = found.plant()
    compared = along_recording(heldout, mount)
    for form in FORMATS.values():
        held = hold(mount, form, compared)
        yield _row(machine, found, held)


def _row(machine: Machine, card: Card, held: Held) -> dict[str, object]:
    lost = [f"{row.part} {row.lost:.2g}" for row in held.rows if row.lost and row.lost > 0.01 * held.needed]
    return {
        "machine": f"{machine.folder} {machine.heldout}",
        "law": ", ".join([card.friction.key, *(effect.id for effect in card.effects)]),
        "simulator": held.format.title,
        "unit": held.unit,
        "needed": f"{held.needed:.3g}",
        "error of the FMU": f"{held.card_error:.3g}",
        "error of the file": f"{held.held_error:.3g}",
        "ratio": f"{held.ratio:.2f}",
        "lost, above 1 % of what is needed": "; ".join(lost) or "nothing",
    }


def _page(table: pd.DataFrame) -> str:
    head = "| " + " | ".join(table.columns) + " |\n|" + " --- |" * len(table.columns)
    body = "\n".join("| " + " | ".join(map(str, row)) + " |" for row in table.itertuples(index=False))
    within = ", ".join(
        f"{name} {sum(float(x) <= 1.05 for x in rows['ratio'])} of {len(rows)}"
        for name, rows in table.groupby("simulator", sort=False)
    )
    return f"""# One card in three simulators

`python bench/simulators.py --data FOLDER --out results/exchange`
mount-cosim {__version__}, {platform.machine()}

The card is that of a quick diagnosis of the training recordings. RMS torque below 30 Hz along a recording that was not
fitted: of the FMU's equations, and of what a simulator's file holds of them. Friction that a simulator does not have is
the nearest that it has, fitted to the card's torque along this motion, not to the recorded one. What the files do in
MuJoCo itself is tested in `tests/simulators`.

Error within 5 % of the FMU's: {within}.

{head}
{body}
"""


if __name__ == "__main__":
    main()
