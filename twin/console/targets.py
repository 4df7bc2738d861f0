"""Score of an operator at reaching targets: which were reached, when, and the length of the path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from nicegui import run as nicegui_run
from nicegui import ui

from twin.console.verdicts import warning_rows
from twin.live import RefusedError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from twin.console.animation import Pictures
    from twin.console.page import PageContext
    from twin.live import Catalog, LiveSession

PERIOD = 0.5  # of the score [s]
STILL = 0.1  # part of the tolerance: a smaller distance from the start is no motion


@dataclass(frozen=True)
class Score:
    """Targets reached so far with their times, the length of the path, and the time until the last target or until now.

    Times count from the first motion [s], 0 before it; `path` is in the unit of the signal.
    """

    reached: Mapping[str, float]
    path: float = 0.0
    duration: float = 0.0


def score(time: NDArray[np.float64], values: NDArray[np.float64], targets: Mapping[str, Any]) -> Score:
    """Score rows of the signal of `targets`: `time` of shape (rows,) [s], `values` of shape (rows, ...)."""
    rows = values.reshape(len(time), -1)
    moved = np.flatnonzero(np.linalg.norm(rows - rows[:1], axis=1) > STILL * targets["tolerance"])
    if not len(moved):
        return Score({})
    first = moved[0]
    reached = {}
    for name, point in targets["points"].items():
        hits = np.flatnonzero(np.linalg.norm(rows[first:] - point, axis=1) <= targets["tolerance"])
        if len(hits):
            reached[name] = float(time[first + hits[0]] - time[first])
    is_complete = len(reached) == len(targets["points"])
    end = max(reached.values()) if is_complete else float(time[-1] - time[first])
    path = rows[time <= time[first] + end]
    return Score(
        dict(sorted(reached.items(), key=lambda entry: entry[1])),
        float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()),
        end,
    )


def text(now: Score, targets: Mapping[str, Any], factor: float, unit: str, label: str = "") -> str:
    """Return a score in words, the length of the path, forth and back, in the display unit. `label`: of what reaches them."""
    names = list(targets["points"])
    left = [name for name in names if name not in now.reached]
    figures = f"{now.duration:.1f} s, path length {factor * now.path:.0f} {unit}"
    owner = f"{label[0].upper()}{label[1:]}: " if label else ""
    if not left:
        return f"{owner}{'all' if owner else 'All'} {len(names)} targets reached in {figures}"
    state = f"{owner}{len(now.reached)} of {len(names)} targets, next: {left[0]}"
    return f"{state}; {figures}" if now.duration else state


def session_score(live: LiveSession) -> Score | None:
    """Return the score of a session so far; None without rows."""
    assert live.catalog is not None
    targets = live.catalog.targets
    try:
        rows = live.read([targets["signal"]])
    except RefusedError:
        return None
    return score(rows.time, np.asarray(rows.values[targets["signal"]], np.float64), targets) if len(rows.time) else None


def session_text(now: Score, catalog: Catalog) -> str:
    """Return a score of a session in words."""
    targets = catalog.targets
    signal = catalog.signals[targets["signal"].partition("[")[0]]
    points = [point for scene in catalog.scenes for point in scene["points"]]
    point_label = next((point["label"] for point in points if point["signal"] == targets["signal"]), "")
    return text(now, targets, signal.factor, signal.display_unit, point_label)


def panel(context: PageContext, picture: Pictures) -> None:
    """Create the line with the score above the picture, in which reached targets change their color; warnings count too."""
    live, catalog = context.console.live, context.console.catalog
    assert live is not None
    assert catalog is not None
    with ui.element("div").classes("twin-score").props("role=status"):
        label = ui.label(session_text(Score({}), catalog)).mark("score")

    async def update() -> None:
        if live is not context.console.live or (now := await nicegui_run.io_bound(session_score, live)) is None:
            return
        rows = await nicegui_run.io_bound(warning_rows, live) or []
        warned = [f"{row.name} {row.detail.replace(';', ',')}" for row in rows if row.verdict == "fail"]
        label.text = "; ".join([session_text(now, catalog), *warned])
        label.classes(add="twin-bad" if warned else "", remove="" if warned else "twin-bad")
        picture.show_reached(list(now.reached))

    ui.timer(PERIOD, update)
