"""Arrays of numpy as pyarrow has them. Its own converters, such as `pa.array`, import pandas wherever it is installed.

That takes half a second, for nothing: what is recorded are plain arrays.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence


def column(values: np.ndarray[Any, Any]) -> Any:
    """Numbers, in the same memory if they lie there without gaps; Booleans, which are bits there."""
    import pyarrow as pa

    held = np.packbits(values, bitorder="little") if values.dtype == np.bool_ else np.ascontiguousarray(values)
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, pa.py_buffer(held)])


def writer(sink: Any, schema: Any, words: Sequence[str] = ()) -> Any:
    """What writes tables to a file, or to memory; `words` are columns of few texts.

    Dictionaries of doubles that hardly repeat take up to half of the time to write, and save little room or none.
    """
    from pyarrow.parquet import ParquetWriter

    return ParquetWriter(sink, schema, compression="zstd", use_dictionary=[*words], writer_engine_version="V2")


def word(text: str) -> Any:
    """An array of one text."""
    import pyarrow as pa

    data = text.encode()
    return pa.StringArray.from_buffers(1, pa.py_buffer(np.array([0, len(data)], np.int32)), pa.py_buffer(data))
