"""The controller: extended state observer, PD law and friction compensation, as a sampled model; one part a file."""

from pyfmi_models.adrc.adaptation import Adaptation
from pyfmi_models.adrc.compensation import compensation_case
from pyfmi_models.adrc.controller import Adrc, Gains
from pyfmi_models.adrc.estimate import Estimate, Seen
from pyfmi_models.adrc.learning import Learning
from pyfmi_models.adrc.observer import Observer
from pyfmi_models.adrc.velocity import VELOCITIES, DifferencedVelocity

__all__ = [
    "VELOCITIES",
    "Adaptation",
    "Adrc",
    "DifferencedVelocity",
    "Estimate",
    "Gains",
    "Learning",
    "Observer",
    "Seen",
    "compensation_case",
]
