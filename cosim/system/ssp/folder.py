"""An SSP that lies unpacked: a folder with its SystemStructure.ssd."""

from pathlib import Path

from cosim.system.ssp.archive import Archive


class Folder(Archive):
    """A folder in the place of an archive; links that lead out of it count as outside.

    Raises:
        ScenarioError: there is no such folder or SSD.
    """

    def __init__(self, ssd: Path, outside: bool = False) -> None:
        self.path, self.base, self.outside, self.name = ssd, ssd.parent, outside, str(ssd)
        self.main = ssd.name
        if not ssd.is_file():
            raise self.error("it does not exist")

    def roots(self) -> list[str]:
        """List the SSDs of the folder."""
        return sorted(one.name for one in self.base.glob("*.ssd"))

    def read(self, source: str) -> bytes:
        """Return a file of the folder, named by a relative URI."""
        return self._file(source).read_bytes()

    def unpacked(self, sources: list[str]) -> dict[str, Path]:
        """Return the paths of files by their source; nothing is copied."""
        return {source: self._file(source) for source in sources}

    def _file(self, source: str) -> Path:
        beyond = self._beyond(source)
        found = beyond or (self.base / self._name(source)).resolve()
        if beyond is None and not found.is_relative_to(self.base.resolve()):
            raise self.error(f'"{source}" is a link that leads out of the folder')
        if not found.is_file():
            suffix = found.suffix
            have = (str(one.relative_to(self.base)) for one in sorted(self.base.rglob(f"*{suffix}")))
            raise self.error(f'"{source}" is missing', *have)
        return found
