"""How to get packages that only some verbs and formats need.

This project is installed from its source, so an extra by its name (`pip install 'mount-cosim[serve]'`) finds nothing:
the packages themselves are named, as this installation declares them.
"""

import re
from importlib.metadata import PackageNotFoundError, requires

DISTRIBUTION = "mount-cosim"
_DECLARED = re.compile(r"""^([\w.-]+(?:\[[^\]]*\])?)([^;]*)(?:;.*extra\s*==\s*['"]([^'"]+)['"])?""")


def declared() -> list[tuple[str, str, str]]:
    """Packages that this installation needs: name, bounds, and the extra that needs it, "" where all do."""
    try:
        lines = requires(DISTRIBUTION) or []
    except PackageNotFoundError:
        lines = []
    return [(parts[1], parts[2].strip(), parts[3] or "") for line in lines if (parts := _DECLARED.match(line))]


def install(extra: str) -> str:
    """Return the command that installs what an extra needs: "pip install starlette>=1.10 uvicorn>=0.30", quoted."""
    names = [f'"{name}{bounds}"' for name, bounds, of in declared() if of == extra]
    return f"pip install {' '.join(names) or extra}"
