"""`cosim show`: any file of this project on one screen."""

import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from cosim.cli.complete import anything
from cosim.support.plain import Json
from cosim.support.terminal import put_json

LONG = 500
"""Rows of a table that is drawn at most; a longer one is written plainly."""

NARROW = 10
"""Characters that a column of sentences needs to be read."""


def show(
    file: Annotated[
        str,
        typer.Argument(
            help="A recording, FMU, SSP, scenario, card, folder of results, name of a shipped one, or an effect.",
            autocompletion=anything,
        ),
    ],
    columns: Annotated[list[str] | None, typer.Option("--columns", help="Recording: our name = the file's.")] = None,
    units: Annotated[list[str] | None, typer.Option("--units", help="Recording: units in the file.")] = None,
    layout: Annotated[list[str] | None, typer.Option("--layout", help="Recording: how the text is written.")] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Recording: a picture of it, .svg or .png.")] = None,
    schedule: Annotated[bool, typer.Option("--schedule", help="Scenario: what happens in a step.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print it as JSON.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the picture.")] = False,
) -> None:
    """Show a recording and the options to use it with, an FMU, a scenario, a card, or an effect with its repair."""
    from cosim.api.show import WIRES
    from cosim.api.show import show as shown_of

    options = _options(Path(file), {"columns": columns, "units": units, "layout": layout})
    shown = shown_of(file, **options, picture=out, schedule=schedule, force=force)
    if as_json:
        put_json({**shown.facts, **shown.tables})
        return
    console = Console(highlight=False, soft_wrap=not Console().is_terminal, emoji=False)
    for name, value in shown.facts.items():
        console.print(f"{name}: {value}", markup=False)
    for name, table in shown.tables.items():
        if name == WIRES:
            console.print("\n".join(["", *shown.drawing, ""]), markup=False, soft_wrap=True)
        elif len(table) > LONG:
            sys.stdout.write(_plain(name, table) + "\n")
        else:
            console.print(_table(name, table, console.width))


def _options(path: Path, given: Mapping[str, list[str] | None]) -> dict[str, dict[str, str]]:
    """Return what the options say of the file; what reads recordings is loaded only where they say something."""
    if not any(given.values()):
        return {}
    from cosim.reading import options_of

    return options_of(path, **given)


def _plain(title: str, rows: Sequence[Mapping[str, Json]]) -> str:
    """Write a long table as text: the library that draws short ones takes .7 ms a row."""
    columns = [[name, *(str(row[name]) for row in rows)] for name in rows[0]]
    form = "  ".join(f"{{:<{max(map(len, column))}}}" for column in columns)
    return "\n".join([title, *(form.format(*cells).rstrip() for cells in zip(*columns, strict=True))])


def _table(title: str, rows: Iterable[Mapping[str, Json]], width: int) -> Table:
    table = Table(title=Text(title), title_justify="left", box=None, pad_edge=False)
    listed = list(rows)
    columns = {name: [str(row[name]) for row in listed] for name in listed[0]} if listed else {}
    whole = _names(columns, width)
    for name in columns:
        table.add_column(Text(name), overflow="fold", no_wrap=name == "over time" or name in whole)
    for cells in zip(*columns.values(), strict=True):
        table.add_row(*map(Text, cells))  # [rad] is a unit there, and no markup
    return table


def _names(columns: Mapping[str, Sequence[str]], width: int) -> set[str]:
    """Columns of single words, which are not broken where there is room for them and NARROW for each other column."""
    single = {
        name: max(map(len, (name, *cells))) for name, cells in columns.items() if not any(" " in cell for cell in cells)
    }
    others = NARROW * (len(columns) - len(single))
    return set(single) if sum(single.values()) + others + 2 * len(columns) <= width else set()
