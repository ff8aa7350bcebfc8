"""`cosim run`: a scenario to a recording."""

import json
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer

from cosim.files import in_bytes
from cosim.terminal import put, put_json, say, stage

Progress = Callable[[int, int], None]
SURE, LONG = 1.0, 30.0
"""Seconds after which the speed of a run is known well enough, and time to go that is worth a word."""


def run(
    scenario: Annotated[
        str, typer.Argument(help="A scenario (.toml), an SSP, or the name of a shipped one: sidereal.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="Directory for the recording.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the statistics as JSON.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite what is there.")] = False,
    interpreted: Annotated[
        bool, typer.Option("--interpreted", help="Use the loop in Python: slow, same bits.")
    ] = False,
    page: Annotated[bool, typer.Option(help="Write the page of pictures.")] = True,
) -> None:
    """Run a scenario and write DIR/recording.parquet, DIR/run.json (its statistics) and DIR/run.html (its pictures)."""
    from cosim.cli_cache import with_fmus
    from cosim.errors import StepError
    from cosim.files import check_free, replacing
    from cosim.master import run as run_scenario
    from cosim.scenario import read_scenario

    wanted = read_scenario(scenario)
    path, report, pictures = out / "recording.parquet", out / "run.json", out / "run.html"
    for one in (path, report, *([pictures] if page else [])):
        check_free(one, force)
    if Path(scenario).suffix == ".ssp":
        say(wanted.description)
    ready = with_fmus(wanted, say)
    command = f"cosim run {scenario} --out {out}"
    title = f"{wanted.name}: {wanted.ticks:,} steps of {wanted.step:g} s"
    size = 8 * (wanted.ticks // wanted.decimation) * (len(wanted.records) + 1)
    try:
        with stage(title) as shown:
            progress = foretold(shown, size, say)
            done = run_scenario(ready, path, force=force, progress=progress, compiled=not interpreted, command=command)
    except (StepError, KeyboardInterrupt):
        if path.exists():
            say(f"what was recorded until then is in {path}")
        raise
    statistics = done.statistics | {"scenario": wanted.name, "recording": str(path)}
    if page:
        statistics["page"] = str(_page(pictures, path, wanted, done.statistics, force))
    with replacing(report, force) as partial:
        partial.write_text(json.dumps(statistics, indent=2) + "\n", "utf-8")
    _tell(statistics)
    if as_json:
        put_json(statistics)
    else:
        put(str(path))


def _page(pictures: Path, recording: Path, scenario: Any, statistics: dict[str, Any], force: bool) -> Path:
    from cosim.pictures.run_page import write_page

    return write_page(pictures, recording, scenario, statistics, force)


def foretold(shown: Progress, size: int, say: Callable[[str], None]) -> Progress:
    """Return a progress that also says once how long a long run will take, and how large its recording gets."""
    begun, told = perf_counter(), [False]

    def progress(done: int, of: int) -> None:
        shown(done, of)
        spent = perf_counter() - begun
        if not told[0] and spent > SURE:
            told[0] = True
            left = spent * (of - done) / done
            if left > LONG:
                say(f"about {in_time(left)} to go; the recording grows to {in_bytes(size)}")

    return progress


def in_time(seconds: float) -> str:
    """Write a time for people."""
    for limit, divisor, unit in ((120, 1, "s"), (7200, 60, "min"), (172_800, 3600, "h"), (6.3e7, 86_400, "days")):
        if seconds < limit:
            return f"{seconds / divisor:.0f} {unit}"
    return f"{seconds / 3.156e7:.3g} years"


def _tell(statistics: dict[str, Any]) -> None:
    say(
        "{steps:,} steps in {seconds:.3g} s, {ratio_to_real_time:.3g} times real time, "
        "{microseconds_per_step:.3g} us a step with recording ({rows:,} rows, {loop} loop)".format(**statistics)
    )
    for effort in statistics["coupling"]:
        a_step = effort["rounds"] / max(statistics["steps"], 1)
        say(f"coupled components took {a_step:.3g} passes a step, {effort['greatest']} at most")
    if "page" in statistics:
        say(f"pictures: {statistics['page']}")
    if statistics["unconnected"]:
        say(f"not connected, at their start values: {', '.join(map(str, statistics['unconnected']))}")
    for note in statistics["notes"]:
        say(note)
    if statistics["warnings"]:
        say(f"{statistics['warnings']:,} steps ended with a warning of their FMU")
