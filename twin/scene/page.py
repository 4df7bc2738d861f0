"""Scene as one self-contained HTML page that plays it; numbers are packed as 16 bits."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.web import chart_script, embed_json, page_templates, read_static

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from twin.scene.environment import Wall
    from twin.scene.frames import Frames

MAX_CURVE_INSTANTS = 1500  # of curves: about one per pixel
MAX_VALUES = 200_000  # moving coordinates of one case: half a megabyte, or 25 instants a second of a run of 22 s
NAN_CODE = 65535  # code of NaN
HERE = Path(__file__).parent
PLAYER = (HERE / "film.js", HERE / "player.js")  # modules, in the order of their imports
COLORS = 8  # of lines: `--line-0` to `--line-7` of the style


def pack_values(values: NDArray[Any]) -> dict[str, Any]:
    """Quantize numbers to 16 bits, two bytes each: the error is at most 1/131,000 of their range."""
    array = np.asarray(values, float).reshape(len(values), -1)
    is_finite = np.isfinite(array)
    low, high = (float(edge(array[is_finite])) for edge in (np.min, np.max)) if is_finite.any() else (0.0, 0.0)
    step = (high - low) / (NAN_CODE - 1) or 1.0
    codes = np.where(is_finite, np.rint((np.where(is_finite, array, low) - low) / step), NAN_CODE).astype("<u2")
    return {
        "low": round_values(low),
        "step": step,
        "count": array.shape[1],
        "data": base64.b64encode(codes.tobytes()).decode(),
    }


def round_values(values: Any) -> Any:
    """Round numbers to ten digits."""
    if isinstance(values, np.ndarray):
        return [round_values(value) for value in values.tolist()]
    return [round_values(value) for value in values] if isinstance(values, list) else float(f"{values:.10g}")


def film_data(frames: Frames, max_values: int = MAX_VALUES, times: Sequence[float] = ()) -> dict[str, Any]:
    """Return the page's data of one case with at most so many moving coordinates; lengths in millimeters.

    `times` [s]: the instants nearest to these are shown, too.
    """
    moving = [track.points for track in (*frames.lines, *frames.points)]
    moving += [array for track in frames.arrows for array in (track.at, track.vectors)]
    numbers = sum(track[0].size for track in moving) or 1
    shown, sampled = (
        frames.thin(max(min(max_values // numbers, MAX_CURVE_INSTANTS), 2), times),
        frames.thin(MAX_CURVE_INSTANTS),
    )
    environment = frames.environment
    return {
        "bounds": round_values(np.array(frames.bounds) * 1e3),
        "walls": [wall_data(wall) for wall in (environment.walls if environment else ())],
        "path": round_values(environment.path.ravel() * 1e3) if environment else [],
        "time": round_values(np.asarray(shown.time)),
        "lines": [
            {
                "label": track.label,
                "width": track.width * 1e3,
                "color": i % COLORS,
                **pack_values(track.points * 1e3),
            }
            for i, track in enumerate(shown.lines)
        ],
        "points": [
            {"label": track.label, "color": (i + 3) % COLORS, **pack_values(track.points * 1e3)}
            for i, track in enumerate(shown.points)
        ],
        "arrows": [
            {
                "label": track.label,
                "unit": track.unit,
                "longest": track.longest,
                "color": shown.arrow_color,
                "at": pack_values(track.at * 1e3),
                **pack_values(track.vectors),
            }
            for track in shown.arrows
            if track.longest
        ],
        "motions": {name: pack_values(displacements * 1e3) for name, displacements in (shown.motions or {}).items()},
        "curves": [
            {"label": label, "color": (i + 4) % COLORS, **pack_values(values)}
            for i, (label, values) in enumerate(sampled.curves)
        ],
        "when": pack_values(sampled.time),
        "arrow": frames.arrow * 1e3,
        "unit": frames.unit,
    }


def wall_data(wall: Wall) -> dict[str, Any]:
    """Return the page's data of a wall; lengths in millimeters."""
    return {
        "closed": wall.closed,
        "thickness": wall.thickness * 1e3,
        "moves": wall.moves,
        "name": wall.name,
        "direction": round_values(wall.direction),
        "points": round_values(wall.points.ravel() * 1e3),
    }


def player_style() -> str:
    """Return the style sheet of players."""
    return (HERE / "player.css").read_text(encoding="utf-8")


def page_html(title: str, films: Mapping[str, Frames], note: str = "") -> str:
    """Render the page; `films`: frames by the title of their option in the page."""
    return (
        page_templates("twin.scene")
        .get_template("page.html")
        .render(
            title=title,
            note=note,
            names=list(films),
            data=embed_json([{"name": name, **film_data(frames)} for name, frames in films.items()]),
            style=read_static("style.css") + player_style(),
            dark=read_static("dark.js"),
            script=chart_script([*PLAYER, HERE / "page.js"]),
        )
    )
