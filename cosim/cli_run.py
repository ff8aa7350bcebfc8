"""`cosim run`: a scenario to a recording."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from cosim.terminal import put, put_json, say, stage


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
) -> None:
    """Run a scenario and write DIR/recording.parquet and DIR/run.json (its statistics)."""
    from cosim.cli_cache import with_fmus
    from cosim.errors import StepError
    from cosim.files import check_free, replacing
    from cosim.master import run as run_scenario
    from cosim.scenario import read_scenario

    wanted = read_scenario(scenario)
    path, report = out / "recording.parquet", out / "run.json"
    for one in (path, report):
        check_free(one, force)
    if Path(scenario).suffix == ".ssp":
        say(wanted.description)
    ready = with_fmus(wanted, say)
    command = f"cosim run {scenario} --out {out}"
    title = f"{wanted.name}: {wanted.ticks:,} steps of {wanted.step:g} s"
    try:
        with stage(title) as progress:
            done = run_scenario(ready, path, force=force, progress=progress, compiled=not interpreted, command=command)
    except (StepError, KeyboardInterrupt):
        say(f"what was recorded until then is in {path}")
        raise
    statistics = done.statistics | {"scenario": wanted.name, "recording": str(path)}
    with replacing(report, force) as partial:
        partial.write_text(json.dumps(statistics, indent=2) + "\n", "utf-8")
    _tell(statistics)
    if as_json:
        put_json(statistics)
    else:
        put(str(path))


def _tell(statistics: dict[str, Any]) -> None:
    say(
        "{steps:,} steps in {seconds:.3g} s, {ratio_to_real_time:.3g} times real time, "
        "{microseconds_per_step:.3g} us a step with recording ({rows:,} rows, {loop} loop)".format(**statistics)
    )
    if statistics["unconnected"]:
        say(f"not connected, at their start values: {', '.join(map(str, statistics['unconnected']))}")
    for note in statistics["notes"]:
        say(note)
    if statistics["warnings"]:
        say(f"{statistics['warnings']:,} steps ended with a warning of their FMU")
