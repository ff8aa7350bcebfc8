"""What a drive withholds."""

from collections.abc import Iterable, Iterator, Sequence
from typing import ClassVar

import numpy as np

from cosim.diagnosis.effects.base import QUICK_CHANGES, Hypothesis, Seen, of_that_size
from cosim.diagnosis.effects.candidates import Candidate, Span, sized
from pyfmi_models.effects.torque_saturation import TorqueSaturation
from pyfmi_models.mount import Mount


class Saturation(Hypothesis[TorqueSaturation]):
    """Less torque above a knee."""

    forms = (TorqueSaturation,)
    tables = ("torque",)
    easiest: ClassVar[int] = -1
    may_end: ClassVar[tuple[str, ...]] = ("slope",)
    rank: ClassVar[float] = 15
    needs_position: ClassVar[bool] = False
    view = "load"
    acts = QUICK_CHANGES

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Knees below the highest torques that were asked for."""
        for share in (0.8, 0.9, 0.96, 0.985):
            knee = float(np.quantile(np.abs(span.tau), share))
            if knee > 0:
                yield sized(TorqueSaturation(knee_torque=knee, slope=1.0), 0.02, 0.98, ("slope",))

    def concealed(self, mount: Mount, span: Span, tried: Sequence[Candidate]) -> Iterable[Candidate]:
        """Half of what is asked for past each knee."""
        return [of_that_size(one, slope=0.5) for one in tried]

    def looked(self, seen: Seen, mount: Mount) -> str:
        """Lower knees, past which half of what is asked for comes."""
        return f"with a knee below {seen.high:.3g} {'N' if mount.motion == 'linear' else 'N·m'}"
