"""Score of an operator at reaching targets: which were reached, when, and the length of the path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from nicegui import run as nicegui_run
from nicegui import ui

from twin.console.operator_panel import HELD, RELEASED, condense
from twin.console.verdicts import warning_rows
from twin.live import RefusedError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from twin.console.animation import Pictures
    from twin.console.page import PageContext
    from twin.live import Catalog, LiveSession

PERIOD = 0.5  # of the score [s]


@dataclass(frozen=True)
class Score:
    """Targets reached so far with their times, the length of the path, and the time until the last target or until now.

    Times count from the first command [s], 0 before it; `path` is in the unit of the signal.
    """

    reached: Mapping[str, float]
    path: float = 0.0
    duration: float = 0.0


def score(
    time: NDArray[np.float64], values: NDArray[np.float64], targets: Mapping[str, Any], begin: float | None
) -> Score:
    """Score rows of the signal of `targets`: `time` of shape (rows,) [s], `values` of shape (rows, ...), from `begin` [s]."""
    if begin is None or not len(time) or time[-1] <= begin:
        return Score({})
    is_scored = time >= begin
    time, rows = time[is_scored], values.reshape(len(time), -1)[is_scored]
    reached = {}
    for name, point in targets["points"].items():
        hits = np.flatnonzero(np.linalg.norm(rows - point, axis=1) <= targets["tolerance"])
        if len(hits):
            reached[name] = float(time[hits[0]] - begin)
    is_complete = len(reached) == len(targets["points"])
    end = max(reached.values()) if is_complete else float(time[-1] - begin)
    path = rows[time <= begin + end]
    return Score(
        dict(sorted(reached.items(), key=lambda entry: entry[1])),
        float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()),
        end,
    )


def first_command(live: LiveSession) -> float | None:
    """Return the time at which an input with a control first moves, by the operator or the scenario [s]; None before it.

    What was released at the same instant, while the session was paused, does not count. Without controls: the start.
    """
    assert live.catalog is not None
    controls = {control.input: control for control in live.catalog.controls}
    if not controls:
        return live.catalog.start
    done = condense(live.done, controls)
    for index, command in enumerate(done):
        label, is_held, _ = command.text.partition(HELD)
        following = (later.time for later in done[index + 1 :] if later.text.startswith(f"{label}{RELEASED}"))
        if is_held and next(following, math.inf) > command.time:
            return command.time
    return None


def text(now: Score, targets: Mapping[str, Any], factor: float, unit: str, label: str = "") -> str:
    """Return a score in words, the length of the path, forth and back, in the display unit. `label`: of what reaches them."""
    names = list(targets["points"])
    left = [name for name in names if name not in now.reached]
    figures = f"{now.duration:.1f} s, path length {factor * now.path:.0f} {unit}"
    owner = f"{label[0].upper()}{label[1:]}: " if label else ""
    if not left:
        return f"{owner}{'all' if owner else 'All'} {len(names)} targets reached in {figures}"
    state = f"{owner}{len(now.reached)} of {len(names)} targets, next: {left[0]}"
    return f"{state}; {figures if now.duration else 'time starts with your first command'}"


def session_score(live: LiveSession) -> Score | None:
    """Return the score of a session so far; None without rows."""
    assert live.catalog is not None
    targets = live.catalog.targets
    try:
        rows = live.read([targets["signal"]])
    except RefusedError:
        return None
    if not len(rows.time):
        return None
    return score(rows.time, np.asarray(rows.values[targets["signal"]], np.float64), targets, first_command(live))


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
        context.score = now
        rows = await nicegui_run.io_bound(warning_rows, live) or []
        warned = [f"{row.name} {row.detail.replace(';', ',')}" for row in rows if row.verdict == "fail"]
        label.text = "; ".join([session_text(now, catalog), *warned])
        label.classes(add="twin-bad" if warned else "", remove="" if warned else "twin-bad")
        picture.show_reached(list(now.reached))

    ui.timer(PERIOD, update)
