"""The whole chain on an embedded example: card -> FMU -> co-simulation -> recording -> diagnosis -> better FMU.

The recording comes from `cosim_studies.proof`: a simulation of its own, with an integrator and a friction of its
own, of a mount whose card lacks two effects.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from cosim.data.recording import Recording
from cosim.delivery.closed_loop import LoopError, Loops
from cosim.delivery.deliver import deliver
from cosim.diagnosis.answer.result import Diagnosis
from cosim.diagnosis.diagnose import diagnose
from cosim.support.cell import Cell
from cosim.support.files import directory
from cosim_studies.proof.demo import demo_case
from cosim_studies.proof.generator import write_case
from cosim_studies.stiffness import compare, table_text
from pyfmi_models.card import Card, read_card
from pyfmi_models.export import export_fmu

SEED, SECONDS = 7, 30.0
TABLE = "integration.txt"
HEADING = "The stiff bristle state inside the FMU, beside the paper's analytic update, at 0.1 ms"


@dataclass(frozen=True)
class Demo:
    """What the demo made: the integration table, loop errors before and after, and the diagnosis."""

    table: str
    before: LoopError
    after: LoopError
    diagnosis: Diagnosis


def run_demo(out: Path, command: str, on_progress: Callable[[str], None]) -> Demo:
    """Run the chain and leave its files in `out`."""
    directory(out)
    on_progress("recording a mount with concealed physics")
    write_case(demo_case(SEED, SECONDS), out / "night")
    card = read_card(out / "night" / "card.toml")
    train = [Recording.read(out / "night" / f"train_{k}.parquet") for k in (1, 2)]
    heldout = Recording.read(out / "night" / "heldout.parquet")
    on_progress("building FMUs of plant and controller")
    plant, _ = export_pair(card, out / "fmus")
    on_progress("co-simulating plant and controller at 0.1 ms, checking the stiff integration")
    with Loops(card, [heldout]) as loops, in_own_process(integration, card) as table:
        loops.close("nominal", card.plant(), plant)
        outcome = diagnose(train, [heldout], card, on_progress, loops.close)
        found = deliver(outcome, train, [heldout], card, out / "diagnosis", command, loops, on_progress)
        for key, name in (("nominal", "simulated"), ("after", "improved")):
            replace(*loops.runs(key), name=name).write(out / f"{name}.parquet", force=True)
        errors, text = loops.errors(), f"{HEADING}\n\n{table.result()}"
        (out / TABLE).write_text(text, "utf-8")
        return Demo(text, errors["nominal"], errors["after"], found)


def integration(card: Card) -> str:
    """Table of what the stiff integration inside the FMU is worth."""
    return table_text(compare(card))


@contextmanager
def in_own_process(function: Callable[[Card], str], card: Card) -> Iterator[Future[str]]:
    """Call a function in a process of its own, which ends with the block, while this one goes on."""
    cell = Cell()
    with ThreadPoolExecutor(1) as thread, closing(cell):
        yield thread.submit(cell.call, function, card)


def export_pair(card: Card, folder: Path) -> tuple[Path, Path]:
    """Export plant and controller in both FMI versions; return the paths of the FMI 3 archives."""
    directory(folder)
    paths = []
    for part, model in (("plant", card.plant().model()), ("controller", card.controller_model())):
        named = replace(model, name=part)
        export_fmu(named, folder / f"{part}_fmi2.fmu", fmi=2, force=True)
        paths.append(export_fmu(named, folder / f"{part}.fmu", fmi=3, force=True))
    return paths[0], paths[1]
