"""The version of this project, stated here and nowhere else."""

__version__ = "0.1.0"
