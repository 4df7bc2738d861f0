"""Animation of a scene: GIF, MP4 and animated SVG."""

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

MAX_FRAMES = {".gif": 750, ".svg": 1500, ".mp4": 9000}  # limits of memory and of viewers
DPI = 110
FFMPEG_MISSING = "MP4 needs ffmpeg, which is not here. Run `pip install imageio-ffmpeg`, or use .gif, .svg or .html."

STYLE = """
.wall { stroke: #52606d; fill: none } .pad { stroke: #d98a92; fill: none } .solid { fill: #52606d; fill-opacity: .45 }
.pad.solid { fill: #d98a92 } text { font: 4px sans-serif; fill: #3e4c59 } .paper { fill: #fff }
path, polyline, line, circle { stroke-linecap: round; stroke-linejoin: round; fill: none }
@media (prefers-color-scheme: dark) { .paper { fill: #1f2933 } text { fill: #cbd2d9 } .wall { stroke: #9aa5b1 } }
"""


def resample_frames(frames: Frames, rate: float, speed: float, kind: str) -> Frames:
    """Resample to `rate` frames a second at `speed` times real time; `kind`: suffix of the file."""
    if len(frames.time) < 2:
        raise SceneError(f"{frames.title}: is a still picture. Export it as .svg, .png or .html.")
    count = (frames.time[-1] - frames.time[0]) / (speed / rate)
    if count > (max_frames := MAX_FRAMES[kind]):
        raise SceneError(
            f"{frames.title}: {count:.0f} frames are more than the {max_frames} of a {kind}."
            f" Use --speed {speed * count / max_frames:.1g} or more, a lower --rate, or `from` and `to` of the scene."
        )
    return frames.resample(speed / rate)


def write_movie(frames: Frames, target: Path, rate: float, speed: float, progress: Progress) -> None:
    """Write a GIF by Pillow or an MP4 by ffmpeg; `progress` receives the completed fraction."""
    resampled = resample_frames(frames, rate, speed, target.suffix)
    writer = write_mp4 if target.suffix == ".mp4" else write_gif
    temporary = target.with_name(f".{os.getpid()}{target.suffix}")  # its suffix determines the format

    def with_progress() -> Iterator[NDArray[Any]]:
        for count, image in enumerate(picture.render_images(resampled, DPI), 1):
            yield image
            progress(count / len(resampled.time))

    try:
        writer(with_progress(), temporary, rate)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def write_gif(images: Iterator[NDArray[Any]], target: Path, rate: float) -> None:
    """Write images as a looping GIF; its durations are multiples of 10 ms."""
    from PIL import Image

    quantized = (
        Image.fromarray(image).quantize(255, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE) for image in images
    )
    first = next(quantized)
    first.save(target, save_all=True, append_images=quantized, duration=round(100.0 / rate) * 10, loop=0)


def write_mp4(images: Iterator[NDArray[Any]], target: Path, rate: float) -> None:
    """Write images as H.264, which requires even sizes."""
    try:
        import imageio_ffmpeg  # type: ignore[import-not-found]
    except ImportError:
        raise SceneError(FFMPEG_MISSING) from None
    first = next(images)
    height, width = (size - size % 2 for size in first.shape[:2])
    film = imageio_ffmpeg.write_frames(str(target), (width, height), fps=rate, macro_block_size=2)
    try:
        film.send(None)
        for image in chain([first], images):
            film.send(np.ascontiguousarray(image[:height, :width]))
    finally:
        film.close()


def animated_svg(frames: Frames, rate: float, speed: float) -> str:
    """Return a scene as an animated SVG (SMIL, SVG 1.1 chapter 19); lengths in millimeters, y inverted."""
    resampled = resample_frames(frames, rate, speed, ".svg")
    left, bottom, right, top = (1e3 * edge for edge in resampled.bounds)
    length = len(resampled.time) / rate
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{left:.2f} {-top:.2f} {right - left:.2f} {top - bottom:.2f}">',
        f"<title>{escape(resampled.title)}</title><style>{STYLE}</style>",
        f'<rect class="paper" x="{left:.2f}" y="{-top:.2f}" width="{right - left:.2f}" height="{top - bottom:.2f}"/>',
        *wall_elements(resampled, length),
    ]
    for i, line in enumerate(resampled.lines):
        values = [format_points(points) for points in line.points]
        attributes = f'stroke="{line_color(i)}" stroke-width="{max(line.width * 1e3, 0.6):.2f}"'
        parts.append(
            f'<polyline {attributes} points="{values[0]}">{animate_attribute("points", values, length)}</polyline>'
        )
    for i, mark in enumerate(resampled.points):
        for k in range(mark.points.shape[1]):
            parts.append(point_element(mark.points[:, k], line_color(i + 3), length))
    for arrows in resampled.arrows:
        parts += arrow_elements(resampled, arrows, length)
    tracks: list[Track | Vectors] = [*resampled.lines, *resampled.points, *resampled.arrows]
    name = escape(", ".join(track.label for track in tracks))
    parts.append(f'<text x="{left + 2:.2f}" y="{-bottom - 2:.2f}">{name}, {speed:g} times real time</text></svg>')
    return "\n".join(parts) + "\n"


def line_color(number: int) -> str:
    """Return the color of the report's lines with this number."""
    return plotting.COLORS[number % len(plotting.COLORS)]


def format_points(points: NDArray[Any]) -> str:
    """Format points of a polyline; NaN is omitted."""
    finite_points = points[np.isfinite(points).all(axis=-1)] * (1e3, -1e3)
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in finite_points.tolist())


def animate_attribute(name: str, values: list[str], length: float) -> str:
    """Animate an attribute stepwise; empty if it is constant."""
    if len(set(values)) == 1:
        return ""
    return (
        f'<animate attributeName="{name}" dur="{length:.3f}s" repeatCount="indefinite" calcMode="discrete"'
        f' values="{";".join(values)}"/>'
    )


def wall_elements(frames: Frames, length: float) -> list[str]:
    """Return elements of the walls, moving ones with their motion."""
    elements = []
    for wall in frames.environment.walls if frames.environment else ():
        kind = ("pad" if wall.moves else "wall") + (" solid" if wall.closed else "")
        displacements = (frames.motions or {}).get(wall.moves)
        move = ""
        if displacements is not None and np.ptp(displacements):
            steps = displacements[:, None] * wall.direction * (1e3, -1e3) + 0.0  # no -0
            values = ";".join(f"{x:.2f},{y:.2f}" for x, y in steps.tolist())
            move = (
                f'<animateTransform attributeName="transform" type="translate" dur="{length:.3f}s"'
                f' repeatCount="indefinite" calcMode="discrete" values="{values}"/>'
            )
        line_width = max(wall.thickness * 1e3, 0.4)
        elements.append(
            f'<path class="{kind}" stroke-width="{line_width:.2f}" d="M{format_points(wall.outline)}">{move}</path>'
        )
    return elements


def point_element(points: NDArray[Any], stroke_color: str, length: float) -> str:
    """Return a marker that follows points (t, 2), invisible where they are NaN."""
    is_finite = np.isfinite(points).all(axis=1)
    coordinates = np.where(is_finite[:, None], points, 0.0) * (1e3, -1e3)
    x, y = ([f"{value:.2f}" for value in column] for column in coordinates.T.tolist())
    opacity = ["1" if value else "0" for value in is_finite]
    animations = "".join(
        animate_attribute(name, values, length) for name, values in (("cx", x), ("cy", y), ("opacity", opacity))
    )
    start = f'cx="{x[0]}" cy="{y[0]}" opacity="{opacity[0]}"'
    return f'<circle {start} r="2" stroke="{stroke_color}" stroke-width=".7">{animations}</circle>'


def arrow_elements(frames: Frames, arrows: Vectors, length: float) -> list[str]:
    """Return vectors as arrows, each one polyline."""
    if not arrows.longest:
        return []
    unit = frames.arrow / arrows.longest
    elements = []
    for k in range(arrows.at.shape[1]):
        values = [
            arrow_points(at, at + vector * unit)
            for at, vector in zip(arrows.at[:, k], arrows.vectors[:, k], strict=True)
        ]
        if any(values):
            elements.append(
                f'<polyline stroke="{line_color(frames.arrow_color)}" stroke-width=".8" points="{values[0]}">'
                f"{animate_attribute('points', values, length)}</polyline>"
            )
    return elements


def arrow_points(start: NDArray[Any], end: NDArray[Any]) -> str:
    """Return an arrow from start to end as one polyline; empty if it is NaN."""
    if not np.isfinite([start, end]).all():
        return ""
    back = (start - end) * min(0.3, 4e-3 / max(float(np.hypot(*(end - start))), 1e-9))
    side = np.array([-back[1], back[0]]) * 0.5
    return format_points(np.array([start, end, end + back + side, end, end + back - side]))
