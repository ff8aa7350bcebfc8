"""The files of the simulators that are asked for, and the table beside them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cosim.data.recording import Recording
from cosim.simulators.format import Format
from cosim.simulators.measure import Held, hold
from cosim.simulators.motion import along_default, along_recording
from cosim.simulators.table import table_text
from cosim.support.files import directory, replacing
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
        _write(self.table, table_text(held), force)
        return held


def _write(path: Path, text: str, force: bool) -> None:
    with replacing(path, force) as partial:
        partial.write_text(text, encoding="utf-8")


def planned(
    mount: Mount, origin: str, formats: Sequence[Format], folder: Path, stem: str, recording: Recording | None
) -> Planned:
    """Name the files of some simulators in a folder."""
    files = tuple((form, folder / f"{stem}{form.suffix}") for form in formats if not form.whole)
    whole = tuple(form for form in formats if form.whole)
    return Planned(mount, origin, files, folder / f"{stem}_simulators.txt", recording, whole)
