"""The page of a session: header, bar and panels."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable
from functools import partial
from itertools import starmap
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nicegui import Client, ui
from nicegui import app as pages
from nicegui import run as nicegui_run

from twin import web
from twin.console import charts, operator_panel, safety, start_page, summary, targets, websocket
from twin.console.animation import FLAT, Pictures, to_si
from twin.console.curves import start_value, value_text
from twin.console.joysticks import Desk, Presence, controls
from twin.console.session import panels
from twin.errors import TwinError
from twin.live import OVER
from twin.scenario import scenario_paths

if TYPE_CHECKING:
    from fastapi import FastAPI

    from twin.console.session import Host, Panel
    from twin.console.verdicts import SessionVerdicts
    from twin.live import Catalog, LiveSession
    from twin.run import Score

STATIC = Path(__file__).parent / "static"
RATES = {
    0.1: "a tenth",
    0.2: "a fifth",
    0.5: "half",
    1.0: "real time",
    2.0: "2 times",
    5.0: "5 times",
    10.0: "10 times",
    math.inf: "fastest",
}
REFRESH_PERIOD = 0.2  # period of updates of a page [s]
TITLE = "Catheter twin"
STYLE_LINK = '<link rel="stylesheet" href="/web/views.css"><link rel="stylesheet" href="/console/console.css">'
NOT_OPERATED = (
    "This variant follows a script or a recording: controls may have no effect. "
    f"To operate, choose the variant “{scenario_paths.OPERATOR_VARIANT}”."
)


class PageContext:
    """A page in a browser: its client, its rights, its notifications."""

    def __init__(self, console: Host, client: Client) -> None:
        self.console, self.client = console, client
        self.shown_space = FLAT  # number of the shown picture, which outlasts a session
        self.verdicts: SessionVerdicts | None = None  # of the shown session
        self.score: Score | None = None  # of the shown session

    def is_operator(self) -> bool:
        """Return whether this page operates."""
        return self.console.operator_lock.is_operator(self.client.id)

    async def run(self, what: Callable[..., Any], *arguments: Any) -> bool:
        """Run a command if this page operates; return whether it was executed. The process of the loop checks it again."""
        if not self.is_operator():
            self.notify(self.console.operator_lock.watching)
            return False
        try:
            await nicegui_run.io_bound(what, *arguments)
        except TwinError as error:
            self.notify(str(error))
            return False
        return True

    def notify(self, text: str) -> None:
        """Show a message, e.g. why a command was refused."""
        if self.client.is_deleted:  # the page was closed meanwhile
            return
        with self.client:
            ui.notify(text, type="warning", position="top", timeout=6000, multi_line=True)

    def on_press(self, what: Callable[[], Callable[..., Any]], *arguments: Any) -> Callable[[], Awaitable[bool]]:
        """Return a callback for a button; `what` is evaluated when it is pressed."""

        async def pressed() -> bool:
            return await self.run(what(), *arguments)

        return pressed


def register(app: FastAPI, console: Host) -> None:
    """Add the pages and routes of a console."""
    pages.add_static_files("/console", STATIC, max_cache_age=0)
    web.frames.route(app, "/data", lambda _request: console.source)
    summary.register(app, console)
    websocket.register(app, console, lambda client: client in Client.instances)

    own_pages = [panel for panel in panels() if panel.path and (console.hardware is not None or not panel.hardware)]
    links = {"Session": "/", **{page.title: page.path for page in own_pages}} if own_pages else {}
    for panel in own_pages:
        _panel_page(console, panel, links)

    @ui.page("/")
    def page(client: Client) -> None:
        ui.add_head_html(STYLE_LINK)
        context = PageContext(console, client)
        ui.timer(REFRESH_PERIOD, lambda: build.refresh() if changed() else None)
        shown_stage: list[Any] = [None]

        def changed() -> bool:
            now = _stage(console)
            before, shown_stage[0] = shown_stage[0], now
            return bool(before is not None and now != before)

        @ui.refreshable
        def build() -> None:
            shown_stage[0] = _stage(console)
            stage = shown_stage[0][0]
            with ui.column().classes("full-width gap-0"):
                if stage == "pick":
                    start_page.pick(context)
                elif stage == "session":
                    _session(context)
                else:
                    start_page.starting(context)

        with web.page_frame(TITLE, links, "Session") as row, row:
            _top(context)
        build()


def _panel_page(console: Host, panel: Panel, links: dict[str, str]) -> None:
    """Add a page for a panel; its activity is created now, so that a wrong file is reported before the server starts."""
    if panel.activity is not None:
        console.activities[panel.title] = panel.activity(console)

    @ui.page(panel.path)
    def page(client: Client) -> None:
        ui.add_head_html(STYLE_LINK)
        context = PageContext(console, client)
        with web.page_frame(TITLE, links, panel.title) as row, row:
            _top(context, attends=True)
        with ui.element("div").classes("twin-own full-width"):
            panel.fill(console, context.is_operator)


def _stage(console: Host) -> tuple[Any, ...]:
    """Return the subject of the page, which is rebuilt when this changes."""
    live = console.live
    if live is None:
        return ("pick",)
    if live.catalog is None:
        return ("starting", id(live))
    return ("session", id(live), live.state.epoch)


def _top(context: PageContext, attends: bool = False) -> None:
    """Create the operator menu and the stop button, always visible."""
    console = context.console
    take = ui.button("operate here", on_click=lambda: console.operator_lock.acquire(context.client.id))
    take.props("unelevated dense no-caps color=primary").classes("twin-take")
    role = ui.button().props("flat dense no-caps").classes("twin-role")
    with role, ui.menu() as menu, ui.column().classes("p-2 gap-1") as others:
        pass
    Presence(
        context.client.id,
        attends=attends,
        hardware=console.hardware is not None,
        stop_label=console.stop_label,
    )

    def show() -> None:
        lock = console.operator_lock
        own = lock.pages.get(context.client.id, "")
        role_text = "you operate" if context.is_operator() else "no operator" if lock.operator is None else "you watch"
        role.text, take.visible = role_text, lock.operator is None and bool(own)
        role.classes(remove="twin-operates").classes("twin-operates" if context.is_operator() else "")
        others.clear()
        with others:
            ui.label(f"This is {own}." if own else "This page is not connected yet.").classes("twin-soft")
            for client, name in lock.pages.items():
                if context.is_operator() and client != context.client.id:
                    ui.button(f"hand over to {name}", on_click=lambda target=client: _transfer_control(target)).props(
                        "dense no-caps"
                    )
            if not context.is_operator() and lock.operator is not None:
                ui.label("The operator can hand over to this page.").classes("twin-soft")

    def _transfer_control(client: str) -> None:
        console.release_hold()
        if not console.operator_lock.hand_over(context.client.id, client):
            context.notify(console.operator_lock.watching)
        menu.close()

    console.operator_lock.changed.append(show)
    context.client.on_delete(lambda: console.operator_lock.changed.remove(show))
    show()


def _session(context: PageContext) -> None:
    """Create the page of a running session: bar, animation, panels."""
    console = context.console
    catalog = console.catalog
    assert catalog is not None
    assert console.live is not None
    context.verdicts = context.score = None
    added = [panel for panel in panels() if not panel.path and (catalog.hardware or not panel.hardware)]
    _bar(context)
    with ui.element("div").classes("twin-desk"):
        si_catalog, picture = to_si(catalog), None
        if (views := web.build_views(si_catalog)) or catalog.spaces:
            with ui.element("div").classes("twin-card twin-picture"):
                if catalog.targets:
                    score = ui.element("div")
                picture = Pictures(context, si_catalog, views)
                failed = alert(picture.head)
                if catalog.targets:
                    with score:
                        targets.panel(context, picture)
        with ui.element("div").classes("twin-hand"):
            with ui.element("div").classes("twin-card twin-controls") as card:
                if picture is None:
                    failed = alert(card)
                Desk(controls(catalog), session=True, space_runs=console.hardware is None)
                if (
                    catalog.controls
                    and catalog.variant != scenario_paths.OPERATOR_VARIANT
                    and scenario_paths.OPERATOR_VARIANT in catalog.variants
                ):
                    ui.label(NOT_OPERATED).classes("twin-state twin-warn")
                if catalog.hardware:
                    safety.panel(context)
            if catalog.controls:
                summary.banner(context)
            with ui.element("div").classes("twin-card twin-panels"):
                operator_panel.panel(context, lambda: summary.panel(context, failed))
        with ui.element("div").classes("twin-card twin-curves"):
            charts.panel(console)
        if added:
            with ui.element("div").classes("twin-card twin-curves"):
                for panel in added:
                    operator_panel.section(panel.title, partial(panel.fill, console, context.is_operator))


def alert(parent: ui.element) -> ui.label:
    """Create the label for requirements that are not met; its room is reserved, so that nothing moves under the pointer."""
    with parent, ui.element("div").classes("twin-alert"):
        label = ui.label().classes("twin-warning").props("role=alert")
    label.visible = False
    return label


def _bar(context: PageContext) -> None:
    """Create the bar with variant, run, pause, step, reset and rate; the desk's script shows the status."""
    console = context.console
    live, catalog = console.live, console.catalog
    assert live is not None
    assert catalog is not None
    with ui.row().classes("twin-bar items-center full-width"):
        run = ui.button("Run", icon="play_arrow", on_click=context.on_press(lambda: console.resume))
        run.props('unelevated no-caps color=primary aria-label="run"').classes("twin-run")
        keys = "" if console.hardware is not None else " (space bar)"
        run.props(f'title="Run{keys}"')
        pause = ui.button("Pause", icon="pause", on_click=context.on_press(lambda: live.pause))
        pause.props('outline no-caps aria-label="pause"').props(f'title="Pause{keys}"').classes("twin-run")
        finishing = ui.spinner(size="24px").props('aria-label="the results are written"').classes("twin-run")
        title = catalog.title.removesuffix(f": {catalog.variants.get(catalog.variant)}") or catalog.scenario
        ui.label(title).classes("twin-h ellipsis")
        if catalog.description:
            with ui.button(icon="info").props("flat round dense aria-label='about this scenario'"), ui.menu():
                ui.markdown(catalog.description).classes("twin-about")
        if len(catalog.variants) > 1 and console.hardware is None:
            variant: ui.select = ui.select(
                {name: f"{name}: {title}" if title != name else name for name, title in catalog.variants.items()},
                value=catalog.variant,
                on_change=lambda said: choose_variant(context, variant, said.value),
            )
            variant.props("dense options-dense outlined aria-label='variant'").classes("twin-variant")
        elif len(catalog.variants) > 1:  # a session with drives keeps the variant of the command line
            ui.label(f"{catalog.variant} (set by --variant)").classes("twin-soft ellipsis")
        steps = ui.row().classes("items-center no-wrap gap-0")
        if not catalog.wall_clock:
            with steps:
                _steps(context, live, catalog)
        ui.html('<span id="twin-how" class="twin-figures" role="status"></span>', sanitize=False).classes("twin-how")

    def update() -> None:
        goes = live.state.phase == "running"
        run.visible = live.state.phase in ("paused", "ended")
        if console.has_ended:  # the next step is in the summary
            run.props("outline", remove="unelevated")
        pause.visible = goes and not catalog.wall_clock
        steps.visible = live.state.phase not in (*OVER, "finishing")
        finishing.visible = live.state.phase in ("finishing", "starting")

    update()
    ui.timer(REFRESH_PERIOD, update)
    if not catalog.controls:  # else below the controls, which it must not move
        summary.banner(context)
    changes(context)
    ui.html('<span id="twin-message" role="status"></span>', sanitize=False)


async def choose_variant(context: PageContext, selection: ui.select, variant: str) -> None:
    """Load a variant; ask before a run is ended. The selection shows the loaded one until the other is loaded."""
    console, live, catalog = context.console, context.console.live, context.console.catalog
    if live is None or catalog is None or variant == catalog.variant:
        return
    selection.value = catalog.variant
    if live.state.phase not in ("running", "paused") or live.state.time <= catalog.start or console.has_ended:
        await context.run(console.restart, variant)
        return

    async def load() -> None:
        dialog.close()
        await context.run(console.restart, variant)

    with context.client, ui.dialog(value=True) as dialog, ui.card():
        ui.label(f"End this run and load {variant}? Its results so far are written.")  # it goes on meanwhile
        with ui.row():
            ui.button("end and load", on_click=load).props("no-caps unelevated color=primary")
            ui.button("cancel", on_click=dialog.close).props("no-caps outline")


def changes(context: PageContext) -> None:
    """Create the line that names values changed by hand, with their nominal values and a button that sets these."""
    live, catalog = context.console.live, context.console.catalog
    assert live is not None
    assert catalog is not None
    signals = catalog.signals

    def text(name: str, value: Any) -> str:
        signal = signals[name.partition("[")[0]]
        nominal = value_text(signal, start_value(name, signal)).removesuffix(f" {signal.display_unit}")
        return f"{name} {value_text(signal, value)} (nominal {nominal})"

    async def set_nominal() -> None:
        for name in live.changed_values:
            await context.run(live.set, name, start_value(name, signals[name.partition("[")[0]]))

    with ui.row().classes("twin-over twin-changes items-center") as row:
        label = ui.label().classes("twin-line")
        button = ui.button("nominal values", on_click=set_nominal).props("dense no-caps outline")

    def update() -> None:
        changed = live.changed_values
        row.visible = bool(changed)
        label.text = f"Changed by hand: {'; '.join(starmap(text, changed.items()))}" if changed else ""
        button.visible = row.visible and live.state.phase not in (*OVER, "finishing")

    update()
    ui.timer(0.3, update)


def _steps(context: PageContext, live: LiveSession, catalog: Catalog) -> None:
    """Create the buttons of single steps and reset, and the rate."""
    _button("skip_next", f"one step of {catalog.step * 1e3:g} ms", context.on_press(lambda: live.step))
    _button(
        "fast_forward",
        f"advance to the next sample of the slowest member ({catalog.common_step * 1e3:g} ms)",
        context.on_press(lambda: live.step_macro),
    )
    _button("restart_alt", "reset: from the start, in a new folder", context.on_press(lambda: context.console.reset))
    rates = {rate: text for rate, text in RATES.items() if rate <= catalog.fastest_rate}
    ui.select(
        rates,
        value=live.state.rate if live.state.rate in rates else 1.0,
        on_change=lambda said: context.run(live.pace, said.value),
    ).props("dense options-dense borderless aria-label='pace'").classes("twin-rate")


def _button(icon: str, about: str, pressed: Callable[[], Awaitable[bool]]) -> None:
    ui.button(icon=icon, on_click=pressed).props(f'flat round dense aria-label="{about.partition(":")[0]}"').classes(
        "twin-step"
    ).tooltip(about)
