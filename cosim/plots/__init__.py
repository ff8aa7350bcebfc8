"""Pictures of runs and sweeps; nothing here is imported while something runs."""
