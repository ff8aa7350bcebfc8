"""Closed forms in the place of learned tables: a search that is plugged into `cosim diagnose` by an entry point."""
