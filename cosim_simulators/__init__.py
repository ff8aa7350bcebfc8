"""One card in every simulator: the joint as each can hold it, and in N m what it cannot hold."""

from cosim_simulators.format import FLANGE, C
from cosim_simulators.isaac import ISAAC
from cosim_simulators.mujoco import MUJOCO
from cosim_simulators.urdf import URDF

FORMATS = {one.key: one for one in (MUJOCO, URDF, ISAAC)}
"""Simulators' files by the word that asks for them."""

WHOLE = {one.key: one for one in (FLANGE, C)}
"""What has the equations of the FMU, and is written by the export of models."""

__all__ = ["FORMATS", "WHOLE"]
