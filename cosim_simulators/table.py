"""The table of what simulators cannot hold, as text."""

from collections.abc import Sequence

from cosim_simulators.measure import Held, Row


def table_text(held: Sequence[Held]) -> str:
    """Write what each simulator holds of a card and what it loses, RMS along the motion."""
    return "\n\n".join([_one(one) for one in held]) + "\n"


def _one(held: Held) -> str:
    cells = [("part", "in the file as", f"lost [{held.unit}]", ""), *(_cells(row) for row in held.rows)]
    cells.append(("all together", "", f"{held.lost:.3g}", f"of {held.needed:.3g} {held.unit} that the motion needs"))
    widths = [max(len(row[k]) for row in cells) for k in range(3)]
    lines = [f"{a:<{widths[0]}}  {b:<{widths[1]}}  {c:>{widths[2]}}  {d}".rstrip() for a, b, c, d in cells]
    return "\n".join([f"{held.format.title}, RMS along {held.motion}", *lines, *_errors(held)])


def _cells(row: Row) -> tuple[str, str, str, str]:
    lost = "?" if row.lost is None else "0" if row.lost == 0 else f"{row.lost:.3g}"
    return row.part, row.where or "not held", lost, row.note


def _errors(held: Held) -> list[str]:
    if held.card_error is None or held.held_error is None or held.ratio is None:
        return []
    card, file = f"{held.card_error:.3g}", f"{held.held_error:.3g} {held.unit}"
    return [f"RMS error on the recording: FMU {card}, this file {file} ({held.ratio - 1:+.1%})"]
