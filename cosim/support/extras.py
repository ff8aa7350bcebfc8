"""How to get packages that only some verbs and formats need.

This project is installed from its source, so an extra by its name (`pip install 'mount-cosim[serve]'`) finds nothing:
the packages themselves are named, as this installation declares them.
"""

import re
from importlib.metadata import PackageNotFoundError, requires

DISTRIBUTION = "mount-cosim"
_DECLARED = re.compile(r"""^([A-Za-z0-9._-]+)(\[[^\]]*\])?([^;]*);.*extra\s*==\s*['"]([^'"]+)['"]""")


def install(extra: str) -> str:
    """Return the command that installs what an extra needs: "pip install starlette>=1.10 uvicorn>=0.30", quoted."""
    try:
        lines = requires(DISTRIBUTION) or []
    except PackageNotFoundError:
        lines = []
    found = [parts.groups() for line in lines if (parts := _DECLARED.match(line)) and parts[4] == extra]
    names = [f'"{name}{options or ""}{bounds.strip()}"' for name, options, bounds, _ in found]
    return f"pip install {' '.join(names) or extra}"
