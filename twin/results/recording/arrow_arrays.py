"""Conversion of NumPy arrays to pyarrow. Its own converters, such as `pa.array`, import pandas if it is installed.

That import takes half a second and is not needed for plain arrays.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence


def to_arrow_array(values: np.ndarray[Any, Any]) -> Any:
    """Convert numbers, without a copy if they are contiguous; Booleans become bits."""
    import pyarrow as pa

    buffer = np.packbits(values, bitorder="little") if values.dtype == np.bool_ else np.ascontiguousarray(values)
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, pa.py_buffer(buffer)])


def open_table_writer(sink: Any, schema: Any, words: Sequence[str] = ()) -> Any:
    """Open a writer of tables to a file or to memory; `words`: columns with few distinct texts.

    Dictionaries of floats, which hardly repeat, take up to half of the writing time and save little space or none.
    """
    from pyarrow.parquet import ParquetWriter

    return ParquetWriter(sink, schema, compression="zstd", use_dictionary=[*words], writer_engine_version="V2")


def text_array(text: str) -> Any:
    """Create an array of one text."""
    import pyarrow as pa

    data = text.encode()
    return pa.StringArray.from_buffers(1, pa.py_buffer(np.array([0, len(data)], np.int32)), pa.py_buffer(data))
