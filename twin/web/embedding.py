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
# in the order of their imports
CHART = ("scale.js", "samples.js", "painter.js", "pointer.js", "chart.js")
VIEWS = ("draw.js", "view_bench.js", "view_rig.js", "view_scene.js", "view_vessel.js", "views.js")
IMPORT = re.compile(r"^import (\{.*?\}) from \"\./(\w+)\.js\";$", re.MULTILINE)
COMMENT = re.compile(
    r"^ *(?:(?://.*)?\n)?| +// .*$", re.MULTILINE
)  # also at the end of a line, empty lines, indentation
EXPORT = re.compile(r"^export ((?:async )?(?:const|class|function) (\w+))", re.MULTILINE)


def chart_script(files: Iterable[Path] = (), *, views: bool = False) -> str:
    """Return the chart, and views of the machine, with the page's own `files`, as the text of one module.

    Files of this folder keep their own names, as modules do. The page's files share theirs, and import the chart as modules
    do: `import { Chart } from "./chart.js";`.
    """
    modules = [STATIC / name for name in (*CHART, *(VIEWS if views else ()))]
    return "".join([*map(wrap_module, modules), *(replace_imports(file.read_text("utf-8")) for file in files)])


def wrap_module(file: Path) -> str:
    """Return a module as an object of its exports."""
    text = file.read_text("utf-8")
    names = ", ".join(match[2] for match in EXPORT.finditer(text))
    body = EXPORT.sub(r"\1", replace_imports(text))
    return f"const {file.stem}_module = (() => {{\n{body}\nreturn {{ {names} }};\n}})();\n"


def replace_imports(text: str) -> str:
    """Return a module's text with its imports from modules that are objects, without comments and indentation."""
    return IMPORT.sub(r"const \1 = \2_module;", COMMENT.sub("", text))


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
            self.texts.append(base64.b64encode(zlib.compress(data, 6)).decode())
        return self._indices[data]


__all__ = ["PackedArrays", "chart_script", "embed_json", "read_static"]
