"""Still pictures of scenes by matplotlib, which is imported on first use."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import printable
from twin.results import figure_files, plotting, write_text

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from twin.scene.frames import Frames, Vectors

WIDTH = 9.4  # [inch]
MAX_HEIGHT = 7.0  # of a picture [inch]
WALL_COLOR, MOVING_WALL_COLOR = "#52606d", "#e7a3a9"
MIN_LINE_WIDTH, MAX_LEGEND_LINE_WIDTH = 1.0, 4.0  # of a line, and of one in a legend [pt]
DPI = 150
EDGE, FOOT, HEAD, MIN_WIDTH = 0.65, 0.75, 0.55, 5.0  # margins left of, below and above panels; of a picture [inch]


def panel_size(frames: Frames, width: float, max_height: float = MAX_HEIGHT) -> tuple[float, float]:
    """Return width and height of a panel that shows the entire scene [inch]."""
    left, bottom, right, top = frames.bounds
    ratio = (top - bottom) / (right - left)
    return min(width, max_height / ratio), min(width * ratio, max_height)


def prepare_axis(axis: Any, frames: Frames) -> None:
    """Set equal scales in millimeters, with room for all instants."""
    left, bottom, right, top = (edge * 1e3 for edge in frames.bounds)
    axis.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", xlabel="x [mm]", ylabel="y [mm]")


def points_per_mm(axis: Any) -> float:
    """Return the size of a millimeter of the scene on paper [pt]."""
    (x0, _), (x1, _) = axis.transData.transform([(0.0, 0.0), (1.0, 0.0)])
    return float(x1 - x0) * 72.0 / float(axis.figure.dpi)


def draw_walls(axis: Any, frames: Frames, instant: int, moving: tuple[bool, ...] = (False, True)) -> None:
    """Draw walls, solid ones filled: fixed ones, moving ones, or all."""
    scale = points_per_mm(axis)
    for wall, outline in (entry for entry in frames.walls(instant) if bool(entry[0].moves) in moving):
        x, y = outline.T * 1e3
        color = MOVING_WALL_COLOR if wall.moves else WALL_COLOR
        line_width = max(wall.thickness * 1e3 * scale, MIN_LINE_WIDTH)
        if wall.closed:
            axis.fill(x, y, color=color, alpha=0.5, linewidth=0, zorder=2)
        axis.plot(x, y, color=color, linewidth=line_width, solid_capstyle="round", solid_joinstyle="round", zorder=2)


def draw_instant(axis: Any, frames: Frames, instant: int) -> None:
    """Draw one instant without its walls."""
    scale = points_per_mm(axis)
    if frames.environment is not None and not frames.lines:
        x, y = frames.environment.path.T * 1e3
        axis.plot(x, y, color=plotting.COLORS[0], linewidth=1.0, linestyle=(0, (6, 4)), zorder=3, label="path")
    for number, line in enumerate(frames.lines):
        x, y = line.points[instant].T * 1e3
        line_width = max(line.width * 1e3 * scale, MIN_LINE_WIDTH)
        axis.plot(
            x,
            y,
            color=plotting.COLORS[number],
            linewidth=line_width,
            solid_capstyle="round",
            label=line.label,
            zorder=4,
        )
    for number, mark in enumerate(frames.points):
        x, y = mark.points[instant].T * 1e3
        color = plotting.COLORS[(number + 3) % len(plotting.COLORS)]
        axis.plot(x, y, "o", color=color, markersize=5, markerfacecolor="none", label=mark.label, zorder=6)
    for vectors in frames.arrows:
        draw_arrows(axis, frames, vectors, instant)


def draw_arrows(axis: Any, frames: Frames, arrows: Vectors, instant: int) -> None:
    """Draw vectors at one instant, in the same scale at all instants."""
    longest = arrows.longest
    if not longest:
        return
    length = frames.arrow * 1e3 / longest  # [mm] for one unit
    x, y = arrows.at[instant].T * 1e3
    dx, dy = arrows.vectors[instant].T * length
    is_finite = np.isfinite(x + y + dx + dy)
    axis.quiver(
        x[is_finite],
        y[is_finite],
        dx[is_finite],
        dy[is_finite],
        color=plotting.COLORS[frames.arrow_color],
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.004,
        zorder=7,
        label=f"{arrows.label}, longest {longest:.3g} {arrows.unit}",
    )


def render_images(frames: Frames, dpi: int) -> Iterator[Any]:
    """Render every instant as an RGB array; fixed walls are drawn once."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = scene_figure(frames)
    figure.set_dpi(dpi)
    axis = figure.axes[0]
    for artist in (*axis.lines, *axis.patches, *axis.collections):
        artist.remove()
    canvas = FigureCanvasAgg(figure)
    with mpl.rc_context(plotting.STYLE):
        axis.set_title("")
        draw_walls(axis, frames, 0, (False,))
        canvas.draw()
        background = canvas.copy_from_bbox(figure.bbox)
        fixed = set(axis.get_children())
        for instant, time in enumerate(frames.time):
            canvas.restore_region(background)
            draw_walls(axis, frames, instant, (True,))
            draw_instant(axis, frames, instant)
            axis.set_title(f"{printable(frames.title)}, {time:.2f} s")
            moving = [artist for artist in axis.get_children() if artist not in fixed]
            for artist in sorted(moving, key=lambda artist: artist.get_zorder()):
                axis.draw_artist(artist)
                artist.remove()
            axis.draw_artist(axis._left_title)
            yield np.asarray(canvas.buffer_rgba())[..., :3]


def scene_figure(frames: Frames, title: str = "", instants: int = 1, at: float | None = None) -> Any:
    """Draw a scene at evenly spaced instants from the first to the last: side by side if it is tall, else below each other.

    `at` [s]: draw the instant nearest to this time instead.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    left, bottom, right, top = frames.bounds
    columns = instants if top - bottom > right - left else 1
    rows = instants // columns
    panel_width, panel_height = panel_size(frames, (WIDTH - EDGE * columns) / columns)
    width, height = max((panel_width + EDGE) * columns, MIN_WIDTH), (panel_height + FOOT) * rows + HEAD
    last = len(frames.time) - 1
    with mpl.rc_context(plotting.STYLE):
        figure: Any = Figure((width, height), dpi=DPI)
        shown = np.rint(np.linspace(0, last, instants)).astype(int)
        for number, instant in enumerate(shown if at is None else [np.argmin(np.abs(np.asarray(frames.time) - at))]):
            row, column = divmod(number, columns)
            corner = (
                (EDGE + (panel_width + EDGE) * column) / width,
                1.0 - (HEAD + (panel_height + FOOT) * row + panel_height) / height,
            )
            axis = figure.add_axes((*corner, panel_width / width * 0.98, panel_height / height))
            prepare_axis(axis, frames)
            draw_walls(axis, frames, int(instant))
            draw_instant(axis, frames, int(instant))
            axis.set_title(", ".join(filter(None, [title, f"{frames.time[instant]:g} s" if last else ""])))
        handles, labels = figure.axes[0].get_legend_handles_labels()
        legend = figure.legend(handles, labels, loc="upper left", ncols=max(len(labels), 1), bbox_to_anchor=(0.02, 1.0))
        for line in legend.get_lines():
            line.set_linewidth(min(line.get_linewidth(), MAX_LEGEND_LINE_WIDTH))
    return figure


def figure_svg(figure: Any, salt: str) -> str:
    """Convert a figure to an SVG element, reproducible to the byte."""
    import matplotlib as mpl

    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": salt}):
        return figure_files.figure_to_svg(figure)


def save_figure(figure: Any, target: Path) -> None:
    """Write a figure as SVG or PNG."""
    import matplotlib as mpl

    if target.suffix == ".svg":
        write_text(target, figure_svg(figure, target.stem))
        return
    with mpl.rc_context(plotting.STYLE):
        figure_files.save_figure(figure, target, metadata={"Software": None})
