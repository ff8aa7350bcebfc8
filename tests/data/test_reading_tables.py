"""A table of several signals in one array is its columns, and many gains are no recording."""

from pathlib import Path

import numpy as np
import pytest
from test_reading_samples import made

from cosim.data.recording import Recording


@pytest.mark.parametrize("kind", ["mat", "h5"])
@pytest.mark.parametrize("turned", [False, True])
def test_a_table_of_several_signals_is_its_columns(tmp_path: Path, kind: str, turned: bool) -> None:
    """Simulink logs to arrays of (samples, signals); MATLAB 7.3 writes them the other way round."""
    table = np.column_stack([made.T, made.TAU, made.Q])
    table = table.T if turned else table
    if kind == "mat":
        from scipy.io import savemat

        savemat(tmp_path / "run.mat", {"data": table, "gains": np.eye(3)})
    else:
        with pytest.importorskip("h5py").File(tmp_path / "run.h5", "w") as file:
            file["data"], file["gains"] = table, np.eye(3)
    run = Recording.read(tmp_path / f"run.{kind}", {"t": "data_1", "tau": "data_2", "q": "data_3"})
    np.testing.assert_allclose(run["tau"], made.TAU)
    np.testing.assert_allclose(run["q"], made.Q)
    assert set(run.columns) == {"t", "tau", "q"}


def test_many_columns_of_gains_do_not_outnumber_the_vectors_of_a_recording(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "run.mat", {"t": made.T, "tau": made.TAU, "q": made.Q, "gains": np.ones((4, 100))})
    assert set(Recording.read(tmp_path / "run.mat").columns) == {"t", "tau", "q"}
