"""`cosim identify`: recordings and a card, an FMU or a system to the same with identified numbers."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from inspect import signature
from pathlib import Path
from typing import Annotated, Any

import typer

from cosim.cli.complete import cards
from cosim.cli.options import Cluster, Columns, Force, Layout, Out, Units, default_out
from cosim.support.errors import InputError
from cosim.support.terminal import put, put_json, say, stage

Set = Annotated[list[str] | None, typer.Option("--set", help="Other values, or starts: Motor.J=0.02 ... (FMU, system)")]
Derivatives = Annotated[
    str, typer.Option("--derivatives", help="differences, or directional: the FMU's own where they agree (FMU).")
]
Bounds = Annotated[
    list[str] | None, typer.Option("--bounds", help="Least and greatest value: Motor.J=0.01..1 ... (FMU, system)")
]
Timeout = Annotated[float, typer.Option("--timeout", help="Seconds that the first simulation may take (FMU, system).")]
OF_CARDS = {"cut", "keep_inertia", "layout"}
"""Options that go with a card alone ..."""
HOW = ("step", "interpolation", "window", "initial", "loss", "workers", "cluster", "derivatives", "timeout")
OF_MODELS = {"heldout", "set_", "bounds", *HOW}
"""... and with an FMU or a system alone."""
PLAIN = ("fmu", "system", "starts", "seed", *HOW)
"""Options that are handed on as they are."""


def identify(
    recordings: Annotated[list[Path], typer.Argument(help="Recordings.", metavar="RECORDING...")],
    card: Annotated[
        str | None, typer.Option("--card", help="Model card (.toml), or a shipped one.", autocompletion=cards)
    ] = None,
    fmu: Annotated[Path | None, typer.Option("--fmu", help="An FMU of anybody, in place of a card.")] = None,
    system: Annotated[str | None, typer.Option("--system", help="A scenario or SSP, in place of a card.")] = None,
    out: Out = None,
    free: Annotated[
        list[str] | None, typer.Option("--free", help="Parameters to identify: sigma0 Fc ... [of a card: all]")
    ] = None,
    heldout: Annotated[
        list[Path] | None, typer.Option("--heldout", help="Recording that is not fitted (FMU, system).")
    ] = None,
    set_: Set = None,
    bounds: Bounds = None,
    step: Annotated[float | None, typer.Option("--step", help="Of the simulation [s]; else the rows' (FMU).")] = None,
    interpolation: Annotated[
        str, typer.Option("--interpolation", help="Of inputs between rows: hold or linear (FMU, system).")
    ] = "hold",
    window: Annotated[
        float | None, typer.Option("--window", help="Start anew from the recording every so many s (FMU, system).")
    ] = None,
    initial: Annotated[
        str, typer.Option("--initial", help="Start values: recorded, or free: found per window (FMU, system).")
    ] = "recorded",
    loss: Annotated[str, typer.Option("--loss", help="linear, or soft_l1 for outliers (FMU, system).")] = "linear",
    workers: Annotated[int | None, typer.Option("--workers", min=1, help="Processes (FMU, system). [cores]")] = None,
    cluster: Cluster = "",
    derivatives: Derivatives = "differences",
    timeout: Timeout = 60.0,
    cut: Annotated[
        float | None, typer.Option("--cut", min=0.0, help="Slowest speed of the friction map [rad/s or m/s] (card).")
    ] = None,
    keep_inertia: Annotated[
        bool, typer.Option("--keep-inertia/--drop-inertia", help="Friction map: tau - J q'', or tau alone (card).")
    ] = True,
    starts: Annotated[int, typer.Option("--starts", min=1, help="Starts of the output-error fit.")] = 4,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random starts.")] = 0,
    columns: Columns = None,
    units: Units = None,
    layout: Layout = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the JSON file instead of the summary.")] = False,
    force: Force = False,
) -> None:
    """Identify numbers of a card, of a foreign FMU (--fmu) or of a whole system (--system), with standard errors."""
    given: dict[str, Any] = dict(locals())
    from cosim.api.identify import check_one

    check_one(card, fmu, system)
    _check_given(card is not None, given)
    given["out"] = out or default_out(Path(recordings[0]).stem)
    (_model if card is None else _card)(given)


def _check_given(of_card: bool, given: Mapping[str, Any]) -> None:
    """Refuse an option other than its default that goes with another kind of model (InputError)."""
    known = signature(identify).parameters
    for name in sorted(OF_MODELS if of_card else OF_CARDS):
        if given[name] != known[name].default:
            option = f"--{name.strip('_').replace('_', '-')}"
            other = "an FMU or a system" if of_card else "a card"
            raise InputError(f"{option} goes with {other} alone; leave it out.", culprit=option)


def _card(given: Mapping[str, Any]) -> None:
    from cosim.api.identify import identify as find
    from cosim.estimation.identify.deliver import check_out
    from cosim.reading import read_recordings
    from pyfmi_models.card import read_card

    out, force = given["out"], given["force"]
    check_out(out, force)
    believed = read_card(given["card"])
    written = (given["columns"], given["units"], believed.mount.motion, given["layout"])
    read = read_recordings(given["recordings"], believed.columns, *written)
    seconds, several = sum(one.duration for one in read), "s" * (len(read) > 1)
    say(f"Read {len(read)} recording{several}, {seconds:.0f} s; card {believed.mount.name}")
    how = {name: given[name] for name in ("cut", "keep_inertia", "starts", "seed")}
    with stage("identifying") as progress:
        done = find(read, believed, out, free=given["free"] or (), force=force, on_progress=progress.log, **how)
    if given["as_json"]:
        put_json(done.as_json())
    else:
        put(str(done))
        say(f"Wrote {out / 'card.toml'}, identify.json and the figures")


def _model(given: Mapping[str, Any]) -> None:
    from cosim.api.identify import identify as find
    from cosim.reading import pairs_of

    out = given["out"]
    pairs = {name: pairs_of(f"--{name.strip('_')}", given[name]) for name in ("set_", "bounds", "columns", "units")}
    values = {name: _number("--set", name, text) for name, text in pairs["set_"].items()}
    limits = {name: _range(name, text) for name, text in pairs["bounds"].items()}
    with stage("identifying") as progress, _going_on(out):
        done = find(
            given["recordings"],
            out=out,
            free=given["free"] or (),
            heldout=given["heldout"] or None,
            set=values,
            bounds=limits,
            columns=pairs["columns"],
            units=pairs["units"],
            force=given["force"],
            on_progress=progress.log,
            **{name: given[name] for name in PLAIN},
        )
    put_json(done.as_json()) if given["as_json"] else put(str(done))
    say(f"Wrote {', '.join(str(path) for path in done.files.values())}")


@contextmanager
def _going_on(out: Path) -> Iterator[None]:
    """Say where an interrupted calibration goes on."""
    try:
        yield
    except KeyboardInterrupt:
        say(f"what was simulated is in {out / 'progress'}; the same command with --out {out} goes on from there")
        raise


def _number(option: str, name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{option} {name}={text}: it must be a number.", culprit=name, value=text) from None


def _range(name: str, text: str) -> tuple[float, float]:
    low, dots, high = text.partition("..")
    if not dots:
        raise InputError(f"--bounds {name}={text}: write it as least..greatest, for example 0.01..1.", culprit=name)
    return _number("--bounds", name, low), _number("--bounds", name, high)
