"""Answers as pandas tables."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cosim.diagnosis.answer.result import Finding, Trace

if TYPE_CHECKING:
    import pandas as pd

FINDINGS = ("effect", "title", "answer", "probability", "size", "range", "action")
MISSING = ("recording", "heldout", "t", "q", "v", "missing", "band", "after")


def findings_frame(findings: Sequence[Finding]) -> "pd.DataFrame":
    """Return findings as a table, a row an effect, in their rank."""
    import pandas as pd

    rows = [
        (one.effect, one.title, one.answer, one.probability, one.size, one.size_range, one.action) for one in findings
    ]
    return pd.DataFrame(rows, columns=list(FINDINGS))


def missing_frame(traces: Sequence[Trace]) -> "pd.DataFrame":
    """Return the missing torque of all recordings, a row a sample that was judged."""
    import pandas as pd

    parts = [
        pd.DataFrame(
            {
                "recording": one.name,
                "heldout": one.heldout,
                **{name: getattr(one, name) for name in ("t", "q", "v", "missing", "band")},
                "after": one.tau - one.after,
            }
        )
        for one in traces
    ]
    table = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(MISSING))
    return table.astype({"heldout": np.bool_}) if len(table) else table
