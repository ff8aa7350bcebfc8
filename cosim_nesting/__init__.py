"""A system of FMUs as one FMU: its components as resources, its plan and the loop of `cosim run` as the binary."""
