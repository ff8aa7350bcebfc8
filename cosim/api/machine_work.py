"""The diagnosis of one machine of a folder, in a process of its own: here, or on a worker of a Dask cluster.

To a cluster the files go with the order, and the files of the answer come back: nothing must be shared.
"""

import hashlib
import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from cosim.api.machines import DOCUMENT, Machine
from cosim.support.errors import InputError
from cosim.support.files import directory, replacing, sha256
from cosim.support.version import __version__

Pairs = tuple[str, ...]
"""What an option of the command line was given: ("tau=force", "run3.csv:tau=current")."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """What is said of all machines, as the options of `cosim diagnose` say it."""

    motion: str = ""
    columns: Pairs = ()
    units: Pairs = ()
    layout: Pairs = ()
    fmu: Path | None = None
    variables: Mapping[str, str] = field(default_factory=dict)
    quick: bool = False
    with_possible: bool = False

    def words(self) -> dict[str, object]:
        """The options of the command line that say the same."""
        pairs = [f"{ours}={theirs}" for ours, theirs in self.variables.items()]
        words: dict[str, object] = {"--motion": self.motion, "--columns": [*self.columns], "--units": [*self.units]}
        words |= {"--layout": [*self.layout], "--fmu": self.fmu, "--variables": pairs}
        return words | {"--quick": self.quick, "--with-possible": self.with_possible}


@dataclass(frozen=True)
class Order:
    """A machine that is to be diagnosed into a folder; `card` is a path, a shipped one's name, or "" for none."""

    machine: Machine
    card: str
    out: Path
    options: Options

    @property
    def files(self) -> tuple[Path, ...]:
        """All files that the diagnosis reads."""
        own = (Path(self.card),) if self.card and Path(self.card).is_file() else ()
        fmu = (self.options.fmu,) if self.options.fmu else ()
        return (*self.machine.train, *self.machine.heldout, *own, *fmu)

    def key(self) -> str:
        """What tells whether an answer that is there is the answer to this: files by content, options, version."""
        read = [[path.name, sha256(path)] for path in self.files]
        said = {name: str(value) for name, value in self.options.words().items()}
        card = "" if Path(self.card).is_file() else self.card
        text = json.dumps([read, len(self.machine.heldout), card, said, __version__], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True)
class PortableOrder:
    """An order with the content of its files, by their path where it was made."""

    order: Order
    files: Mapping[Path, bytes]

    @classmethod
    def of(cls, order: Order) -> "PortableOrder":
        """Pack the files of an order."""
        return cls(order, {path: path.read_bytes() for path in order.files})

    def unpacked(self, folder: Path) -> Order:
        """Write the files into a folder of this machine and return the order of them."""
        here = {}
        for number, (path, content) in enumerate(self.files.items()):
            here[path] = directory(folder / str(number)) / path.name  # two may have one name
            here[path].write_bytes(content)
        given, machine = self.order, self.order.machine
        card = str(here[Path(given.card)]) if Path(given.card) in here else given.card
        fmu = here[given.options.fmu] if given.options.fmu else None
        train, held = (tuple(here[path] for path in several) for several in (machine.train, machine.heldout))
        moved = replace(machine, train=train, heldout=held)
        return Order(moved, card, folder / "result", replace(given.options, fmu=fmu))


def diagnose_here(order: Order, command: str) -> None:
    """Diagnose into the folder of an order; what was there is written over.

    Raises:
        CosimError: one sentence.
    """
    from cosim.api.diagnose import diagnose
    from cosim.reading import read_recordings
    from cosim.support.memory import keep_freed_memory
    from pyfmi_models.card import read_card
    from pyfmi_models.errors import ModelError

    keep_freed_memory()
    train, held, options = order.machine.train, order.machine.heldout, order.options
    try:
        card = read_card(order.card) if order.card else None
        names, kind = (card.columns, card.mount.motion) if card else ({}, options.motion)
        read = read_recordings((*train, *held), names, options.columns, options.units, kind, options.layout)
        diagnose(
            *(read[: len(train)], read[len(train) :], card, order.out),
            motion=options.motion,
            fmu=options.fmu,
            variables=options.variables,
            quick=options.quick,
            with_possible=options.with_possible,
            force=True,
            command=command,
        )
    except ModelError as error:
        raise InputError(str(error)) from None


def diagnose_away(portable: PortableOrder, command: str) -> dict[str, bytes]:
    """Diagnose on another machine; return the files of the answer by name. Errors as of `diagnose_here`."""
    with tempfile.TemporaryDirectory(prefix="cosim-") as name:
        order = portable.unpacked(Path(name))
        try:
            diagnose_here(order, command)
        except InputError as error:
            texts = str(error)
            for there, here in zip(order.files, portable.files, strict=True):
                texts = texts.replace(str(there), str(here))
            raise InputError(texts) from None
        return {path.name: path.read_bytes() for path in order.out.iterdir() if path.is_file()}


def take(files: Mapping[str, bytes], out: Path) -> None:
    """Write the files of an answer that came from elsewhere; diagnosis.json last, so that it stands for all."""
    for name in sorted(files, key=lambda one: one == DOCUMENT):
        with replacing(directory(out) / Path(name).name, True) as partial:
            partial.write_bytes(files[name])
