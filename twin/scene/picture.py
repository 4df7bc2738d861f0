"""Scenes as still pictures by matplotlib, which is imported only when one is drawn."""

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
HIGHEST = 7.0  # of a picture [inch]
WALL, PAD = "#52606d", "#e7a3a9"
THINNEST, WIDEST = 1.0, 4.0  # of a line, and of one in a legend [pt]
DPI = 150
EDGE, FOOT, HEAD, NARROWEST = 0.65, 0.75, 0.55, 5.0  # beside, below and above panels; of a picture [inch]


def size_of(frames: Frames, width: float, highest: float = HIGHEST) -> tuple[float, float]:
    """Width and height of a panel that shows all [inch]."""
    left, bottom, right, top = frames.bounds
    ratio = (top - bottom) / (right - left)
    return min(width, highest / ratio), min(width * ratio, highest)


def prepare(axis: Any, frames: Frames) -> None:
    """Equal scales in millimeters and room for all instants."""
    left, bottom, right, top = (edge * 1e3 for edge in frames.bounds)
    axis.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", xlabel="x [mm]", ylabel="y [mm]")


def points_per_mm(axis: Any) -> float:
    """Size of a millimeter of the scene on paper [pt]."""
    (x0, _), (x1, _) = axis.transData.transform([(0.0, 0.0), (1.0, 0.0)])
    return float(x1 - x0) * 72.0 / float(axis.figure.dpi)


def paint_walls(axis: Any, frames: Frames, instant: int, moving: tuple[bool, ...] = (False, True)) -> None:
    """Walls, solid ones filled: those that stand, those that move, or all."""
    scale = points_per_mm(axis)
    for wall, outline in (one for one in frames.walls(instant) if bool(one[0].moves) in moving):
        x, y = outline.T * 1e3
        color = PAD if wall.moves else WALL
        thick = max(wall.thickness * 1e3 * scale, THINNEST)
        if wall.closed:
            axis.fill(x, y, color=color, alpha=0.5, linewidth=0, zorder=2)
        axis.plot(x, y, color=color, linewidth=thick, solid_capstyle="round", solid_joinstyle="round", zorder=2)


def paint(axis: Any, frames: Frames, instant: int) -> None:
    """Everything at one instant but walls."""
    scale = points_per_mm(axis)
    if frames.environment is not None and not frames.lines:
        x, y = frames.environment.path.T * 1e3
        axis.plot(x, y, color=plotting.COLORS[0], linewidth=1.0, linestyle=(0, (6, 4)), zorder=3, label="path")
    for number, line in enumerate(frames.lines):
        x, y = line.points[instant].T * 1e3
        wide = max(line.width * 1e3 * scale, THINNEST)
        axis.plot(
            x, y, color=plotting.COLORS[number], linewidth=wide, solid_capstyle="round", label=line.label, zorder=4
        )
    for number, mark in enumerate(frames.points):
        x, y = mark.points[instant].T * 1e3
        color = plotting.COLORS[(number + 3) % len(plotting.COLORS)]
        axis.plot(x, y, "o", color=color, markersize=5, markerfacecolor="none", label=mark.label, zorder=6)
    for vectors in frames.arrows:
        paint_arrows(axis, frames, vectors, instant)


def paint_arrows(axis: Any, frames: Frames, arrows: Vectors, instant: int) -> None:
    """Vectors at one instant, as long beside each other as at all other instants."""
    longest = arrows.longest
    if not longest:
        return
    length = frames.arrow * 1e3 / longest  # [mm] for one unit
    x, y = arrows.at[instant].T * 1e3
    dx, dy = arrows.vectors[instant].T * length
    there = np.isfinite(x + y + dx + dy)
    axis.quiver(
        x[there], y[there], dx[there], dy[there], color=plotting.COLORS[1], angles="xy", scale_units="xy", scale=1.0,
        width=0.004, zorder=7, label=f"{arrows.label}, longest {longest:.3g} {arrows.unit}",
    )  # fmt: skip


def images(frames: Frames, dpi: int) -> Iterator[Any]:
    """Every instant as an array of red, green and blue; what stands is drawn once."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    drawn = figure(frames)
    drawn.set_dpi(dpi)
    axis = drawn.axes[0]
    for artist in (*axis.lines, *axis.patches, *axis.collections):
        artist.remove()
    canvas = FigureCanvasAgg(drawn)
    with mpl.rc_context(plotting.STYLE):
        axis.set_title("")
        paint_walls(axis, frames, 0, (False,))
        canvas.draw()
        ground = canvas.copy_from_bbox(drawn.bbox)
        standing = set(axis.get_children())
        for instant, time in enumerate(frames.time):
            canvas.restore_region(ground)
            paint_walls(axis, frames, instant, (True,))
            paint(axis, frames, instant)
            axis.set_title(f"{printable(frames.title)}, {time:.2f} s")
            moving = [artist for artist in axis.get_children() if artist not in standing]
            for artist in sorted(moving, key=lambda one: one.get_zorder()):
                axis.draw_artist(artist)
                artist.remove()
            axis.draw_artist(axis._left_title)
            yield np.asarray(canvas.buffer_rgba())[..., :3]


def figure(frames: Frames, title: str = "", instants: int = 1) -> Any:
    """A scene at some instants, the first, the last and evenly between: beside each other if it is tall, else below."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    left, bottom, right, top = frames.bounds
    columns = instants if top - bottom > right - left else 1
    rows = instants // columns
    wide, high = size_of(frames, (WIDTH - EDGE * columns) / columns)
    width, height = max((wide + EDGE) * columns, NARROWEST), (high + FOOT) * rows + HEAD
    last = len(frames.time) - 1
    with mpl.rc_context(plotting.STYLE):
        drawn: Any = Figure((width, height), dpi=DPI)
        for number, instant in enumerate(np.rint(np.linspace(0, last, instants)).astype(int)):
            row, column = divmod(number, columns)
            corner = ((EDGE + (wide + EDGE) * column) / width, 1.0 - (HEAD + (high + FOOT) * row + high) / height)
            axis = drawn.add_axes((*corner, wide / width * 0.98, high / height))
            prepare(axis, frames)
            paint_walls(axis, frames, int(instant))
            paint(axis, frames, int(instant))
            axis.set_title(", ".join(filter(None, [title, f"{frames.time[instant]:g} s" if last else ""])))
        handles, labels = drawn.axes[0].get_legend_handles_labels()
        legend = drawn.legend(handles, labels, loc="upper left", ncols=max(len(labels), 1), bbox_to_anchor=(0.02, 1.0))
        for line in legend.get_lines():
            line.set_linewidth(min(line.get_linewidth(), WIDEST))
    return drawn


def as_svg(drawn: Any, salt: str) -> str:
    """A figure as an SVG element, the same to the byte every time."""
    import matplotlib as mpl

    with mpl.rc_context({**plotting.STYLE, "svg.hashsalt": salt}):
        return figure_files.as_svg(drawn)


def save(drawn: Any, target: Path) -> None:
    """Write a figure as SVG or PNG."""
    import matplotlib as mpl

    if target.suffix == ".svg":
        write_text(target, as_svg(drawn, target.stem))
        return
    with mpl.rc_context(plotting.STYLE):
        figure_files.save(drawn, target, metadata={"Software": None})
