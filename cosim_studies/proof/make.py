"""One concealed case in a process of its own: recordings and card go to a folder, the truth comes back by pipe.

The process that runs the tool gets the folder and nothing else.
"""

from pathlib import Path

from cosim.support.plain import Parsed
from cosim_studies.proof.cases import CaseSpec
from cosim_studies.proof.generator import ANY, make_case, write_given


def make(wanted: CaseSpec, seconds: float, folder: str, rough: bool = False) -> Parsed:
    """Write what the tool may see into `folder` and return the truth."""
    case = make_case(wanted.seed, wanted.effects, wanted.size, duration=seconds, machine=ANY, rough=rough)
    write_given(case, Path(folder))
    return case.truth
