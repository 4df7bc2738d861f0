"""Score of an operator at reaching targets: which were reached, when, and the length of the path."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from nicegui import run as nicegui_run
from nicegui import ui

from twin.console.verdicts import warning_rows
from twin.errors import TwinError
from twin.run import Score, first_motion, point_label, score, score_text

if TYPE_CHECKING:
    from twin.console.animation import Pictures
    from twin.console.page import PageContext
    from twin.live import Catalog, LiveSession

PERIOD = 0.5  # of the score [s]


def session_score(live: LiveSession) -> Score | None:
    """Return the score of a session so far; None without rows."""
    assert live.catalog is not None
    targets, controls = live.catalog.targets, live.catalog.controls
    try:
        rows = live.read([targets["signal"], *(control.input for control in controls)])
    except TwinError:  # of a folder that is finished there may be no recording
        return None
    if not len(rows.time):
        return None
    begin = first_motion(rows.time, [(rows.values[control.input], control.rest) for control in controls])
    return score(rows.time, np.asarray(rows.values[targets["signal"]], np.float64), targets, begin)


def session_text(now: Score, catalog: Catalog) -> str:
    """Return a score of a session in words."""
    targets = catalog.targets
    signal = catalog.signals[targets["signal"].partition("[")[0]]
    label = point_label(catalog.scenes, targets["signal"])
    return score_text(now, targets, signal.factor, signal.display_unit, label)


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
        rows = await nicegui_run.io_bound(warning_rows, live, now.end) or []
        warned = [f"{row.name} {row.detail.replace(';', ',')}" for row in rows if row.verdict == "fail"]
        label.text = "; ".join([session_text(now, catalog), *warned])
        label.classes(add="twin-bad" if warned else "", remove="" if warned else "twin-bad")
        picture.show_reached(list(now.reached))

    ui.timer(PERIOD, update)
