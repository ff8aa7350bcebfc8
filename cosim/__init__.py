"""Run a mount as co-simulation, record it, compare it with a recording, find what is missing, deploy the controller.

SI units inside, other units only where files come in. Time is counted in integer ticks, never summed.
"""

__version__ = "0.1.0"
