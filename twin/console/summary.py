"""Requirements of the scenario while a session runs, and the summary at its end with a link to its signals."""

from __future__ import annotations

import asyncio
import html
import json
import math
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nicegui import run as nicegui_run
from nicegui import ui

from twin.console import operator_panel, targets
from twin.console.verdicts import METRIC, NOT_JUDGED, WAITING, Row, SessionVerdicts, headline, is_changed, warning_rows
from twin.errors import TwinError
from twin.live import OVER
from twin.results import common_format, count_not_judged, count_verdicts, requirements_text
from twin.run import Score, session_verdict

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from fastapi import FastAPI
    from starlette.requests import Request
    from starlette.responses import Response

    from twin.console.page import PageContext
    from twin.console.session import Host, RunMetrics
    from twin.live import Catalog, LiveSession

JUDGE_PERIOD = 1.0  # [s]; a pause of ten times the duration of a judgment follows it: joysticks need the server
PAGE, REPORT = "signals.html", "report.html"
WRITING = "The replay is being written. It opens here by itself, after some seconds."
DIGITS = 4  # of the largest number in a row of metrics
ROWS_DELAY = 0.1  # after the last step, its row is written [s]
HEADLINE_METRICS = 3  # of the card at the end
SYMBOLS = {
    "pass": ("check_circle", "twin-good"),
    "fail": ("cancel", "twin-bad"),
    WAITING: ("schedule", "twin-soft"),
    NOT_JUDGED: ("remove_circle_outline", "twin-soft"),
    METRIC: ("straighten", "twin-soft"),
}


def register(app: FastAPI, console: Host) -> None:
    """Serve the latest session in the viewer, as the page that `twin view FOLDER --output` writes."""
    from starlette.responses import FileResponse, HTMLResponse, PlainTextResponse

    def folder(request: Request) -> str:
        if "before" in request.query_params:
            return console.before.folder
        live = console.live
        return live.state.folder if live is not None and live.state.phase in OVER else ""

    async def page(request: Request) -> Response:
        if not (name := folder(request)):
            return PlainTextResponse("The session is not over yet.", 404)
        if "wait" not in request.query_params and not (Path(name) / PAGE).is_file():
            return HTMLResponse(f'<meta http-equiv="refresh" content="0; url=?{request.query_params}&wait=1">{WRITING}')
        file, problem = await asyncio.to_thread(view_page, Path(name))
        return PlainTextResponse(problem, 500) if problem else FileResponse(file)

    async def report(request: Request) -> Response:
        name = folder(request)
        file = Path(name) / REPORT
        return FileResponse(file) if name and file.is_file() else PlainTextResponse("There is no report yet.", 404)

    app.add_route("/signals", page, methods=["GET"])
    app.add_route("/report", report, methods=["GET"])


def view_page(folder: Path) -> tuple[Path, str]:
    """Write the viewer's page of a run unless it exists; return it and why it could not be written, or nothing."""
    target = folder / PAGE
    if target.is_file():
        return target, ""
    words = ["-c", "from twin.cli import main; main()", "view", str(folder), "--output", str(target)]
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False)
    return target, done.stderr if done.returncode else ""


def panel(context: PageContext, failed: ui.label) -> None:
    """Create the list of requirements and metrics; it is judged once a second on the rows so far. `failed`: see `judged`."""
    console, live, path = context.console, context.console.live, context.console.scenario
    assert live is not None
    assert path is not None
    try:
        verdicts = SessionVerdicts(path, live)
    except TwinError:  # the file has changed since the session began
        return
    if not verdicts.expectations and not verdicts.metrics:
        return
    context.verdicts = verdicts
    fill_list = partial(judged, console, verdicts, failed)
    operator_panel.section("Requirements and metrics", fill_list, not verdicts.catalog.controls, lazy=False)


def judged(console: Host, verdicts: SessionVerdicts, failed: ui.label) -> None:
    """Create the rows of the list and a timer that judges them; `failed` names requirements that are not met."""
    shown: list[Any] = [None]
    paused_until, judged_at_end = [0.0], [False]
    live, before = verdicts.live, console.metrics_before((id(verdicts.live), verdicts.live.state.epoch))
    is_started = live.state.phase in (*OVER, "finishing") or live.state.time > verdicts.catalog.start
    total = ui.label("Judging ..." if is_started else "Run to judge them.").classes("twin-h").mark("headline")
    column = ui.column().classes("full-width gap-1")

    async def judge() -> None:
        begin, is_at_end = time.monotonic(), console.has_ended
        is_waiting = begin < paused_until[0] and is_at_end == judged_at_end[0]  # at the end as soon as the card
        if live.state.epoch == 0 or verdicts.live is not console.live or is_waiting:
            return
        if is_at_end != judged_at_end[0]:
            await asyncio.sleep(ROWS_DELAY)
        judged_at_end[0] = is_at_end
        rows = await nicegui_run.io_bound(verdicts.rows)
        paused_until[0] = begin + max(JUDGE_PERIOD, 11 * (time.monotonic() - begin))
        is_open = any(row.verdict == WAITING for row in rows or ())
        has_ended = live.state.phase in OVER or (live.state.time >= verdicts.catalog.judged_until and not is_open)
        is_over, is_scored = live.state.phase in OVER, bool(verdicts.catalog.targets)
        score = await nicegui_run.io_bound(targets.session_score, live) if is_over and is_scored else None
        is_in_score = is_scored and not is_over  # warnings are in its line; at the end all is listed, as in the report
        end = math.inf if score is None else score.end
        warnings = () if is_in_score else await nicegui_run.io_bound(warning_rows, live, end) or ()
        counted = [not_reached(row) if is_over else row for row in rows or ()]
        counted += [targets.target_row(score, verdicts.catalog)] if score is not None else []
        counted += [named_warning(row, is_over or has_ended) for row in warnings]
        is_shown = verdicts.live is console.live and not total.is_deleted  # else the page was built anew meanwhile
        if (counted, has_ended, is_over) == shown[0] or not rows or not is_shown:
            return
        shown[0] = (counted, has_ended, is_over)
        words = report_words(read_summary(live)) if is_over else ""
        total.text = words or headline([*counted[: len(rows)], *shown_warnings(warnings)], has_ended)
        names = [row.name for row in rows if row.verdict == "fail" and not row.is_metric]
        failed.text, failed.visible = f"Not met: {'; '.join(names)}", bool(names)
        values = {row.name: row.value for row in rows if row.value is not None}
        title = console.source.title if console.source is not None else ""
        console.latest_metrics = replace(console.latest_metrics, values=values, title=title, folder=live.state.folder)
        column.clear()
        with column:
            metric_table([row for row in counted if row.is_metric], before)
            run_before(before)
            for row in counted:
                if not row.is_metric:
                    listed(row, row.detail)

    ui.timer(0.2, judge)


def not_reached(row: Row) -> Row:
    """Return a row of a session that is over: what was still to come was not reached."""
    is_open = row.verdict == WAITING or (row.is_metric and row.metric is not None and row.value is None)
    verdict = NOT_JUDGED if row.verdict == WAITING else row.verdict
    return replace(row, verdict=verdict, detail="not reached") if is_open else row


def shown_warnings(rows: Iterable[Row]) -> list[Row]:
    """Return the warnings that were shown: these count as requirements that are not met."""
    return [row for row in rows if row.verdict == "fail"]


def named_warning(row: Row, is_final: bool = True) -> Row:
    """Return the row of a warning with a name that says whether it was shown; not yet passed unless `is_final`."""
    verdict = WAITING if row.verdict == "pass" and not is_final else row.verdict
    name = f"{'Warning' if row.verdict == 'fail' or row.is_warned else 'No warning'}: {row.name}"
    return replace(row, verdict=verdict, name=name)


def metric_table(rows: list[Row], before: RunMetrics, instant: str = "now") -> None:
    """Create a table of metrics: at an instant, in the run before, and their reference; each row in one unit with equal decimals."""
    columns = [instant, "before", "reference"]
    texts = [(row, metric_texts(row, before.values.get(row.name) if row.is_final else None)) for row in rows]
    shown = [k for k in range(3) if k == 0 or any(cells[k] for _, cells in texts)]
    if not rows:
        return
    lines = ["<thead><tr><th></th>" + "".join(f"<th>{columns[k]}</th>" for k in shown) + "</tr></thead>"]
    for row, cells in texts:
        unit = f" [{row.metric.unit}]" if row.metric is not None and row.metric.unit else ""
        color = {"pass": "twin-good", "fail": "twin-bad"}.get(row.verdict, "")
        sign = {"pass": "\N{CHECK MARK} ", "fail": "\N{BALLOT X} "}.get(row.verdict, "")
        numbers = [
            f'<td class="{color if k == 0 else "twin-soft"}">{sign * (k == 0)}{html.escape(cells[k])}</td>'
            for k in shown
        ]
        short = row.name.partition(";")[0].partition(" (")[0] + unit
        lines.append(f"<tr><td title='{html.escape(row.name)}'>{html.escape(short)}</td>{''.join(numbers)}</tr>")
    ui.html(f'<table class="twin-metrics">{"".join(lines)}</table>', sanitize=False).classes("full-width")


def run_before(before: RunMetrics) -> None:
    """Create the line that names the run before, with links to its results."""
    if before.title:
        with ui.row().classes("gap-2"):
            ui.label(f"before: {before.title}").classes("twin-soft twin-line")
            if before.folder:
                ui.link("report of the run before", "/report?before", new_tab=True)
                ui.link("its replay", "/signals?before", new_tab=True)


def metric_texts(row: Row, before: float | None) -> list[str]:
    """Return the present value of a metric, that of the run before and the reference, in one unit with equal decimals."""
    if row.metric is None or row.value is None:
        return [row.detail, "", ""]
    values = [row.value, before, row.reference]
    given = [value for value in values if value is not None]
    style = common_format(given, row.metric.unit, row.metric.is_difference)
    if style.decimals is None and 0.0 < (largest := max(map(abs, given))) < 1.0:  # smaller than in other tables
        style = replace(style, decimals=DIGITS - 1 - math.floor(math.log10(largest)))
    return ["" if value is None else style.number(value) for value in values]


def listed(row: Row, detail: str) -> None:
    """Create a row of the list with the symbol of its verdict."""
    icon, color = ("warning", "twin-warn") if row.is_warned else SYMBOLS.get(row.verdict, SYMBOLS[WAITING])
    with ui.row().classes("no-wrap full-width gap-2 twin-verdict"):
        ui.icon(icon).classes(color).props(f"role=img aria-label='{row.verdict or 'metric'}'")
        with ui.column().classes("gap-0"):
            ui.label(row.name).classes("twin-line")
            ui.label(detail).classes("twin-soft twin-line")


@dataclass(frozen=True)
class SessionResult:
    """Result of a session that is over: passed, failed, targets left or ended early; its score in words; requirements (targets first) and metrics; warnings.

    `score` counts requirements where there are no targets. `early`: why it ended before its end, or nothing. `badge`: of the report, or nothing.
    """

    kind: str = ""
    score: str = ""
    requirements: tuple[Row, ...] = ()
    warnings: tuple[Row, ...] = ()
    early: str = ""
    badge: str = ""


def read_summary(live: LiveSession) -> dict[str, Any]:
    """Return the summary in the folder of a session that is over; empty if there is none."""
    file = Path(live.state.folder) / "summary.json"
    summary = json.loads(file.read_text(encoding="utf-8")) if live.state.folder and file.is_file() else {}
    return dict(summary)


def report_words(summary: Mapping[str, Any]) -> str:
    """Return the result of all requirements in the words of the report; empty without a summary."""
    if "expectations" not in summary:
        return ""
    return requirements_text(*count_verdicts(summary), *count_not_judged(summary))


def session_result(live: LiveSession, verdicts: SessionVerdicts | None) -> SessionResult:
    """Return the result of a session: that of its folder, or that of the rows so far where no folder was written."""
    words, is_complete, end, rows = "", True, math.inf, list[Row]()
    if live.catalog is not None and live.catalog.targets:
        score = targets.session_score(live) or Score({})
        words = targets.session_text(score, live.catalog, True)
        rows = [targets.target_row(score, live.catalog)]
        is_complete, end = len(score.reached) == len(live.catalog.targets["points"]), score.end
    judged = verdicts.rows(math.inf if live.state.phase in OVER else end) if verdicts is not None else []
    rows += judged
    warnings = warning_rows(live, end, live.state.phase in OVER)  # the card at the last target stays as it is
    summary = read_summary(live)
    early = str(summary["reason"]) if summary.get("status") == "interrupted" else ""
    is_open = bool(early) or any(row.verdict == WAITING and not row.is_metric for row in rows)
    operation = summary.get("operation", {})
    kind = operation.get("verdict") or session_verdict(
        [row.verdict for row in (*judged, *warnings)], is_complete, not is_open
    )
    words = operation.get("targets", {}).get("detail", words)
    words = words or report_words(summary) or headline([*rows, *shown_warnings(warnings)], True)
    is_nominal = live.catalog is None or not is_changed(live, live.catalog.judged_until)
    badge = "" if summary.get("paper_applies", is_nominal) else "not at the paper's settings"
    return SessionResult(kind, words, tuple(rows), tuple(warnings), early, badge)


def result_card(result: SessionResult, before: RunMetrics, instant: str = "at the end") -> None:
    """Create the card: verdict, score, the most important metrics, requirements that are not met, warnings."""
    with ui.element("details").props("open").classes("twin-result").mark("result"):
        with ui.element("summary"), ui.row().classes("items-center gap-2"):
            color = {"failed": "twin-bad", "passed": "" if result.badge else "twin-good"}.get(result.kind)
            ui.label((result.kind or NOT_JUDGED).capitalize()).classes(f"twin-state {color or 'twin-warn'}")
            ui.label(result.score).classes("twin-h")
            if result.badge:
                ui.label(result.badge).classes("twin-state twin-warn")
        if result.early:
            ui.label(result.early)
        with ui.element("div").classes("twin-result-rows full-width"):
            for row in result.requirements:
                if row.is_targets or row.verdict == "fail":
                    problem = "Far from its reference: " if row.is_metric else "Not met: "
                    listed(replace(row, name=problem * (not row.is_targets) + row.name), row.detail)
            for row in map(named_warning, result.warnings):
                if row.verdict == "fail" or row.is_warned:
                    listed(row, row.detail)
        metrics = [row for row in result.requirements if row.value is not None]
        compared = [row for row in metrics if row.reference is not None]
        metric_table((compared or metrics)[:HEADLINE_METRICS], before, instant)


def banner(context: PageContext) -> None:
    """Create the summary below the bar, at the end of the scenario or session, and when the last target is reached.

    It moves what is below it, so that it waits until no control is held.
    """
    live, catalog = context.console.live, context.console.catalog
    assert live is not None
    assert catalog is not None
    over = ui.row().classes("twin-over items-center")
    shown = [""]

    async def update() -> None:
        state = live.state
        if live is not context.console.live or over.is_deleted:  # another session: the page is built anew
            return
        reached = context.console.has_ended and state.phase not in OVER
        score, goes_on = context.score, state.phase in ("running", "paused")
        complete = goes_on and score is not None and len(score.reached) == len(catalog.targets["points"])
        if complete and state.held and shown[0] != "targets":
            return
        kind = state.phase if state.phase in OVER else "reached" if reached else "targets" if complete else ""
        over.visible = bool(kind)
        over.props(f"data-kind={kind}")
        if kind == shown[0]:
            return
        shown[0] = kind
        over.clear()
        with over:
            card = ui.element("div").classes("twin-result-card")
            card.visible = False
            with ui.element("div").classes("twin-next"):
                if kind:
                    fill(context, live, catalog, kind)
        if kind:
            await asyncio.sleep(ROWS_DELAY if kind == "reached" else 0.0)
            result = await nicegui_run.io_bound(session_result, live, context.verdicts)
            if result is not None and (result.kind or result.requirements) and shown[0] == kind and not over.is_deleted:
                card.visible = True
                with card:
                    passes = kind not in OVER and result.kind != "failed"
                    before = context.console.metrics_before((id(live), state.epoch))
                    instant = f"at the last target, {score.end:.1f} s" if kind == "targets" and score else "at the end"
                    result_card(replace(result, kind="passed") if passes else result, before, instant)

    over.visible = False
    ui.timer(0.2, update)


def fill(context: PageContext, live: LiveSession, catalog: Catalog, kind: str) -> None:
    """Fill the summary: what has ended, and what can be done next."""
    console, state = context.console, live.state
    texts = {
        "stopped": f"{'Completed' if 0.0 < catalog.stop <= state.time else 'Ended'} at {state.time:g} s.",
        "failed": f"Failed: {state.message}",
        "reached": f"The scenario has reached its end, {state.time:g} s. Run continues beyond it.",
    }
    if kind in texts:  # the targets are in the card
        ui.label(texts[kind]).classes("twin-h")

    def button(text: str, action: Callable[..., Any], *arguments: Any, is_next: bool = False) -> None:
        async def press_once() -> None:
            made.disable()  # a second click of a double click would reach the next session
            if not await context.run(action, *arguments) and not made.is_deleted:
                made.enable()

        look = "unelevated color=primary" if is_next else "outline"
        made = ui.button(text, on_click=press_once).props(f"dense no-caps {look}")

    again = "again" if catalog.controls else "again: change and compare"
    following = dict(pairwise(catalog.variants)) if not catalog.controls and console.hardware is None else {}
    if kind not in OVER:
        button("End: replay and report", console.stop, is_next=True)
    elif state.folder:
        pages = {"report": "/report"} if (Path(state.folder) / REPORT).is_file() else {}
        for text, address in (pages | {"replay and signals": "/signals"}).items():
            ui.button(text).props(f"dense no-caps unelevated color=primary href={address} target=_blank")
    button(again, *((console.restart, console.variant) if kind in OVER else (console.reset,)))
    if variant := following.get(catalog.variant):
        button(f"again with {variant}", console.restart, variant)
    if kind in OVER:
        if live.changed_values:
            button("again with nominal values", console.restart, console.variant, True)
        button("another scenario", console.leave)
        if state.folder:
            ui.label(f"Results: {state.folder}").classes("twin-soft twin-line")
    run_before(console.metrics_before((id(live), state.epoch)))
