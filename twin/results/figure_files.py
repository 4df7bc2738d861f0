"""Figures of matplotlib as files: compact and reproducible to the byte, with any text."""

from __future__ import annotations

import io
import re
import warnings
from typing import Any

from twin.errors import printable

# In SVG, unescaped `<` and `"` occur in tags only; the text between tags is visible and must not change.
TAG = re.compile(r"<[A-Za-z][^>]*>")
COORDINATES = re.compile(r'(?<=\s)(?:d|x|y|points)="[^"]*"')
DECIMAL = re.compile(r"-?\d+\.\d{3,}(?![\de])")


def figure_to_svg(figure: Any) -> str:
    """Convert a figure to a compact, reproducible SVG element."""
    text = io.StringIO()
    save_figure(figure, text, format="svg", metadata={"Date": None, "Creator": None})
    svg = "\n".join(map(printable, text.getvalue().split("\n")))  # control characters are no XML
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg[svg.index("<svg") :], flags=re.DOTALL)
    return round_coordinates(svg).replace("<svg ", '<svg role="img" ', 1)


def save_figure(figure: Any, target: Any, **options: Any) -> None:
    """Save a figure; warnings of letters that the font lacks are ignored, since texts come from files."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from|Matplotlib currently does not support")
        figure.savefig(target, **options)


def round_coordinates(svg: str) -> str:
    """Round coordinates to a hundredth of a point, which halves the file; texts are unchanged."""
    return TAG.sub(
        lambda tag: COORDINATES.sub(lambda coordinates: DECIMAL.sub(round_decimal, coordinates[0]), tag[0]), svg
    )


def round_decimal(number: re.Match[str]) -> str:
    """Round a decimal to at most two digits."""
    return f"{float(number[0]):.2f}".rstrip("0").rstrip(".")
