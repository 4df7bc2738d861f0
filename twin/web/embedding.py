"""Charts in pages of one file: scripts and styles as text, samples as compressed arrays, other data as JSON.

A page has `chart_script()` and its own code in one module script, the style sheet `style.css`, and one element
`<script class="packed" type="text/plain">` for each text of `PackedArrays`; `unpack(index)` of the script returns its numbers.
"""

from __future__ import annotations

import base64
import json
import re
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike

STATIC = Path(__file__).parent / "static"
CHART = ("scale.js", "painter.js", "pointer.js", "chart.js", "samples.js")  # in the order of their imports
MODULE = re.compile(r"^import .*$|^export ", re.MULTILINE)


def chart_script(more: Iterable[Path] = ()) -> str:
    """Return the chart and further modules as the text of one module; names of all modules differ."""
    files = [*(STATIC / name for name in CHART), *more]
    return "".join(MODULE.sub("", file.read_text(encoding="utf-8")) for file in files)


def read_static(name: str) -> str:
    """Return a file of `static/` as text."""
    return (STATIC / name).read_text(encoding="utf-8")


def embed_json(data: Any) -> str:
    """Return data as JSON for a script element, which they cannot close; not for templates that escape."""
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


class PackedArrays:
    """Arrays of a page as texts: little-endian Float64, deflated, base64. Equal arrays, e.g. common times, are stored once."""

    def __init__(self) -> None:
        self._indices: dict[bytes, int] = {}
        self.texts: list[str] = []

    def index(self, values: ArrayLike) -> int:
        """Return the index of an array in the page."""
        array: Any = np.ascontiguousarray(values, "<f8")
        data = array.tobytes()
        if data not in self._indices:
            self._indices[data] = len(self.texts)
            self.texts.append(base64.b64encode(zlib.compress(data, 9)).decode())
        return self._indices[data]


__all__ = ["PackedArrays", "chart_script", "embed_json", "read_static"]
