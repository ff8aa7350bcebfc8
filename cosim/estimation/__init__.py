"""From recordings to parameters: preparation, inverse dynamics, fits, identification."""
