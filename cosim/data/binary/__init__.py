"""Binary files of recordings: Parquet, MAT, HDF5, MDF4, MCAP and the bags of ROS 2."""
