"""`cosim run`: a scenario to a recording."""

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from cosim.cli.complete import scenarios
from cosim.cli.options import Force, Out, command_of, default_out
from cosim.support.files import in_bytes
from cosim.support.terminal import put, put_json, say, stage

if TYPE_CHECKING:
    from cosim.api.run import Delivery
    from cosim.master.result import RunResult
    from cosim.system.scenario import Scenario

Progress = Callable[[int, int], None]
SURE, LONG = 1.0, 30.0
"""Seconds after which the speed of a run is known well enough, and time to go that is worth a word."""


def run(
    scenario: Annotated[
        str,
        typer.Argument(
            help="A scenario (.toml), an SSP, or a shipped one: sidereal, two_axis.",
            autocompletion=scenarios,
        ),
    ],
    out: Out = None,
    sets: Annotated[
        list[str] | None, typer.Option("--set", help="Another number for this run: controller.kp=400 noise.seed=7 ...")
    ] = None,
    stop: Annotated[float | None, typer.Option("--stop", help="Time at which it ends instead [s].")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the statistics as JSON.")] = False,
    force: Force = False,
    interpreted: Annotated[
        bool, typer.Option("--interpreted", help="Use the loop in Python: slow, same bits.")
    ] = False,
    page: Annotated[bool, typer.Option(help="Write the page of pictures.")] = True,
    outside: Annotated[
        bool, typer.Option("--outside", help="Read files beside an SSP that it names outside of itself.")
    ] = False,
    isolate: Annotated[
        bool | None,
        typer.Option(help="Run in a process of its own, which may crash; so it is where FMUs or functions are given."),
    ] = None,
    call_timeout: Annotated[
        float, typer.Option("--call-timeout", help="Seconds that one call of an isolated component may take.", min=0.1)
    ] = 60.0,
) -> None:
    """Run a scenario and write DIR/recording.parquet, DIR/run.json (its statistics) and DIR/run.html (its pictures)."""
    from cosim.api.changes import changed, values_of
    from cosim.api.run import Delivery, files_of, is_foreign
    from cosim.master.simulate import Options
    from cosim.models.cache import with_fmus
    from cosim.support.files import check_free
    from cosim.system.scenario import read_scenario
    from cosim.system.variant import ssp_of

    wanted, values = read_scenario(scenario, outside), values_of(sets or [])
    out = out or default_out(wanted.name)
    files = files_of(out, page)
    for one in files.values():
        check_free(one, force)
    if ssp_of(scenario)[0] is not None and wanted.description:
        say(wanted.description)
    ready = changed(with_fmus(wanted, say), values, stop)
    command = command_of(
        "run",
        [scenario],
        {"--set": sets, "--stop": stop, "--out": out, "--interpreted": interpreted, "--outside": outside},
    )
    options = Options(None, force, None, not interpreted, command)
    apart = is_foreign(wanted) if isolate is None else isolate
    done = _run(ready, Delivery(out, options, apart, call_timeout, page))
    for line in str(done).removeprefix(f"{done.name}: ").splitlines():
        say(line)
    put_json(done.statistics) if as_json else put(str(files["recording"]))


def _run(scenario: "Scenario", delivery: "Delivery") -> "RunResult":
    """Run, and show how it goes."""
    from cosim.api.run import RECORDING
    from cosim.support.errors import SignalError, StepError

    title = f"{scenario.name}: {scenario.ticks:,} steps of {scenario.step:g} s"
    size = 8 * (scenario.ticks // scenario.decimation) * (len(scenario.records) + 1)
    recording = delivery.folder / RECORDING
    try:
        with stage(title) as shown:
            options = replace(delivery.options, on_progress=with_forecast(shown, size, say))
            return replace(delivery, options=options).of(scenario)
    except (StepError, SignalError, KeyboardInterrupt):
        if recording.exists():
            say(f"what was recorded until then is in {recording}")
        raise


def with_forecast(shown: Progress, size: int, say: Callable[[str], None]) -> Progress:
    """Return a progress that also says once how long a long run will take, and how large its recording gets."""
    first: list[tuple[float, int]] = []  # when steps began to be counted: loading is no sign of the speed
    told = [False]

    def progress(done: int, of: int) -> None:
        shown(done, of)
        now = perf_counter()
        if not first:
            first.append((now, done))
        begun, before = first[0]
        if told[0] or now - begun <= SURE or done <= before:
            return
        told[0] = True
        left = (now - begun) * (of - done) / (done - before)
        if left > LONG:
            say(f"about {in_time(left)} to go; the recording grows to {in_bytes(size)}")

    return progress


def in_time(seconds: float) -> str:
    """Write a time for people."""
    for limit, divisor, unit in ((120, 1, "s"), (7200, 60, "min"), (172_800, 3600, "h"), (6.3e7, 86_400, "days")):
        if seconds < limit:
            return f"{seconds / divisor:.0f} {unit}"
    return f"{seconds / 3.156e7:.3g} years"
