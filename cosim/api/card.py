"""`cosim.card`: recordings to a first card of the axis."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cosim.api.recordings import Source, at_least_one, read_all
from cosim.data.recording import Recording
from cosim.diagnosis.first_card import FirstCard, Motion, Number, first_card
from cosim.plots.quantities import number
from cosim.reading import check_kind
from cosim.support.errors import InputError
from cosim.support.files import check_free, replacing
from cosim.support.html import text as html_text
from cosim.support.plain import JsonObject
from cosim.support.threads import in_one_thread
from cosim.support.version import __version__
from pyfmi_models.card import Card, MountSection
from pyfmi_models.card_writer import card_text
from pyfmi_models.effects import GravityUnbalance

WORDS = {
    "axis.inertia": "inertia",
    "friction.Fc": "Coulomb friction",
    "friction.sigma2": "viscous friction",
    "torque": "constant torque",
    "mgl": "weight times lever arm",
    "phase": "its phase at position zero",
}


@dataclass(frozen=True)
class CardResult:
    """A first card, with what the recordings say of each of its numbers."""

    found: FirstCard
    card: Card
    notes: tuple[str, ...]

    @property
    def numbers(self) -> tuple[Number, ...]:
        """Each number with its standard error, and whether the recordings determine it."""
        return self.found.numbers

    def as_json(self) -> JsonObject:
        """Return everything as plain data."""
        return {
            "numbers": {
                one.name: {
                    "value": one.value,
                    "standard_error": one.error,
                    "range": list(one.range),
                    "unit": one.unit,
                    "determined": one.is_determined,
                }
                for one in self.numbers
            },
            "explained": self.found.explained,
            "notes": list(self.notes),
            "version": __version__,
        }

    def write(self, file: Path, force: bool = False) -> None:
        """Write the card (raises OutputError)."""
        with replacing(file, force) as partial:
            partial.write_text(self.text(), "utf-8")

    def text(self) -> str:
        """Return the card as TOML, with the ranges as a comment."""
        return card_text(
            self.card, "\n".join(["Estimated from recordings alone; 95 % ranges:", *map(_row, self.numbers)])
        )

    def __str__(self) -> str:
        share = f"{100 * self.found.explained:.0f} % of the torque's energy explained."
        return "\n".join([*map(_row, self.numbers), share, *self.notes])

    def __repr__(self) -> str:
        return f"CardResult({self.card.mount.name!r}, {len(self.numbers)} numbers)"

    def _repr_html_(self) -> str:
        return html_text(str(self))


@in_one_thread
def card(
    recordings: Source | Sequence[Source],
    out: str | Path | None = None,
    *,
    motion: str = "",
    inertia: float | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    layout: Mapping[str, str] | None = None,
    force: bool = False,
    on_progress: Callable[[str], None] = lambda text: None,
) -> CardResult:
    """Estimate a first card from recordings alone: inertia, friction, constant torque and weight, with ranges.

    Args:
        recordings: one or several of one axis, each a path, data frame, mapping of arrays or `Recording`.
        out: file of the card (.toml); None writes nothing.
        motion: "rotary" or "linear"; where it is not given, units of the recordings say it, else it is rotary.
        inertia: where it is known [kg m2, kg]; it is not estimated then.
        columns: our name to the source's, as in `cosim.read`.
        units: our name to the unit in the source, as in `cosim.read`.
        layout: CSV format, as in `cosim.read`.
        force: overwrite what is there.
        on_progress: called with a few words on what is being done.

    Raises:
        InputError, RecordingError: the recordings do not tell, and which number to give; or they are bad.
        OutputError: the file is there already.
    """
    file = None if out is None else Path(out)
    if file is not None:
        check_free(file, force)
    made = estimated_card(
        at_least_one(read_all(recordings, "recording", columns, units, layout)), motion, inertia, on_progress
    )
    if file is not None:
        made.write(file, force)
    return made


def estimated_card(
    taken: Sequence[Recording],
    motion: str = "",
    inertia: float | None = None,
    on_progress: Callable[[str], None] = lambda text: None,
    is_asked: bool = True,
) -> CardResult:
    """The same of recordings that are read; `is_asked` as for `first_card`."""
    kind, assumed = kind_of(taken, motion)
    check_kind(taken, kind)
    _check_once(taken)
    found = first_card(taken, kind, inertia, on_progress, is_asked)
    notes = ((assumed,) if assumed else ()) + found.notes
    return CardResult(found, _card(found, taken), notes)


def _check_once(recordings: Sequence[Recording]) -> None:
    """Refuse a file that is given twice: it would tell everything more precisely than it does (InputError)."""
    seen: dict[tuple[str, str], str] = {}
    for one in recordings:
        if one.sha256 and one.identity in seen:
            text = f"{one.name} and {seen[one.identity]} are the same recording; give each once."
            raise InputError(text, culprit=one.name)
        seen[one.identity] = one.name


def kind_of(recordings: Sequence[Recording], motion: str) -> tuple[Motion, str]:
    """Return the kind of axis as it is given, or as units say it, and a note where neither does.

    Raises:
        InputError: it is no kind of axis.
    """
    if motion:
        check_kind(recordings, motion)
        return ("linear" if motion == "linear" else "rotary"), ""
    stated = {one.units.get(name, "") for one in recordings for name in ("q", "v", "tau")}
    if stated & {"m", "m/s", "N"}:
        return "linear", ""
    unknown = "No unit says whether the axis turns or moves along; it is taken to turn (otherwise --motion linear)."
    return "rotary", "" if stated & {"rad", "rad/s", "N.m"} else unknown


def _card(found: FirstCard, recordings: Sequence[Recording]) -> Card:
    mount = found.mount
    loads = [one for one in mount.effects if isinstance(one, GravityUnbalance)]
    section = MountSection(name=recordings[0].name, motion=mount.motion, inertia=float(mount.axis.inertia))
    origin = {"estimated_by": f"mount-cosim {__version__}", "recordings": [one.name for one in recordings]}
    return Card(
        path="the estimated card",
        mount=section,
        friction=mount.friction,
        unbalance=loads[0] if loads else None,
        effects=tuple(one for one in mount.effects if one not in loads),
        origin=origin,
    )


def _row(one: Number) -> str:
    name = next((words for end, words in WORDS.items() if one.name.endswith(end)), one.name)
    if not one.is_determined:
        return f"{name}: not determined"
    if not one.error:
        return f"{name}: {number(one.value, 4)} {one.unit}, as given"
    low, high = (number(end, 3) for end in one.range)
    return f"{name}: {number(one.value, 3)} {one.unit} ({low} to {high})"
