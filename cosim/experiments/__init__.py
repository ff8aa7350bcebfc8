"""Experiments that travel in the archive of an FMU, and the check that it runs as its maker meant: see `check`."""
