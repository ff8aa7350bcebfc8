"""Pictures of runs; nothing here is imported while something runs."""
