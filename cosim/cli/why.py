"""`cosim why`: why a diagnosis took, refused or left open each effect."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from cosim.support.terminal import put_json

if TYPE_CHECKING:
    from cosim.api.why import Written
    from cosim.diagnosis.answer.ledger import Trial

MOST = 15
"""Structures in the table, unless all are wanted."""


def why(
    folder: Annotated[Path, typer.Argument(help="Folder of a diagnosis, or its diagnosis.json.", metavar="DIR")],
    effect: Annotated[str, typer.Argument(help="Id of one effect, or `unknown`: its rules in full.")] = "",
    everything: Annotated[bool, typer.Option("--all", help="All structures in the table.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the ledger as JSON.")] = False,
) -> None:
    """Rank every structure that a diagnosis fitted, and say by which rule each effect was taken or refused."""
    from cosim.api.why import read_ledger
    from cosim.diagnosis.answer.names import is_of

    written = read_ledger(folder)
    if effect:
        written.check(effect)
    if as_json:
        put_json([one.as_json() for one in written.trials if not effect or is_of(one.effect, effect)])
        return
    console = Console(highlight=False, soft_wrap=not Console().is_terminal, emoji=False)
    if effect:
        _print_effect(console, written, effect)
    else:
        _print_all(console, written, everything)


def _print_all(console: Console, written: "Written", everything: bool) -> None:
    from cosim.diagnosis.answer.why import ranked, reasons

    rows = ranked(written.trials)
    shown = rows if everything else rows[:MOST]
    title = "Structures by evidence in training (nats above the refitted base; +- standard error over blocks of time)"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for name in ("", "structure", "nats", "behind", "weight", "held out", "refused by"):
        table.add_column(name, justify="left" if name in ("structure", "refused by") else "right", overflow="fold")
    for number, row in enumerate(shown, 1):
        behind, held = _with_error(row.behind, row.error), _with_error(row.heldout, row.heldout_error)
        table.add_row(str(number), row.structure, f"{row.nats:.1f}", behind, f"{row.weight:.2f}", held, row.refused)
    console.print(table)
    if len(rows) > len(shown):
        console.print(f"... and {len(rows) - len(shown)} more: --all", markup=False)
    console.print()
    for name, text in reasons(written.document, written.trials):
        console.print(f"{name}: {text}", markup=False)


def _print_effect(console: Console, written: "Written", effect: str) -> None:
    from cosim.diagnosis.answer.names import is_of
    from cosim.diagnosis.answer.why import of_effect, reasons

    for name, text in reasons(written.document, written.trials):
        if is_of(name, effect):
            console.print(f"{name}: {text}", markup=False)
    for trial in of_effect(written.trials, effect):
        console.print(_rules(trial))


def _rules(trial: "Trial") -> Table:
    from cosim.diagnosis.answer.why import label

    held = f", held out {_with_error(trial.heldout.nats, trial.heldout.error)}" if trial.heldout else ""
    head = f"{label(trial.effects)}: {_with_error(trial.train.nats, trial.train.error)} nats{held}"
    table = Table(title=f"\n{head}", title_justify="left", box=None, pad_edge=False)
    for name in ("rule", "value", "limit", "outcome", "note"):
        table.add_column(name, justify="right" if name in ("value", "limit") else "left", overflow="fold")
    for rule in trial.rules:
        value, limit = ("" if one is None else f"{one:.4g}" for one in (rule.value, rule.limit))
        table.add_row(rule.name, value, limit, "yes" if rule.outcome else "no", rule.note)
    return table


def _with_error(value: float | None, error: float | None) -> str:
    if value is None:
        return ""
    return f"{value:.1f}" if error is None else f"{value:.1f} +- {error:.1f}"
