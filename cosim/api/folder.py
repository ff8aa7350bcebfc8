"""`cosim.diagnose_folder`: the recordings of several machines, each machine diagnosed in a process of its own.

OUT/MACHINE/          what `cosim diagnose` writes
OUT/machines.jsonl    a line for each machine as it is done: what is done goes on from there after a kill
"""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from cosim.api.machine_work import Options, Order, PortableOrder, diagnose_away, diagnose_here, take
from cosim.api.machines import DOCUMENT, JOURNAL, Machine, MachineResult, machines_in, read_result
from cosim.support.cell import LostError
from cosim.support.cells import as_they_come, close_cells, most_workers, own_cell, threads
from cosim.support.cluster import connected
from cosim.support.command import command_of
from cosim.support.errors import CosimError, InputError
from cosim.support.html import table as html_table
from cosim.support.lock import claimed

if TYPE_CHECKING:
    import pandas as pd

AS_FILES = "a folder each, or north_1.csv north_2.csv south_1.csv"
"""How recordings of several machines lie in a folder, for people."""
OnMachine = Callable[[MachineResult, int, int], None]
"""Called with what came of a machine, machines done, machines in all."""


@dataclass(frozen=True)
class FolderResult:
    """What came of the machines of a folder, in the order in which they came."""

    machines: tuple[MachineResult, ...]
    out: Path

    @property
    def missing(self) -> dict[str, tuple[str, ...]]:
        """Ids of the effects that each machine's card lacks, by machine; machines without an answer are left out."""
        return {one.name: one.missing for one in self.machines if not one.error}

    @property
    def errors(self) -> dict[str, str]:
        """Why there is no answer, by machine."""
        return {one.name: one.error for one in self.machines if one.error}

    def frame(self) -> "pd.DataFrame":
        """Return a table, a row a machine: verdict, validation errors, folder, or why there is no answer."""
        import pandas as pd

        return pd.DataFrame([one.as_json() for one in self.machines])

    def __repr__(self) -> str:
        lost = f", {len(self.errors)} without an answer" if self.errors else ""
        lacking = sum(bool(names) for names in self.missing.values())
        return (
            f"FolderResult({len(self.machines)} machines, {lacking} with missing effects{lost}, out={str(self.out)!r})"
        )

    def __str__(self) -> str:
        return "\n".join(map(str, self.machines))

    def _repr_html_(self) -> str:
        rows = [
            {"machine": one.name, "missing": ", ".join(one.missing) or one.error or "nothing", "report": str(one.out)}
            for one in self.machines
        ]
        return html_table("Machines", rows)


def diagnose_folder(
    folder: str | Path | Sequence[Machine],
    out: str | Path,
    *,
    card: str | Path = "",
    motion: str = "",
    columns: Mapping[str, str] | Iterable[str] = (),
    units: Mapping[str, str] | Iterable[str] = (),
    layout: Mapping[str, str] | Iterable[str] = (),
    fmu: str | Path | None = None,
    variables: Mapping[str, str] | None = None,
    quick: bool = False,
    with_possible: bool = False,
    workers: int | None = None,
    cluster: str = "",
    force: bool = False,
    on_machine: OnMachine = lambda result, done, of: None,
) -> FolderResult:
    """Diagnose the recordings of several machines, each machine in a process of its own.

    What was begun in `out` is continued: a machine whose files, card and options are the same is not diagnosed again.

    Args:
        folder: a folder of a folder each, or of files that are paired by name (north_1.csv, north_2.csv, south_1.csv);
            or the machines that `cosim.api.machines.machines_in` lists.
        out: folder of the answers, a folder a machine.
        card: of machines that have no NAME.toml or card.toml: a path, or the name of a shipped one; "" estimates one.
        motion: "rotary" or "linear", where there is neither a card nor a unit that says it.
        columns: our name to the files', {"tau": "force"}; or pairs as on the command line, "run3.csv:tau=current".
        units: our name to the unit in the files, in the same ways.
        layout: CSV format, in the same ways.
        fmu: a third-party plant FMU as the base of all.
        variables: our name to the FMU's, where they differ.
        quick: write diagnosis.json and card.toml alone.
        with_possible: let cards hold effects that are only possible too.
        workers: machines at a time; the cores of this computer where not given.
        cluster: address of a Dask scheduler, tcp://host:8786, whose workers diagnose instead; files are sent there.
        force: diagnose again what is there.
        on_machine: called with what came of a machine, the number of machines done, and of all.

    Returns:
        `FolderResult`. A machine that cannot be diagnosed costs itself alone: `errors` says why.

    Raises:
        InputError: the folder holds no several machines, or results would come between recordings.
        OutputError: another process diagnoses into `out`, or it cannot be written.
        SweepError: nobody answers at the address of the cluster. MissingPackageError: Dask is not installed here.
    """
    machines = list(folder) if not isinstance(folder, str | Path) else machines_in(Path(folder))
    if not machines:
        raise InputError(f"{folder} holds no recordings of several machines: {AS_FILES}.", culprit=str(folder))
    named = {"columns": _pairs(columns), "units": _pairs(units), "layout": _pairs(layout)}
    base, names = None if fmu is None else Path(fmu), dict(variables or {})
    options = Options(motion=motion, fmu=base, variables=names, quick=quick, with_possible=with_possible, **named)
    orders = [Order(one, str(one.card or card), Path(out) / one.name, options) for one in machines]
    _check_folders(orders)
    done = _reported(_conducted(orders, Path(out), workers, cluster, force), on_machine, len(orders))
    return FolderResult(tuple(done), Path(out))


def _reported(results: Iterable[MachineResult], on_machine: OnMachine, of: int) -> Iterator[MachineResult]:
    for number, one in enumerate(results, 1):
        on_machine(one, number, of)
        yield one


def _pairs(given: Mapping[str, str] | Iterable[str]) -> tuple[str, ...]:
    return tuple(f"{ours}={theirs}" for ours, theirs in given.items()) if isinstance(given, Mapping) else tuple(given)


def _check_folders(orders: Sequence[Order]) -> None:
    for one in orders:
        if one.out.resolve() in {path.parent.resolve() for path in one.machine.train}:
            text = f"--out {one.out.parent}: results of {one.machine.name} would come between its recordings; "
            raise InputError(f"{text}name another folder.", culprit=str(one.out.parent))


def _conducted(
    orders: Sequence[Order], out: Path, workers: int | None, cluster: str, force: bool
) -> Iterator[MachineResult]:
    """Yield what is there already, then what is diagnosed, as it comes; each stands in the journal before."""
    size = most_workers(workers, len(orders))
    with claimed(out, "cosim diagnose"):
        keys = {one.machine.name: one.key() for one in orders}
        known = {} if force else _journal(out)
        there = [one for one in orders if _is_done(one, keys, known)]
        yield from (read_result(one.machine.name, one.out, earlier=True) for one in there)
        rest = [one for one in orders if one not in there]
        if not rest:
            return
        with ExitStack() as stack:
            journal = stack.enter_context((out / JOURNAL).open("a" if known else "w", encoding="utf-8"))
            journal.write("\n" if known else "")  # a kill may have left half a line
            pool = _on_cluster(cluster) if cluster else _here(size)
            submit, most = stack.enter_context(pool)
            for result in as_they_come(rest, submit, most):
                _note(journal, result, keys[result.name])
                yield result


def _is_done(order: Order, keys: Mapping[str, str], known: Mapping[str, str]) -> bool:
    name = order.machine.name
    return known.get(name) == keys[name] and not read_result(name, order.out).error


def _journal(out: Path) -> dict[str, str]:
    """Return the keys of what is done, by machine; a line that a kill left half written is none."""
    found = {}
    with suppress(OSError):
        for line in (out / JOURNAL).read_text("utf-8", "replace").splitlines():
            with suppress(ValueError, TypeError, KeyError):
                row = json.loads(line)
                found[str(row["machine"])] = "" if "error" in row else str(row["key"])
    return found


def _note(journal: IO[str], result: MachineResult, key: str) -> None:
    journal.write(json.dumps({**result.as_json(), "key": key}) + "\n")
    journal.flush()


Submit = Callable[[Order], "Future[MachineResult]"]


@contextmanager
def _here(workers: int) -> Iterator[tuple[Submit, int]]:
    """Diagnose in processes of this computer, which end with this one."""
    with threads(workers, "machine") as executor:
        yield lambda order: executor.submit(_diagnosed, order), workers


@contextmanager
def _on_cluster(address: str) -> Iterator[tuple[Submit, int]]:
    """Diagnose on a Dask cluster; errors as of `connected`."""
    with connected(address, close_cells) as (client, size), ThreadPoolExecutor(2 * size, "machine") as waiting:

        def away(order: Order) -> MachineResult:
            portable = client.scatter(PortableOrder.of(order), hash=False)
            future = client.submit(_remote, portable, _command(order), pure=False)
            return _result(order, lambda: take(_arrived(future), order.out))

        yield lambda order: waiting.submit(away, order), 2 * size


def _arrived(future: Any) -> dict[str, bytes]:
    """Return the files that a worker made (CosimError: its own, or the worker is gone)."""
    try:
        files: dict[str, bytes] = future.result()
    except (CosimError, OSError, MemoryError):
        raise
    except Exception as error:  # what Dask raises for a worker that is gone comes in many shapes
        raise InputError(f"The cluster lost it: {error}") from error
    return files


def _remote(portable: PortableOrder, command: str) -> dict[str, bytes]:
    """Diagnose in the cell of this thread of a worker; return the files of the answer (CosimError)."""
    try:
        found: dict[str, bytes] = own_cell().call(diagnose_away, portable, command)
    except LostError as loss:  # it does not travel
        raise InputError(str(loss)) from None
    return found


def _diagnosed(order: Order) -> MachineResult:
    """Diagnose in the cell of this thread."""
    return _result(order, lambda: own_cell().call(diagnose_here, order, _command(order)))


def _result(order: Order, work: Callable[[], object]) -> MachineResult:
    """Return what came of a machine: what is refused or crashes is said of it, and costs no other one."""
    with suppress(OSError):
        (order.out / DOCUMENT).unlink(missing_ok=True)  # what is written over is no answer any more
    try:
        work()
    except (CosimError, LostError, OSError, MemoryError) as error:
        return MachineResult(order.machine.name, order.out, {}, str(error) or type(error).__name__)
    return read_result(order.machine.name, order.out)


def _command(order: Order) -> str:
    """The command line that diagnoses this machine alone."""
    options = {"--heldout": [*order.machine.heldout], "--card": order.card, "--out": order.out}
    return command_of("diagnose", order.machine.train, options | order.options.words())
