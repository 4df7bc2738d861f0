"""Metrics and requirements of a run as a DataFrame that prints all of its columns."""

from __future__ import annotations

import re
from html import escape
from shutil import get_terminal_size
from typing import Any

import pandas as pd

MAX_ROWS = 60  # that are printed; of more, the first and the last
LEFT = 'style="text-align: left"'  # notebooks align cells right
TEXT_CELL = re.compile(r"<td>(?=[^<\d-])(?!(?:nan|inf)</td>)")
SHORTEST = 24  # letters of a text of which a table without room shows the beginning


class MetricTable(pd.DataFrame):  # type: ignore[misc]  # pandas has no types here
    """DataFrame of metrics or requirements, printed with every column, four digits and without row numbers; else as any DataFrame."""

    @property
    def _constructor(self) -> type[MetricTable]:
        return MetricTable

    @property
    def _print_options(self) -> dict[str, Any]:
        is_named = self.index.nlevels > 1 or self.index.name is not None or self.index.dtype.kind != "i"
        return {"index": is_named, "float_format": "{:.4g}".format, "na_rep": "-", "max_rows": MAX_ROWS}

    def __repr__(self) -> str:
        text = str(self.to_string(**self._print_options))
        width = get_terminal_size().columns
        if len(text.partition("\n")[0]) <= width:
            return text
        letters = max(width // 2 - 7, SHORTEST)  # of a name and of its detail
        return str(self.to_string(**self._print_options, max_colwidth=letters))

    def _repr_html_(self) -> str:
        with pd.option_context("display.max_colwidth", None):
            html = str(self.to_html(**self._print_options, border=0))
        for name in self.select_dtypes(exclude=["number", "bool"]).columns:
            html = html.replace(f"<th>{escape(str(name))}</th>", f"<th {LEFT}>{escape(str(name))}</th>")
        return TEXT_CELL.sub(f"<td {LEFT}>", html)
