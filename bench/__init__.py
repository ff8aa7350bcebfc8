"""Programs that measure: speeds, proofs, attacks; each is a command of its own, some also serve tests."""
