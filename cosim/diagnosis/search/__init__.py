"""Which effects are tried, fitted, challenged by rivals and scored on held-out recordings."""
