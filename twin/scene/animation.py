"""A scene as a film: GIF, MP4, and an SVG that moves by itself."""

from __future__ import annotations

import os
from html import escape
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import SceneError
from twin.results import plotting
from twin.scene import picture

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from twin.scene.frames import Frames, Track, Vectors

    Progress = Callable[[float], None]

MOST_FRAMES = {".gif": 750, ".svg": 1500, ".mp4": 9000}  # what one opens, and what fits into memory
DPI = 110
VIDEO = "MP4 needs ffmpeg, which is not here. Run `pip install imageio-ffmpeg`, or use .gif, .svg or .html."

STYLE = """
.wall { stroke: #52606d; fill: none } .pad { stroke: #d98a92; fill: none } .solid { fill: #52606d; fill-opacity: .45 }
.pad.solid { fill: #d98a92 } text { font: 4px sans-serif; fill: #3e4c59 } .paper { fill: #fff }
path, polyline, line, circle { stroke-linecap: round; stroke-linejoin: round; fill: none }
@media (prefers-color-scheme: dark) { .paper { fill: #1f2933 } text { fill: #cbd2d9 } .wall { stroke: #9aa5b1 } }
"""


def sampled(frames: Frames, rate: float, speed: float, kind: str) -> Frames:
    """The instants of a film of `rate` frames a second that runs at `speed` times real time; `kind`: its suffix."""
    if len(frames.time) < 2:
        raise SceneError(f"{frames.title}: is a still picture. Export it as .svg, .png or .html.")
    count = (frames.time[-1] - frames.time[0]) / (speed / rate)
    if count > (most := MOST_FRAMES[kind]):
        raise SceneError(
            f"{frames.title}: {count:.0f} frames are more than the {most} of a {kind}."
            f" Use --speed {speed * count / most:.1g} or more, a lower --rate, or `from` and `to` of the scene."
        )
    return frames.every(speed / rate)


def movie(frames: Frames, target: Path, rate: float, speed: float, progress: Progress) -> None:
    """Write a GIF by Pillow or an MP4 by ffmpeg; `progress` is told how far it is."""
    shown = sampled(frames, rate, speed, target.suffix)
    writer = write_mp4 if target.suffix == ".mp4" else write_gif
    beside = target.with_name(f".{os.getpid()}{target.suffix}")  # the suffix tells writers what to write

    def watched() -> Iterator[NDArray[Any]]:
        for count, image in enumerate(picture.images(shown, DPI), 1):
            yield image
            progress(count / len(shown.time))

    try:
        writer(watched(), beside, rate)
        beside.replace(target)
    finally:
        beside.unlink(missing_ok=True)


def write_gif(images: Iterator[NDArray[Any]], target: Path, rate: float) -> None:
    """Write images as a GIF that begins again at its end; its clock counts hundredths of a second."""
    from PIL import Image

    quantized = (
        Image.fromarray(one).quantize(255, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE) for one in images
    )
    first = next(quantized)
    first.save(target, save_all=True, append_images=quantized, duration=round(100.0 / rate) * 10, loop=0)


def write_mp4(images: Iterator[NDArray[Any]], target: Path, rate: float) -> None:
    """Write images as H.264, which any player knows; it wants even sizes."""
    try:
        import imageio_ffmpeg  # type: ignore[import-not-found]
    except ImportError:
        raise SceneError(VIDEO) from None
    first = next(images)
    height, width = (size - size % 2 for size in first.shape[:2])
    film = imageio_ffmpeg.write_frames(str(target), (width, height), fps=rate, macro_block_size=2)
    try:
        film.send(None)
        for image in chain([first], images):
            film.send(np.ascontiguousarray(image[:height, :width]))
    finally:
        film.close()


def moving_svg(frames: Frames, rate: float, speed: float) -> str:
    """A scene as an SVG that plays in any browser (SMIL, SVG 1.1 chapter 19); lengths in millimeters, y turned."""
    shown = sampled(frames, rate, speed, ".svg")
    left, bottom, right, top = (1e3 * edge for edge in shown.bounds)
    length = len(shown.time) / rate
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{left:.2f} {-top:.2f} {right - left:.2f} {top - bottom:.2f}">',
        f"<title>{escape(shown.title)}</title><style>{STYLE}</style>",
        f'<rect class="paper" x="{left:.2f}" y="{-top:.2f}" width="{right - left:.2f}" height="{top - bottom:.2f}"/>',
        *walls(shown, length),
    ]
    for i, line in enumerate(shown.lines):
        values = [row(points) for points in line.points]
        look = f'stroke="{color(i)}" stroke-width="{max(line.width * 1e3, 0.6):.2f}"'
        parts.append(f'<polyline {look} points="{values[0]}">{animated("points", values, length)}</polyline>')
    for i, mark in enumerate(shown.points):
        for k in range(mark.points.shape[1]):
            parts.append(circle(mark.points[:, k], color(i + 3), length))
    for arrows in shown.arrows:
        parts += arrow_lines(shown, arrows, length)
    tracks: list[Track | Vectors] = [*shown.lines, *shown.points, *shown.arrows]
    name = escape(", ".join(one.label for one in tracks))
    parts.append(f'<text x="{left + 2:.2f}" y="{-bottom - 2:.2f}">{name}, {speed:g} times real time</text></svg>')
    return "\n".join(parts) + "\n"


def color(number: int) -> str:
    """The color of the report's lines with this number."""
    return plotting.COLORS[number % len(plotting.COLORS)]


def row(points: NDArray[Any]) -> str:
    """Points of a polyline, those that are not there left out."""
    there = points[np.isfinite(points).all(axis=-1)] * (1e3, -1e3)
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in there.tolist())


def animated(name: str, values: list[str], length: float) -> str:
    """An attribute over time, each value until the next one; nothing for what stays."""
    if len(set(values)) == 1:
        return ""
    return (
        f'<animate attributeName="{name}" dur="{length:.3f}s" repeatCount="indefinite" calcMode="discrete"'
        f' values="{";".join(values)}"/>'
    )


def walls(frames: Frames, length: float) -> list[str]:
    """Walls, those that move carried by their motion."""
    found = []
    for wall in frames.environment.walls if frames.environment else ():
        kind = ("pad" if wall.moves else "wall") + (" solid" if wall.closed else "")
        far = (frames.motions or {}).get(wall.moves)
        move = ""
        if far is not None and np.ptp(far):
            steps = far[:, None] * wall.direction * (1e3, -1e3) + 0.0  # no -0
            values = ";".join(f"{x:.2f},{y:.2f}" for x, y in steps.tolist())
            move = (
                f'<animateTransform attributeName="transform" type="translate" dur="{length:.3f}s"'
                f' repeatCount="indefinite" calcMode="discrete" values="{values}"/>'
            )
        thick = max(wall.thickness * 1e3, 0.4)
        found.append(f'<path class="{kind}" stroke-width="{thick:.2f}" d="M{row(wall.outline)}">{move}</path>')
    return found


def circle(points: NDArray[Any], ink: str, length: float) -> str:
    """A mark that follows points (t, 2), unseen while they are not there."""
    there = np.isfinite(points).all(axis=1)
    places = np.where(there[:, None], points, 0.0) * (1e3, -1e3)
    x, y = ([f"{one:.2f}" for one in column] for column in places.T.tolist())
    seen = ["1" if one else "0" for one in there]
    moves = "".join(animated(name, values, length) for name, values in (("cx", x), ("cy", y), ("opacity", seen)))
    return (
        f'<circle cx="{x[0]}" cy="{y[0]}" opacity="{seen[0]}" r="2" stroke="{ink}" stroke-width=".7">{moves}</circle>'
    )


def arrow_lines(frames: Frames, arrows: Vectors, length: float) -> list[str]:
    """Vectors as arrows drawn in one stroke."""
    if not arrows.longest:
        return []
    unit = frames.arrow / arrows.longest
    found = []
    for k in range(arrows.at.shape[1]):
        values = [
            stroke(at, at + vector * unit) for at, vector in zip(arrows.at[:, k], arrows.vectors[:, k], strict=True)
        ]
        if any(values):
            found.append(
                f'<polyline stroke="{color(1)}" stroke-width=".8" points="{values[0]}">'
                f"{animated('points', values, length)}</polyline>"
            )
    return found


def stroke(start: NDArray[Any], end: NDArray[Any]) -> str:
    """An arrow from start to end as one polyline; nothing if it is not there."""
    if not np.isfinite([start, end]).all():
        return ""
    back = (start - end) * min(0.3, 4e-3 / max(float(np.hypot(*(end - start))), 1e-9))
    side = np.array([-back[1], back[0]]) * 0.5
    return row(np.array([start, end, end + back + side, end, end + back - side]))
