"""Find what physics a model left out, prove it on a recording it never saw, and write the better model."""
