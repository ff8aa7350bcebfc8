"""What proves the product, apart from the product: the paper's experiment, concealed cases, stiffness, the demo.

Nothing in `cosim` imports this package but the verbs `cosim demo`, `cosim paper` and `cosim prove`, when called.
It is in the same wheel all the same: who installs the tool can check its claims at once, with the version that makes
them, and no second distribution can fall out of step with it. It costs 0.3 MB on disk and nothing at import.
"""
