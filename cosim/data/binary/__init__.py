"""Binary files of recordings: Parquet, arrays of NumPy, and the process in which plugged-in readers run."""
