"""A figure in the house style, written as SVG when the block that draws it ends well; matplotlib is imported on use."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cosim.files import replacing
from cosim.pictures.style import STYLE

SIZES: Any = {"font.size": 10, "axes.titlesize": 10, "axes.labelsize": 9, "xtick.labelsize": 9, "ytick.labelsize": 9}


@contextmanager
def figure(path: Path, size: tuple[float, float], force: bool = False) -> Iterator[Any]:
    """Yield the axes of a figure of `size` inches."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({**STYLE, **SIZES}):
        sheet = Figure(figsize=size, layout="constrained")
        yield sheet.subplots()
        with replacing(path, force) as partial:
            sheet.savefig(partial, format="svg", metadata={"Date": None, "Creator": None})
