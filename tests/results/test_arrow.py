"""Arrays for pyarrow that its own converters would give, without these."""

import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest

from tests.every_case import every_case
from twin.results.recording.arrow_arrays import text_array, to_arrow_array


@every_case("dtype", [np.float64, np.float32, np.int32, np.int64, np.bool_])
@every_case("count", [0, 1, 7, 8, 9, 1000])
def test_column(dtype, count):
    values = (np.arange(2 * count) % 3).astype(dtype)
    assert to_arrow_array(values).equals(pa.array(values))
    assert to_arrow_array(values[::2]).equals(pa.array(np.ascontiguousarray(values[::2])))


def test_numbers_that_are_none_stay():
    values = to_arrow_array(np.array([np.nan, np.inf, -0.0]))
    assert values.null_count == 0
    assert np.isnan(values[0].as_py())
    assert values[1].as_py() == np.inf


@pytest.mark.parametrize("text", ["PI", "", "Größe µ"])
def test_word(text):
    assert text_array(text).to_pylist() == [text]


@pytest.mark.slow
def test_pandas_is_not_imported_where_it_is_installed(tmp_path):
    (tmp_path / "pandas.py").write_text("raise SystemExit('pandas was imported')\n")
    code = """
import numpy as np
from pathlib import Path
from twin.results import Signals
from twin.results.recording import run_folder
table = Signals(np.arange(3.0), {"a.x": np.arange(3.0), "a.on": np.array([True, False, True])}, {})
columns = [run_folder.RecordedVariable("a.x"), run_folder.RecordedVariable("a.on", np.dtype(bool)), run_folder.RecordedVariable("a.missing")]
with run_folder.SignalFile(Path("signals.parquet"), columns, {"scenario": "x"}) as file:
    file.write("PI", 1, table)
"""
    subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{code}"], check=True, cwd=tmp_path
    )
