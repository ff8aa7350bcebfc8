"""Where training never was: what is left there is said to lie there, what is left everywhere is not."""

import re
from dataclasses import replace

import numpy as np
from report_example import diagnosis

from cosim.diagnosis.answer.result import Diagnosis
from cosim.report.page import unexplained
from cosim.report.quantities import Scales
from cosim.report.terminal import summary


def limited(limit: float, trained: float) -> Diagnosis:
    """Something unknown that acts on the held-out run alone, where its torque passes a limit."""
    whole = diagnosis("none")
    *fitted, held = whole.traces
    large = held.tau > limit
    held = replace(held, after=held.after - 3.0 * large)
    fitted = [replace(one, tau=np.minimum(one.tau, trained)) for one in fitted]
    after = float(np.sqrt(np.mean((held.tau - held.after) ** 2)))
    return replace(whole, verdict=("unknown",), traces=(*fitted, held), heldout=replace(whole.heldout, after_rms=after))


def test_a_rest_where_training_never_was_is_said_to_lie_there() -> None:
    top = float(np.quantile(diagnosis("none").traces[-1].tau, 0.97))
    said = limited(top, top)
    page = " ".join(unexplained(said, Scales.of(said)))
    assert re.search(
        r"9\d % of the error energy on validation runs lies at torques outside .* \(3 % of the time\)", page
    )
    assert "which the fit never had (3 % of the time): what acts there" in " ".join(summary(said).split())


def test_a_rest_where_training_was_too_is_said_to_lie_nowhere() -> None:
    top = float(np.quantile(diagnosis("none").traces[-1].tau, 0.97))
    for known in (limited(top, np.inf), limited(-np.inf, top)):
        assert "the fit never had" not in " ".join(unexplained(known, Scales.of(known))) + summary(known)
