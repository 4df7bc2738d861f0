"""Figures of matplotlib as files: small, the same every time, whatever their texts hold."""

from __future__ import annotations

import io
import re
import warnings
from typing import Any

from twin.errors import printable

# In SVG, `<` and `"` stand for themselves nowhere but in tags: what is between tags is what people read.
TAG = re.compile(r"<[A-Za-z][^>]*>")
PLACES = re.compile(r'(?<=\s)(?:d|x|y|points)="[^"]*"')
DECIMAL = re.compile(r"-?\d+\.\d{3,}(?![\de])")


def as_svg(figure: Any) -> str:
    """A figure as an SVG element, small and the same every time."""
    text = io.StringIO()
    save(figure, text, format="svg", metadata={"Date": None, "Creator": None})
    svg = "\n".join(map(printable, text.getvalue().split("\n")))  # control characters are no XML
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg[svg.index("<svg") :], flags=re.DOTALL)
    return shortened(svg).replace("<svg ", '<svg role="img" ', 1)


def save(figure: Any, target: Any, **options: Any) -> None:
    """Save a figure whose texts come from files: fonts may lack their letters, which is not told."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from|Matplotlib currently does not support")
        figure.savefig(target, **options)


def shortened(svg: str) -> str:
    """The same with places to a hundredth of a point, which halves the file; text that people read stays as it is."""
    return TAG.sub(lambda tag: PLACES.sub(lambda places: DECIMAL.sub(rounded, places[0]), tag[0]), svg)


def rounded(number: re.Match[str]) -> str:
    """A decimal with at most two digits behind its point, the nearest one."""
    return f"{float(number[0]):.2f}".rstrip("0").rstrip(".")
