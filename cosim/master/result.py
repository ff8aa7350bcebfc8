"""What came out of a run: its recording and how it went."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NotRequired, TypedDict

from cosim.support.html import facts

if TYPE_CHECKING:  # what reads recordings is half of what a run would load
    from cosim.data.recording import Recording


class Statistics(TypedDict):
    """How a run went, as run.json says it; times in s. `coupling` has a row for each coupled group,
    `outside` a sentence for each range in which a component is proven and that was left.
    """

    steps: int
    step: float
    simulated_seconds: float
    seconds: float
    ratio_to_real_time: float
    microseconds_per_step: float
    rows: int
    ended: str
    loop: str
    algorithm: str
    coupling: Sequence[Mapping[str, int]]
    warnings: int
    unconnected: Sequence[str]
    notes: Sequence[str]
    scenario: NotRequired[str]
    recording: NotRequired[str]
    page: NotRequired[str]
    outside: NotRequired[Sequence[str]]
    tracking: NotRequired[Sequence[Mapping[str, float | str]]]


@dataclass(frozen=True, repr=False)
class RunResult:
    """What a run gave: its name, statistics as in run.json, and the files that were written, by kind."""

    name: str
    statistics: Statistics
    files: Mapping[str, Path] = field(default_factory=dict)
    _recording: "Recording | None" = field(default=None, repr=False)

    @cached_property
    def recording(self) -> "Recording":
        """The recording: columns of shape (rows,) in SI; read from its file when it is first asked for."""
        from cosim.data.recording import Recording

        return self._recording or Recording.read(self.files["recording"], required=())

    def frame(self) -> object:
        """Return the recording as a pandas `DataFrame`, a row a sample."""
        return self.recording.frame()

    def plot(self, *columns: str) -> object:
        """Return a matplotlib figure of the recording over time (all columns where none is named)."""
        return self.recording.plot(*columns)

    def __repr__(self) -> str:
        return f"RunResult({self.name!r}, {self.statistics['steps']:,} steps, {self.statistics['rows']:,} rows)"

    def __str__(self) -> str:
        first, *more = [*_tracked(self.statistics), _speed(self.statistics)]
        return "\n".join([f"{self.name}: {first}", *more, *remarks(self.statistics)])

    def _repr_html_(self) -> str:
        said, files = remarks(self.statistics), {kind: str(path) for kind, path in self.files.items()}
        notes = {"note": " ".join(said)} if said else {}
        tracked = _tracked(self.statistics)
        answer = {"tracking": "; ".join(tracked)} if tracked else {}
        return facts(self.name, answer | {"speed": _speed(self.statistics)} | notes | files)


def remarks(statistics: Statistics) -> list[str]:
    """Say in sentences what a run's statistics tell beside its speed."""
    said = []
    for effort in statistics["coupling"]:
        a_step = effort["rounds"] / max(statistics["steps"], 1)
        said.append(f"coupled components took {a_step:.3g} passes a step, {effort['greatest']} at most")
    if "page" in statistics:
        said.append(f"pictures: {statistics['page']}")
    if statistics["unconnected"]:
        said.append(f"not connected, at their start values: {', '.join(statistics['unconnected'])}")
    said += [*statistics.get("outside", ()), *statistics["notes"]]
    if statistics["warnings"]:
        said.append(f"{statistics['warnings']:,} steps ended with a warning of their FMU")
    return said


def _tracked(statistics: Statistics) -> list[str]:
    return [str(one["statement"]) for one in statistics.get("tracking", ())]


def _speed(statistics: Statistics) -> str:
    return (
        "{steps:,} steps in {seconds:.3g} s, {ratio_to_real_time:.3g} times real time, "
        "{microseconds_per_step:.3g} us a step with recording ({rows:,} rows, {loop} loop)".format(**statistics)
    )
