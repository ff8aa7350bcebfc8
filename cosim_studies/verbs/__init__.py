"""Verbs of the studies: each a module that the entry points of this distribution name."""
