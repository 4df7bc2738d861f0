"""Figures of matplotlib as files: compact and reproducible to the byte, with any text."""

from __future__ import annotations

import io
import re
import warnings
from typing import TYPE_CHECKING, Any

from twin.errors import printable

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

WIDTH = 9.4  # [inch]
STYLE: dict[str, Any] = {
    "font.family": ["sans-serif"],
    "font.sans-serif": ["Inter", "Helvetica Neue", "Arial", "DejaVu Sans"],
    "font.size": 9.5,
    "svg.fonttype": "none",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#9aa5b1",
    "axes.labelcolor": "#3e4c59",
    "axes.linewidth": 0.8,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlecolor": "#1f2933",
    "xtick.color": "#7b8794",
    "ytick.color": "#7b8794",
    "xtick.labelcolor": "#3e4c59",
    "ytick.labelcolor": "#3e4c59",
    "axes.grid": True,
    "grid.color": "#e4e7eb",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "lines.linewidth": 1.2,
    "path.simplify_threshold": 0.2,
    "text.parse_math": False,  # names and titles come from files, in which $ is literal
}

# In SVG, unescaped `<` and `"` occur in tags only; the text between tags is visible and must not change.
TAG = re.compile(r"<[A-Za-z][^>]*>")
COORDINATES = re.compile(r'(?<=\s)(?:d|x|y|points)="[^"]*"')
DECIMAL = re.compile(r"-?\d+\.\d{3,}(?![\de])")


def render_svg(
    size: tuple[float, float],
    salt: str,
    draw: Callable[[Any], None],
    style: Mapping[str, Any] | None = None,
    **grid: Any,
) -> str:
    """Draw a figure of a size [inch] as an SVG element; `draw` gets its axes as an array of rows and columns."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({**STYLE, **(style or {}), "svg.hashsalt": salt}):
        figure = Figure(size, layout="constrained")
        draw(figure.subplots(squeeze=False, **grid))
        return figure_to_svg(figure)


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
