"""Numbers of a foreign FMU, or of a whole system, from recordings: see `calibrate`."""
