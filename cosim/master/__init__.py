"""The co-simulation master: planning, execution and the one loop in C."""
