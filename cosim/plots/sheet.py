"""A sheet of several small drawings as one SVG, for results on paper; matplotlib is imported on use only."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cosim.plots.style import STYLE
from cosim.support.files import replacing

SIZES: Any = {"font.size": 10, "axes.titlesize": 10, "axes.labelsize": 9, "xtick.labelsize": 9, "ytick.labelsize": 9}


@contextmanager
def figure(path: Path, rows: int, columns: int, size: tuple[float, float], force: bool) -> Iterator[tuple[Any, Any]]:
    """Yield a figure and its axes (a 2-D array), and write it as SVG when the block ends well."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({**STYLE, **SIZES}):
        sheet = Figure(figsize=size, layout="constrained")
        axes = sheet.subplots(rows, columns, squeeze=False)
        yield sheet, axes
        with replacing(path, force) as partial:
            sheet.savefig(partial, format="svg", metadata={"Date": None, "Creator": None})


def draw_all(
    found: Any, folder: Path, pictures: Mapping[str, tuple[Callable[[Any, Path, bool], None], str]], force: bool
) -> dict[Path, str]:
    """Draw pictures of what was found, each a name with the function that draws it and what it shows.

    Returns:
        What each file shows.
    """
    made = {}
    for name, (draw, shows) in pictures.items():
        path = folder / f"{name}.svg"
        draw(found, path, force)
        made[path] = shows
    return made


def plain_logs(*axes: Any) -> None:
    """Write the numbers of logarithmic axes as numbers: this project's figures parse no mathematics."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    for one in axes:
        for axis in (one.xaxis, one.yaxis):
            if axis.get_scale() == "log":
                axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
                axis.set_minor_formatter(NullFormatter())
