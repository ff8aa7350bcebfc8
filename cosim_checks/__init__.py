"""Checks for friction laws and effects that somebody else wrote, one name and one function a check."""
