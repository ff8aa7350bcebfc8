"""The controller on a machine: compiled loop in real time, CiA 402, checks, black box, replay (docs/hardware.md)."""
