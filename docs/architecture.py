"""Draw the architecture from the imports of the code: python docs/architecture.py rewrites its page."""

import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1] / "tests" / folder) for folder in ("tools", "house")]

from test_arrows import FILES, FLOORS, folder_of, ours  # noqa: E402

PAGE = Path(__file__).with_suffix(".md")
MARK = re.compile(r"(<!-- drawn: (\S+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)
INSIDE = ("cosim.system", "cosim.master")
"""Folders that are drawn file by file."""
Arrows = Mapping[str, set[str]]


def drawn(page: str) -> str:
    """Return the page with every picture drawn anew."""
    pictures = {"folders": folders()} | {folder: inside(folder) for folder in INSIDE}
    return MARK.sub(lambda found: f"{found[1]}{pictures[found[2]]}{found[4]}", page)


def folders() -> str:
    """Draw the folders on their floors."""
    arrows = between(lambda name: "physics" if name.startswith("pyfmi_models") else folder_of(name))
    floors = [sorted(floor) for floor in reversed(FLOORS)]
    groups = [f'  subgraph floor{k}[" "]\n    {"; ".join(map(_node, floor))}\n  end' for k, floor in enumerate(floors)]
    return _mermaid([*groups, f"  {_node('physics')}", *_lines(direct(arrows))])


def inside(folder: str) -> str:
    """Draw the files of a folder; a folder in it is one box."""
    mine = {name for name in FILES if folder_of(name) == folder and name != folder}
    arrows = between(lambda name: ".".join(name.split(".")[:3]) if name in mine else "")
    return _mermaid([*(f"  {_node(one)}" for one in sorted(arrows)), *_lines(direct(arrows))])


def between(room: Callable[[str], str]) -> dict[str, set[str]]:
    """Return who imports whom between rooms; "" is no room."""
    found: dict[str, set[str]] = {}
    for name in FILES:
        if here := room(name):
            found.setdefault(here, set()).update({room(other) for other in ours(name)} - {here, ""})
    return found


def direct(arrows: Arrows) -> dict[str, set[str]]:
    """Leave out arrows that a longer way says already (transitive reduction)."""

    def reached(start: str) -> set[str]:
        return arrows[start] | {far for near in arrows[start] for far in reached(near)}

    return {one: others - {far for near in others for far in reached(near)} for one, others in arrows.items()}


def _lines(arrows: Arrows) -> list[str]:
    return [f"  {_id(one)} --> {_id(other)}" for one in sorted(arrows) for other in sorted(arrows[one])]


def _node(name: str) -> str:
    label = {"physics": "pyfmi_models", "cosim": "import cosim"}.get(name, name.rpartition(".")[2])
    return f'{_id(name)}["{label}"]'


def _id(name: str) -> str:
    return name.replace(".", "_").replace("__main__", "start")


def _mermaid(lines: list[str]) -> str:
    return "\n".join(["", "```mermaid", "flowchart TD", *lines, "```", ""])


if __name__ == "__main__":
    PAGE.write_text(drawn(PAGE.read_text("utf-8")), "utf-8")
