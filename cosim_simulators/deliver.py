"""The files of the simulators that are asked for, and the table beside them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cosim.api.recordings import Source, read
from cosim.data.recording import Recording
from cosim.reading import check_kind
from cosim.support.files import directory, replacing
from cosim_simulators import FORMATS, WHOLE
from cosim_simulators.format import Format
from cosim_simulators.measure import Held, hold
from cosim_simulators.motion import along_default, along_recording
from pyfmi_models.card import Card
from pyfmi_models.mount import Mount


@dataclass(frozen=True)
class Planned:
    """Files for simulators, by format, and the path of the table."""

    mount: Mount
    origin: str
    files: tuple[tuple[Format, Path], ...]
    table: Path
    recording: Recording | None = None
    whole: tuple[Format, ...] = ()
    """Formats whose files others write, which are in the table too."""

    @property
    def paths(self) -> tuple[Path, ...]:
        """All that will be written."""
        return (*(path for _, path in self.files), self.table)

    def write(self, force: bool) -> tuple[Held, ...]:
        """Write the files and the table; return what each simulator holds."""
        directory(self.table.parent)
        compared = along_recording(self.recording, self.mount) if self.recording else along_default(self.mount)
        held = tuple(hold(self.mount, form, compared) for form in (*(form for form, _ in self.files), *self.whole))
        title = f"Written by mount-cosim from {self.origin}; what is lost is in {self.table.name}"
        for one, (form, path) in zip(held, self.files, strict=False):
            _write(path, form.text(one.mount, self.mount, title), force)
        _write(self.table, "\n\n".join(map(str, held)) + "\n", force)
        return held


def _write(path: Path, text: str, force: bool) -> None:
    with replacing(path, force) as partial:
        partial.write_text(text, encoding="utf-8")


def planned(card: Card, folder: Path, stem: str, kinds: Sequence[str], recording: Source | None) -> Planned | None:
    """Name the files for simulators in a folder; None where no word of `kinds` asks for one.

    Args:
        card: what is written.
        folder: where.
        stem: how the files' names begin.
        kinds: words of what is wanted, those of FMUs and models among them.
        recording: along whose motion is measured what a simulator cannot hold; None takes two sines.

    Raises:
        RecordingError, InputError: the recording is not good, or of another kind of axis.
    """
    formats = [form for kind, form in (FORMATS | WHOLE).items() if kind in kinds]
    if not formats:
        return None
    taken = None if recording is None else read(recording, columns=card.columns)
    if taken is not None:
        check_kind([taken], card.mount.motion)
    files = tuple((form, folder / f"{stem}{form.suffix}") for form in formats if not form.whole)
    whole = tuple(form for form in formats if form.whole)
    return Planned(card.plant(), card.path or stem, files, folder / f"{stem}_simulators.txt", taken, whole)
