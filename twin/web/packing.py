"""Numbers for pages that need no server: two bytes each, unpacked by `unpack` of `static/scale.js`."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

NAN_CODE = 65535  # code of NaN


def pack_values(values: NDArray[Any]) -> dict[str, Any]:
    """Quantize numbers to 16 bits, two bytes each: the error is at most 1/131,000 of their range."""
    array = np.asarray(values, float).reshape(len(values), -1)
    is_finite = np.isfinite(array)
    low, high = (float(edge(array[is_finite])) for edge in (np.min, np.max)) if is_finite.any() else (0.0, 0.0)
    step = (high - low) / (NAN_CODE - 1) or 1.0
    codes = np.where(is_finite, np.rint((np.where(is_finite, array, low) - low) / step), NAN_CODE).astype("<u2")
    return {
        "low": float(f"{low:.10g}"),
        "step": step,
        "count": array.shape[1],
        "data": base64.b64encode(codes.tobytes()).decode(),
    }
