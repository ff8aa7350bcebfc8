"""Co-simulate with your FMU: the plant is an archive of anyone's, the controller comes from a card.

Run it as it is: `python cosimulate_your_fmu.py`. Then name your own archive in the place of `theirs`, and its variables
in the place of `tau` and `q`; `cosim show YOUR.fmu` lists them.
"""

from pathlib import Path
from tempfile import mkdtemp

import numpy as np

import cosim

SCENARIO = """
name = "theirs"
step = 1e-4                  # s; the co-simulation steps all parts this often
stop = 4.0

[components.mount]
fmu = "{fmu}"

[components.controller]
card = "paper_mount"
part = "controller"

[signals.star]
kind = "sidereal"            # 15 arcsec/s, what a telescope follows
smooth_start = 0.5

[[connections]]
from = "controller.tau"
to = "mount.tau"

[[connections]]
from = "mount.q"
to = "controller.q"

[[connections]]
from = "star.position"
to = "controller.q_d"

[[connections]]
from = "star.velocity"
to = "controller.v_d"

[record]
signals = {{ tau = "mount.tau", q = "mount.q", q_d = "star.position" }}
decimation = 10
"""


def main() -> float:
    """Run both for 4 s and return the RMS tracking error of the last two seconds in arcsec."""
    folder = Path(mkdtemp(prefix="cosim-theirs-"))
    exported = cosim.export("paper_mount", folder, fmi=3)
    theirs = next(path for path in exported.fmus if "plant" in path.name)
    (folder / "theirs.toml").write_text(SCENARIO.format(fmu=theirs.name), "utf-8")
    frame = cosim.run(folder / "theirs.toml").frame()
    late = frame[frame["t"] >= 2.0]
    error = float(np.sqrt(np.mean((late["q"] - late["q_d"]) ** 2)) * 180 / np.pi * 3600)
    print(f"{theirs.name}: {len(frame):,} rows, tracking error {error:.3g} arcsec RMS after 2 s")
    return error


if __name__ == "__main__":
    main()
