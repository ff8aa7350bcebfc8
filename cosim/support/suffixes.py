"""Suffixes of the files that may hold a recording, known without loading a reader."""

RECORDINGS = (
    *(".csv", ".csv.gz", ".tsv", ".txt", ".txt.gz", ".log", ".dat", ".asc", ".lvm"),
    *(".json", ".json.gz", ".jsonl", ".jsonl.gz", ".ndjson", ".parquet", ".npz", ".npy"),
    *(".mat", ".h5", ".hdf5", ".mf4", ".mcap", ".db3", ".bag"),
)
