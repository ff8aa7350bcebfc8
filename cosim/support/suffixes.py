"""Suffixes of the files that may hold a recording, known without loading a reader."""

from cosim.support.plugins import READERS, names

TEXTS = (".csv", ".csv.gz", ".tsv", ".txt", ".txt.gz", ".log", ".dat", ".asc", ".lvm")
JSONS = (".json", ".json.gz", ".jsonl", ".jsonl.gz", ".ndjson")
OURS = (*TEXTS, *JSONS, ".parquet", ".npz", ".npy")


def recordings() -> tuple[str, ...]:
    """Suffixes of all that is read, those that packages plug in last."""
    return (*OURS, *(f".{name}" for name in names(READERS)))
