"""Recordings of robots, bags of ROS 1 and 2 and MCAP: readers that are plugged in by the suffix of a file."""
