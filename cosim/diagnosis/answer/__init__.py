"""The answer of a diagnosis as plain data: no arrays of recordings, no statistics."""
