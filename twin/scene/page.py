"""A scene as one HTML file that plays it: no server, nothing loaded, numbers packed as 16 bits."""

from __future__ import annotations

import base64
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.results import plotting

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from twin.scene.frames import Frames

MOST_INSTANTS = 1500  # of curves: as many as there are pixels
MOST_NUMBERS = 200_000  # of what moves in one case: half a megabyte, and 25 instants a second of a run of 22 s
NOTHING = 65535  # what stands for what is not a number


def packed(values: NDArray[Any]) -> dict[str, Any]:
    """Numbers as whole steps from the smallest one, two bytes each: at most a part in 131,000 of their range is lost."""
    array = np.asarray(values, float).reshape(len(values), -1)
    there = np.isfinite(array)
    low, high = (float(edge(array[there])) for edge in (np.min, np.max)) if there.any() else (0.0, 0.0)
    step = (high - low) / (NOTHING - 1) or 1.0
    codes = np.where(there, np.rint((np.where(there, array, low) - low) / step), NOTHING).astype("<u2")
    return {
        "low": rounded(low), "step": step, "count": array.shape[1], "data": base64.b64encode(codes.tobytes()).decode()
    }  # fmt: skip


def rounded(values: Any) -> Any:
    """Numbers with ten digits."""
    if isinstance(values, np.ndarray):
        return [rounded(one) for one in values.tolist()]
    return [rounded(one) for one in values] if isinstance(values, list) else float(f"{values:.10g}")


def film(frames: Frames) -> dict[str, Any]:
    """What the page needs of one case; lengths in millimeters."""
    moving = [one.points for one in (*frames.lines, *frames.points)]
    moving += [array for one in frames.arrows for array in (one.at, one.vectors)]
    numbers = sum(one[0].size for one in moving) or 1
    shown, sampled = frames.thinned(max(min(MOST_NUMBERS // numbers, MOST_INSTANTS), 2)), frames.thinned(MOST_INSTANTS)
    environment = frames.environment
    walls = [
        {"closed": wall.closed, "thickness": wall.thickness * 1e3, "moves": wall.moves, "name": wall.name,
         "direction": rounded(wall.direction), "points": rounded(wall.points.ravel() * 1e3)}
        for wall in (environment.walls if environment else ())
    ]  # fmt: skip
    colors = plotting.COLORS
    return {
        "bounds": rounded(np.array(frames.bounds) * 1e3),
        "walls": walls,
        "path": rounded(environment.path.ravel() * 1e3) if environment else [],
        "time": packed(shown.time),
        "lines": [
            {"label": one.label, "width": one.width * 1e3, "color": colors[i % len(colors)], **packed(one.points * 1e3)}
            for i, one in enumerate(shown.lines)
        ],
        "points": [
            {"label": one.label, "color": colors[(i + 3) % len(colors)], **packed(one.points * 1e3)}
            for i, one in enumerate(shown.points)
        ],
        "arrows": [
            {"label": one.label, "unit": one.unit, "longest": one.longest, "color": colors[1],
             "at": packed(one.at * 1e3), **packed(one.vectors)}
            for one in shown.arrows if one.longest
        ],
        "motions": {name: packed(far * 1e3) for name, far in (shown.motions or {}).items()},
        "curves": [
            {"label": label, "color": colors[(i + 4) % len(colors)], **packed(values)}
            for i, (label, values) in enumerate(sampled.curves)
        ],
        "when": packed(sampled.time),
        "arrow": frames.arrow * 1e3,
        "unit": frames.unit,
    }  # fmt: skip


def html(title: str, films: Mapping[str, Frames], note: str = "") -> str:
    """The page as text; `films`: by what one chooses them."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("twin.scene", ""), autoescape=True, trim_blocks=True, lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    script = environment.loader.get_source(environment, "player.js")[0] if environment.loader else ""
    data = json.dumps(
        [{"name": name, **film(one)} for name, one in films.items()], separators=(",", ":"), allow_nan=False
    )
    # what closes a script, or begins a comment in one, never stands in the data
    safe = data.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
    return environment.get_template("page.html").render(
        title=title, note=note, names=list(films), data=safe, script=script
    )
