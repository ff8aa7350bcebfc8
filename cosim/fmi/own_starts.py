"""Start values of an FMU that was calibrated here, which its binary does not know.

FMI lets a binary have its start values inside: a tool that changes them in the model description alone changes nothing
in importers that do not set what they read there. A calibrated FMU therefore carries them in a file of its own, and
they are set here before anything else is.
"""

import json
import zipfile
from collections.abc import Mapping
from math import isfinite
from pathlib import Path

from cosim.support.errors import FmuError

MEMBER = "extra/mount-cosim/starts.json"


def own_starts(path: Path) -> dict[str, float]:
    """Return the start values of a calibrated FMU by name; none for any other.

    Raises:
        FmuError: its file of start values is damaged.
    """
    with zipfile.ZipFile(path) as archive:
        if MEMBER not in archive.namelist():
            return {}
        try:
            found = json.loads(archive.read(MEMBER))
            values = {str(name): float(value) for name, value in found.items()}
        except (ValueError, TypeError, AttributeError, zipfile.BadZipFile) as error:
            raise FmuError(f"{path} has start values that cannot be read ({MEMBER}).", culprit=str(path)) from error
    if not all(map(isfinite, values.values())):
        raise FmuError(f"{path} has start values that are no numbers ({MEMBER}).", culprit=str(path))
    return values


def as_member(values: Mapping[str, float]) -> bytes:
    """Write start values as such a file."""
    return json.dumps(dict(values), indent=2).encode()
