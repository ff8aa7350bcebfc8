"""`cosim.identify`: recordings and a card, an FMU or a system to the same with identified numbers."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypedDict, Unpack, overload

from cosim.api.recordings import Source, read_all
from cosim.estimation.identify import deliver
from cosim.estimation.identify.figures import map_figure
from cosim.estimation.identify.identify import Identified, Options
from cosim.estimation.identify.identify import identify as find
from cosim.reading import check_kind
from cosim.support.errors import InputError
from cosim.support.html import text as html_text
from cosim.support.plain import JsonObject
from cosim.support.plugins import IDENTIFIERS, loaded
from cosim.system.scenario import Scenario
from pyfmi_models.card import Card, read_card

if TYPE_CHECKING:
    import pandas as pd

    from cosim_calibration.front import CalibrateResult


@dataclass(frozen=True, repr=False)
class IdentifyResult:
    """What was identified: every estimate with its standard errors, and the card with the new numbers."""

    identified: Identified
    given: Card

    @property
    def card(self) -> Card:
        """The card with the identified numbers in place of the given ones."""
        return self.identified.card

    @property
    def numbers(self) -> dict[str, float]:
        """Parameters of the plant by full name, SI ("friction.Fc" [N.m], "axis.inertia" [kg.m2])."""
        return {variable.name: float(variable.start) for variable in self.card.plant().parameters()}

    def as_json(self) -> JsonObject:
        """Return everything as plain data, as identify.json holds it."""
        return deliver.as_json(self.identified, self.given)

    def frame(self) -> "pd.DataFrame":
        """Return the numbers as a table, a row a parameter: `parameter`, `given`, `value`, `unit`."""
        import pandas as pd

        before = {one.name: float(one.start) for one in self.given.plant().parameters()}
        known = self.card.plant().parameters()
        rows = [(one.name, before.get(one.name), float(one.start), one.unit) for one in known]
        return pd.DataFrame(rows, columns=["parameter", "given", "value", "unit"])

    def plot(self) -> Any:
        """Return a matplotlib figure: friction over speed, samples and fits with their bands."""
        return map_figure(self.identified, self.given)

    def __repr__(self) -> str:
        return f"IdentifyResult({self.card.mount.name!r}, {len(self.numbers)} numbers)"

    def __str__(self) -> str:
        return deliver.summary(self.identified, self.given)

    def _repr_html_(self) -> str:
        return html_text(str(self))


class ForModels(TypedDict, total=False):
    """What is said of an FMU or a system, in place of a card."""

    fmu: str | Path | None
    """An FMU of anybody."""
    system: str | Path | Scenario | None
    """A scenario or SSP; its numbers are called "component.parameter"."""
    heldout: Source | Sequence[Source] | None
    """Recordings that are not fitted and show the error before and after."""
    set: Mapping[str, float] | None
    """Values of other parameters, or starts of free ones."""
    bounds: Mapping[str, tuple[float, float]] | None
    """(least, greatest) by name, in place of the variable's min and max."""
    step: float | None
    """Of the simulation [s]; None is that of the rows (FMU), or the system's own."""
    interpolation: str
    """Of inputs between rows: "hold" or "linear"."""
    window: float | None
    """Seconds after which a simulation starts anew from the recording; None: never."""
    initial: str
    """"recorded" starts windows from readings; "free" finds the start values of each window or recording too."""
    loss: Literal["linear", "soft_l1"]
    """"linear", or "soft_l1" for recordings with outliers."""
    workers: int | None
    """Processes that simulate; None is one a core."""
    timeout: float
    """Seconds that the first simulation may take."""
    derivatives: str
    """"differences", or "directional" for those that the FMU gives, where they agree with differences."""
    cluster: str
    """Address of a Dask scheduler whose workers simulate, in place of processes of this machine."""


@overload
def identify(
    recordings: Source | Sequence[Source],
    card: str | Path | Card,
    out: str | Path | None = None,
    *,
    free: Sequence[str] = (),
    cut: float | None = None,
    keep_inertia: bool = True,
    starts: int = 4,
    seed: int = 0,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    force: bool = False,
    on_progress: Callable[[str], None] = ...,
) -> IdentifyResult: ...


@overload
def identify(
    recordings: Source | Sequence[Source],
    card: None = None,
    out: str | Path | None = None,
    *,
    free: Sequence[str],
    starts: int = 4,
    seed: int = 0,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    force: bool = False,
    on_progress: Callable[[str], None] = ...,
    **model: Unpack[ForModels],
) -> "CalibrateResult": ...


def identify(
    recordings: Source | Sequence[Source],
    card: str | Path | Card | None = None,
    out: str | Path | None = None,
    *,
    free: Sequence[str] = (),
    cut: float | None = None,
    keep_inertia: bool = True,
    starts: int = 4,
    seed: int = 0,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    force: bool = False,
    on_progress: Callable[[str], None] = lambda text: None,
    **model: Unpack[ForModels],
) -> "IdentifyResult | CalibrateResult":
    """Identify numbers of a card, of a foreign FMU (`fmu`) or of a whole system (`system`) from recordings.

    A card: friction map, presliding steps, output error in closed loop. An FMU or system: output error in open loop,
    min sum (y - y_measured)^2; columns feed inputs and are compared with outputs of their names (docs/calibration.md).

    Args:
        recordings: one or several, each a path, data frame, mapping of arrays or `Recording` (see `cosim.read`).
        card: the model as believed: its path, the name of a shipped one, or a `Card`.
        out: folder for the files; None writes nothing.
        free: parameters to identify; of a card () for all of inertia and friction.
        cut: slowest speed of a card's friction map [rad/s; m/s]; None chooses it.
        keep_inertia: a card's friction map is of tau - J q'' (True) or of tau alone.
        starts: starts of the output-error fit, of which the best is kept.
        seed: of the random starts.
        columns: our name to the source's, as in `cosim.read`; of an FMU its variable to the source's column.
        units: our name to the unit in the source, as in `cosim.read`.
        force: overwrite what is there.
        on_progress: told in a few words what is being done.
        model: `fmu` or `system` in place of a card, and what goes with them; see `ForModels`.

    Returns:
        `IdentifyResult` of a card, `CalibrateResult` else. Standard errors: Ljung 1999, chapter 9.

    Raises:
        InputError: the recordings tell nothing, a name is unknown, or the model cannot be simulated.
        RecordingError, UnitError: as `cosim.read`.
        CardError, FmuError, ScenarioError: the model is not good.
        OutputError: a file is there already; nothing was fitted then.
    """
    check_one(card, model.get("fmu"), model.get("system"))
    if strange := set(model) - set(ForModels.__annotations__):
        raise TypeError(f"identify() got an unexpected keyword argument '{min(strange)}'")
    folder = None if out is None else Path(out)
    if card is not None:
        if more := sorted(name for name, value in model.items() if value is not None):
            raise InputError(f"{', '.join(more)}: of an FMU or a system, not of a card; leave it out.", culprit=more[0])
        given = Options(tuple(free), cut, keep_inertia, starts, seed)
        return _of_card(recordings, card, folder, given, columns, units, force, on_progress)
    find_of_model: Callable[..., CalibrateResult] = loaded(IDENTIFIERS, "model")
    how = {"free": tuple(free), "columns": columns or {}, "starts": starts, "seed": seed}
    return find_of_model(recordings, model, how, folder, units=units, force=force, on_progress=on_progress)


def check_one(*models: object) -> None:
    """Refuse a call with no model, or with more than one (InputError)."""
    given = sum(one is not None for one in models)
    if given != 1:
        what = "none of them is given" if not given else f"{given} are given"
        raise InputError(f"One of --card, --fmu and --system says what is identified; {what}.", culprit="card")


def _of_card(
    recordings: Source | Sequence[Source],
    card: str | Path | Card,
    folder: Path | None,
    options: Options,
    columns: Mapping[str, str] | None,
    units: Mapping[str, str] | None,
    force: bool,
    on_progress: Callable[[str], None],
) -> IdentifyResult:
    started = time.perf_counter()
    if folder:
        deliver.check_out(folder, force)
    believed = card if isinstance(card, Card) else read_card(card)
    taken = read_all(recordings, "recording", dict(believed.columns) | dict(columns or {}), units)
    check_kind(taken, believed.mount.motion)
    found = find(taken, believed, options, on_progress)
    if folder:
        if found.kept:
            on_progress(f"not determined: {', '.join(found.kept)}; card.toml keeps the given card's.")
        on_progress("drawing")
        found = deliver.deliver(found, taken, believed, folder, time.perf_counter() - started)
    return IdentifyResult(found, believed)
