"""How well the stiff friction state is integrated: the FMU beside the paper's analytic update and textbook methods.

The bristle equation of a card's LuGre law is driven by prescribed motions and solved at the paper's steps of 0.1 ms and
at ten times that. `z` is kept as the bristle torque sigma0 z. `python -m cosim_studies.stiffness --out DIR` rebuilds
the tables and the picture.
"""

from cosim_studies.stiffness.comparison import FMU, Limit, Row, compare, limits
from cosim_studies.stiffness.motion import REGIMES, STEP, Regime
from cosim_studies.stiffness.pages import table_text

__all__ = ["FMU", "REGIMES", "STEP", "Limit", "Regime", "Row", "compare", "limits", "table_text"]
