"""`cosim.identify`: recordings and a card to the same card with identified numbers."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cosim.api.recordings import Source, read_all
from cosim.estimation.identify import deliver
from cosim.estimation.identify.identify import Identified, Options
from cosim.estimation.identify.identify import identify as find
from cosim.reading import check_kind
from cosim.support.html import text as html_text
from cosim.support.plain import JsonObject
from pyfmi_models.card import Card, read_card


@dataclass(frozen=True)
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

    def __str__(self) -> str:
        return deliver.summary(self.identified, self.given)

    def _repr_html_(self) -> str:
        return html_text(str(self))


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
    on_progress: Callable[[str], None] = lambda text: None,
) -> IdentifyResult:
    """Identify a card's numbers: friction map, presliding steps, output error in closed loop.

    Args:
        recordings: one or several, each a path, data frame, mapping of arrays or `Recording` (see `cosim.read`).
        card: the model as believed: its path, the name of a shipped one, or a `Card`.
        out: folder for card.toml, identify.json and the figures; None writes nothing.
        free: parameters to identify ("sigma0", "Fc", "inertia"); () for all of inertia and friction.
        cut: slowest speed of the friction map [rad/s; m/s]; None chooses it.
        keep_inertia: friction map of tau - J q'' (True) or of tau alone.
        starts: starts of the output-error fit, of which the best is kept.
        seed: of the random starts.
        columns: our name to the source's, as in `cosim.read`; they come before the card's.
        units: our name to the unit in the source, as in `cosim.read`.
        force: overwrite what is there.
        on_progress: told in a few words what is being done.

    Returns:
        `IdentifyResult`. Standard errors are those of the least-squares fits (Ljung 1999, chapter 9).

    Raises:
        InputError: the recordings tell nothing, or a parameter is unknown.
        RecordingError, UnitError: as `cosim.read`.
        CardError: the card is not good.
        OutputError: a file is there already; nothing was fitted then.
    """
    started, folder = time.perf_counter(), None if out is None else Path(out)
    if folder:
        deliver.check_out(folder, force)
    believed = card if isinstance(card, Card) else read_card(card)
    taken = read_all(recordings, "recording", dict(believed.columns) | dict(columns or {}), units)
    check_kind(taken, believed.mount.motion)
    found = find(taken, believed, Options(tuple(free), cut, keep_inertia, starts, seed), on_progress)
    if folder:
        if found.kept:
            on_progress(f"not determined: {', '.join(found.kept)}; card.toml keeps the given card's.")
        on_progress("drawing")
        found = deliver.deliver(found, taken, believed, folder, time.perf_counter() - started)
    return IdentifyResult(found, believed)
