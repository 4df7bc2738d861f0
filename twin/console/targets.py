"""Score of an operator at reaching targets: which were reached, when, and the length of the path."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from nicegui import run as nicegui_run
from nicegui import ui

from twin.console.verdicts import Row, warning_rows
from twin.errors import TwinError
from twin.live import OVER
from twin.run import Score, first_motion, point_label, reached_text, score, score_text, tip_signals

if TYPE_CHECKING:
    from twin.console.animation import Pictures
    from twin.console.page import PageContext
    from twin.live import Catalog, LiveSession

PERIOD = 0.5  # of the score [s]


def session_score(live: LiveSession) -> Score | None:
    """Return the score of a session so far; None without rows."""
    assert live.catalog is not None
    targets = live.catalog.targets
    recorded = {name for name, signal in live.catalog.signals.items() if signal.recorded}
    tips = tip_signals(live.catalog.scenes, targets, recorded)
    try:
        path = targets.get("path", targets["signal"])
        rows = live.read(list(dict.fromkeys([*tips, path])))
    except TwinError:  # of a folder that is finished there may be no recording
        return None
    if not len(rows.time):
        return None
    begin = first_motion(rows.time, [rows.values[name] for name in tips], targets["tolerance"])
    values, travel = (np.asarray(rows.values[name], np.float64) for name in (targets["signal"], path))
    return score(rows.time, values, targets, begin, travel)


def session_text(now: Score, catalog: Catalog, has_ended: bool = False) -> str:
    """Return a score of a session in words."""
    targets = catalog.targets
    signal = catalog.signals[targets.get("path", targets["signal"]).partition("[")[0]]
    label = point_label(catalog.scenes, targets["signal"])
    return score_text(now, targets, signal.factor, signal.display_unit, label, has_ended)


def target_row(now: Score, catalog: Catalog) -> Row:
    """Return which targets were not reached, or that all were, and when each was."""
    names = list(catalog.targets["points"])
    left = [name for name in names if name not in now.reached]
    times = reached_text(now.reached)
    if not left:
        return Row("pass", f"All {len(names)} targets reached", times, is_targets=True)
    return Row("fail", f"{len(left)} of {len(names)} targets not reached: {', '.join(left)}", times, is_targets=True)


def short_text(now: Score, catalog: Catalog) -> str:
    """Return a score of a session for a narrow page."""
    names, length = list(catalog.targets["points"]), session_text(now, catalog, True).rpartition(" path length ")[2]
    left = next((f", next: {name}" for name in names if name not in now.reached), "; scoring has ended")
    hint = "" if now.reached else catalog.targets.get("hint", "").partition(" (")[0]  # a telephone has no keys
    figures = f"{now.duration:.0f} s, {length}" if now.duration else ""
    return "; ".join(filter(None, [f"{len(now.reached)}/{len(names)} targets{left}", hint, figures]))


def panel(context: PageContext, picture: Pictures) -> None:
    """Create the line with the score above the picture, in which reached targets change their color.

    Warnings that were shown follow it; one that lasts has a row of its own, in red.
    """
    live, catalog = context.console.live, context.console.catalog
    assert live is not None
    assert catalog is not None
    with ui.element("div").classes("twin-score").props("role=status"):
        label = ui.label(session_text(Score({}), catalog)).classes("twin-wide").mark("score")
        short = ui.label(short_text(Score({}), catalog)).classes("twin-narrow")
        past = ui.label().classes("twin-soft").mark("past")

    async def update() -> None:
        if live is not context.console.live or (now := await nicegui_run.io_bound(session_score, live)) is None:
            return
        context.score = now
        rows = await nicegui_run.io_bound(warning_rows, live, now.end) or []
        shown = [row for row in rows if row.verdict == "fail" or row.is_warned]
        label.text = session_text(now, catalog, live.state.phase in OVER)
        past.text = "; ".join(f"{row.name} {row.detail.replace(';', ',')}" for row in shown)
        short.text = short_text(now, catalog)
        picture.show_reached(list(now.reached))

    ui.timer(PERIOD, update)
