"""Components behind one interface: FMUs, Python functions, their descriptions and aliases."""
