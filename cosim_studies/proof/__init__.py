"""Concealed-effect benchmark: recordings whose physics the tool was not told, and how well it finds it."""
