"""Formulas as files of effects, for a person to review: the form of docs/adding_physics.md, loaded by nobody."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cosim.diagnosis.terms.closed_form import GROUP, ClosedForm
from cosim.support.errors import OutputError
from cosim.support.files import check_free, directory, replacing
from cosim.support.plugins import names
from pyfmi_models import effects

PREFIX = "proposed_"
"""Of the files' names: a folder that holds one holds a proposal already."""


@dataclass(frozen=True)
class Proposal:
    """One formula as the file of an effect."""

    formula: ClosedForm
    statement: str
    """What the diagnosis says of the learned term, with its errors."""

    @property
    def id(self) -> str:
        """Id of the effect, and name of its file."""
        return self.formula.id

    def text(self) -> str:
        """Return the file."""
        return self.formula.text(self.statement)


def check_folder(folder: Path, force: bool) -> None:
    """Refuse a folder that holds a proposal, and the one that effects are loaded from (raises OutputError)."""
    if folder.resolve() == Path(effects.__file__).parent.resolve():
        text = f"{folder} is where effects are loaded from; propose into another folder and review the file there."
        raise OutputError(text, culprit=str(folder))
    for one in sorted(folder.glob(f"{PREFIX}*.py")):
        check_free(one, force)


def check_searched() -> None:
    """Refuse to propose where no installed package searches for formulas (raises OutputError)."""
    if not names(GROUP):
        text = f"--propose: no installed package searches for formulas (entry points of the group {GROUP})"
        raise OutputError(f"{text}; install mount-cosim again, or leave the option out.", culprit="--propose")


def write_proposals(proposals: Sequence[Proposal], folder: Path, force: bool = False) -> tuple[Path, ...]:
    """Write each proposal as a file of its own; nothing, not even the folder, where there is none.

    Raises:
        OutputError: the folder holds a proposal and `force` is not set, or is the one that effects are loaded from.
    """
    check_folder(folder, force)
    paths = tuple(folder / f"{one.id}.py" for one in proposals)
    for one, path in zip(proposals, paths, strict=True):
        directory(folder)
        with replacing(path, force=True) as partial:
            partial.write_text(one.text(), "utf-8")
    return paths
