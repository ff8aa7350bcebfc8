"""What a file declares is judged before it is unpacked, and what is computed in a database is never run."""

import gzip
import re
import tracemalloc
from pathlib import Path

import attack_files
import attack_files_bags
import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from scipy.io import savemat

from cosim.data import limits
from cosim.data.recording import Recording
from cosim.support.errors import RecordingError

T = np.arange(400) * 1e-2
AXIS = {"t": T, "tau": np.cos(T), "q": np.sin(T)}
COMPUTED = r"a table of it is computed \(a view, a function, a recursion\)"
LARGE = "unpacks to .* or more; a file of its size .* may unpack to 200 MB"
SAYS = {
    "bag: messages are a view without end": COMPUTED,
    "bag: topics are a view without end": COMPUTED,
    "bag: messages are a view of a table joined with itself four times": COMPUTED,
    "bag: the bytes of a message are computed: a hundred million zeros each": COMPUTED,
    "bag: nothing wrong": "",
    "mcap: one message of millions of zeros, packed": "has .*00,001 columns; a recording has at most 10,000",
    "mcap: messages that hold a text of a megabyte each, packed": "has 125,001 columns",
    "parquet: one list of fifty million numbers in a row": f"{LARGE}|^$",
    "parquet: cells of a megabyte of fixed length": LARGE,
    "bag: the bytes of a message are those of another column, doubled 24 times": COMPUTED,
    "mdf: an mdf whose group claims a million million records": f"{LARGE}|cannot be read",
}
"""Crafted files and what is said of each; empty where it is read."""


@pytest.mark.parametrize("name", SAYS)
def test_a_crafted_file_is_refused_for_what_it_declares(name: str, tmp_path: Path) -> None:
    path, said = attack_files.made(name, 5, tmp_path), ""
    try:
        Recording.read(path, columns={"q": "a.position", "tau": "a.effort"} if "nothing" in name else {})
    except RecordingError as error:
        said = str(error)
    assert bool(said) == bool(SAYS[name]) or SAYS[name].endswith("^$")
    assert re.search(SAYS[name], said), said


def test_one_long_text_in_every_row_counts_as_often_as_it_stands_there(tmp_path: Path) -> None:
    parquet.write_table(pa.table(AXIS | {"s": ["x" * 600_000] * 400}), tmp_path / "run.parquet")
    with pytest.raises(RecordingError, match=rf"column s {LARGE}.*--layout limit=2"):
        Recording.read(tmp_path / "run.parquet")


def test_texts_that_stand_once_in_the_file_stand_once_in_memory(tmp_path: Path) -> None:
    text = "x" * 400_000
    parquet.write_table(pa.table(AXIS | {"s": [text, None] * 200}), tmp_path / "run.parquet")
    kept = Recording.read(tmp_path / "run.parquet").others["s"]
    assert len({id(one) for one in kept}) == 2
    assert [len(one or "") for one in kept[:2]] == [400_000, 0]


def test_packed_variables_count_by_what_they_unpack_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cells = np.empty(50, dtype=object)
    cells[:] = [np.zeros(1000) for _ in cells]
    savemat(tmp_path / "run.mat", AXIS | {"c": cells}, do_compression=True)
    assert len(Recording.read(tmp_path / "run.mat")) == 400
    monkeypatch.setattr(limits, "UNPACKED", 300_000)
    with pytest.raises(RecordingError, match=r"unpacks to .* may unpack to 300 kB.*--layout limit=2"):
        Recording.read(tmp_path / "run.mat")


def test_a_topic_of_images_is_left_out_by_name_and_the_joints_are_read(tmp_path: Path) -> None:
    path = tmp_path / "run.db3"
    add = "INSERT INTO topics VALUES (2, '/camera', 'sensor_msgs/msg/JointState');"
    attack_files_bags.written(
        path, f"{add} INSERT INTO messages(topic_id, timestamp, data) VALUES (2, 5, zeroblob(90000));"
    )
    read = Recording.read(path, {"q": "a.position", "tau": "a.effort"})
    assert len(read) == 200
    assert "/camera" in " ".join(read.notes)


def test_lines_of_one_number_are_counted_before_they_become_objects(tmp_path: Path) -> None:
    """26 million lines in 52 kB of gzip: refused with hardly more in memory than the text."""
    path = tmp_path / "run.csv.gz"
    path.write_bytes(gzip.compress(b"0\n" * 26_000_000, 9))
    tracemalloc.start()
    try:
        with pytest.raises(RecordingError, match="26,000,000 numbers"):
            Recording.read(path)
        assert tracemalloc.get_traced_memory()[1] < 4 * 52e6
    finally:
        tracemalloc.stop()
