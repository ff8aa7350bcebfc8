"""Recordings by tools that not everybody has: HDF5, MAT, bags of ROS 1 and 2, MCAP, MDF4, and texts
that machines' tools export.

Each is plugged in, by the suffix of a file or by the first lines of a text.
"""
