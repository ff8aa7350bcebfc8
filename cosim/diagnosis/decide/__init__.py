"""The decision, from scores alone: no arrays, no recordings."""
