"""Arrays of numpy as pyarrow has them. Its own converters, such as `pa.array`, import pandas wherever it is installed.

That takes half a second, for nothing: what is recorded are plain arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def column(values: np.ndarray[Any, Any]) -> Any:
    """Numbers, in the same memory if they lie there without gaps; Booleans, which are bits there."""
    import pyarrow as pa

    held = np.packbits(values, bitorder="little") if values.dtype == np.bool_ else np.ascontiguousarray(values)
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, pa.py_buffer(held)])


def word(text: str) -> Any:
    """An array of one text."""
    import pyarrow as pa

    data = text.encode()
    return pa.StringArray.from_buffers(1, pa.py_buffer(np.array([0, len(data)], np.int32)), pa.py_buffer(data))
