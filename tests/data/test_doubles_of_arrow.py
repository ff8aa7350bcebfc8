"""Columns of doubles come from Arrow as they are, and without pandas."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from cosim.data.text.table import as_array

VALUES = np.linspace(-1.0, 1.0, 11)
READ = """
import sys
from pathlib import Path
from cosim.data.binary.parquet import read
read(Path("run.parquet"))
print("pandas" in sys.modules)
"""


@pytest.mark.parametrize("column", [pa.array(VALUES), pa.array(VALUES).slice(3, 5)], ids=["whole", "slice"])
def test_doubles_are_the_same_in_one_chunk_and_in_several(column: pa.Array) -> None:
    expected = VALUES if len(column) == len(VALUES) else VALUES[3:8]
    assert np.array_equal(as_array(column), expected)
    chunked = pa.chunked_array([column, column.slice(0, 0), column.slice(1)])
    assert np.array_equal(as_array(chunked), np.concatenate([expected, expected[1:]]))


def test_what_is_missing_is_no_number_and_no_rows_are_none() -> None:
    assert np.isnan(as_array(pa.chunked_array([pa.array([1.0, None])]))).tolist() == [False, True]
    assert as_array(pa.chunked_array([], pa.float64())).shape == (0,)


def test_a_table_of_numbers_is_read_without_pandas(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    parquet.write_table(pa.table({"t": VALUES, "q": VALUES**2}), path)
    done = subprocess.run([sys.executable, "-c", READ], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
