"""Recordings, their formats and checks, set-point signals and motion profiles."""
