"""The progress bar: what is done, and how long it will take once that is known."""

from rich.progress import BarColumn, Progress, Task, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.text import Text

SURE = 1.0
"""Seconds after which the speed of a stage is known well enough to predict its end: it begins slowly."""


class Left(TimeRemainingColumn):
    """Time to go, where steps are counted and their speed is known; nothing where they are only told in words."""

    def render(self, task: Task) -> Text:
        """Return the time, or nothing."""
        if not task.fields.get("counted") or (task.elapsed or 0.0) < SURE:
            return Text("")
        return super().render(task)


def bar(**options: object) -> Progress:
    """Return a bar; `options` are those of rich."""
    shown = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), Left()
    return Progress(*shown, **options)  # type: ignore[arg-type]
