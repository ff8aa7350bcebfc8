"""The paper's tracking experiment on FMUs, and controllers that do better, with their price."""
