"""Start page of a console: scenarios, recent ones first, and the progress of a starting session."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from nicegui import ui

from twin.scenario import scenario_paths

if TYPE_CHECKING:
    from twin.console.page import PageContext

MAX_RECENT = 4
TOPICS = scenario_paths.TOPICS
Group = tuple[str, "list[tuple[str, scenario_paths.Overview]]"]  # heading, scenarios by name


def recent_and_all(runs: Path) -> tuple[list[str], dict[str, Path]]:
    """Return the most recent scenarios, and all by name."""
    scenarios = scenario_paths.scenarios()
    ran = sorted(
        (path for path in runs.glob("*") if path.name in scenarios), key=lambda path: path.stat().st_mtime, reverse=True
    )
    return [path.name for path in ran[:MAX_RECENT]], scenarios


def pick(context: PageContext) -> None:
    """Create a card for each scenario."""
    recent, scenarios = recent_and_all(context.console.runs)
    groups = group_scenarios(recent, scenarios)
    with ui.column().classes("twin-home"):
        ui.label("Select a scenario").classes("text-h6")
        search = (
            ui.input(placeholder="search")
            .props("dense outlined clearable debounce=100 autofocus aria-label='search scenarios'")
            .classes("full-width")
        )

        @ui.refreshable
        def cards() -> None:
            selected = select_groups(groups, search.value or "")
            if not selected:
                ui.label(no_match(search.value)).classes("twin-soft").props("role=status")
            for heading, entries in selected:
                ui.label(heading).classes("twin-h")
                with ui.element("div").classes("twin-cards"):
                    for name, overview in entries:
                        _card(context, name, scenarios[name], overview)

        async def begin_single_match() -> None:
            matches = {name: each for _, entries in select_groups(groups, search.value or "") for name, each in entries}
            if len(matches) == 1:
                ((name, overview),) = matches.items()
                await context.run(context.console.begin, scenarios[name], overview.variant)

        search.on_value_change(cards.refresh)
        search.on("keydown.escape", lambda: search.set_value(""))
        search.on("keydown.enter", begin_single_match)
        cards()


def group_scenarios(recent: list[str], scenarios: dict[str, Path]) -> list[Group]:
    """Return the recent scenarios, those to begin with, then all by topic; others than those of `TOPICS` come last."""
    overviews = {name: scenario_paths.overview(path) for name, path in sorted(scenarios.items())}
    topics = {
        topic: heading for topic, heading in TOPICS.items() if any(each.topic == topic for each in overviews.values())
    }
    groups: list[Group] = [("Recent", [(name, overviews[name]) for name in recent])]
    groups.append(("Start here", [(name, overviews[name]) for name in scenario_paths.START_HERE if name in overviews]))
    for topic, heading in topics.items():
        groups.append((heading, [(name, each) for name, each in overviews.items() if each.topic == topic]))
    groups.append(("Others", [(name, each) for name, each in overviews.items() if each.topic not in topics]))
    return groups


def select_groups(groups: list[Group], search: str) -> list[Group]:
    """Return the groups with the scenarios whose name, title or heading contains all words; empty groups are left out."""
    words = search.casefold().split()
    selected = []
    for heading, entries in groups:
        shown = [
            (name, each)
            for name, each in entries
            if all(word in f"{name} {each.title} {heading}".casefold() for word in words)
        ]
        if shown:
            selected.append((heading, shown))
    return selected


def no_match(search: str) -> str:
    """Return what a search without a match may have meant: a study is run in the terminal."""
    studies = [name for name in scenario_paths.scenarios("study") if search.strip().casefold() in name.casefold()]
    study = f" {studies[0]} is a study: run `twin study {studies[0]}` in a terminal." if studies else ""
    return f"No scenario matches.{study}"


def shown_duration(overview: scenario_paths.Overview) -> str:
    """Return the simulated time of a session; with controls it lasts until the operator ends it."""
    return "until you end it" if overview.has_controls else overview.duration.replace(" ", "\N{NO-BREAK SPACE}")


def _card(context: PageContext, name: str, path: Path, overview: scenario_paths.Overview) -> None:
    duration = shown_duration(overview)
    with (
        ui.element("button")
        .classes("twin-card twin-pick")
        .on("click", context.on_press(lambda: context.console.begin, path, overview.variant))
    ):
        if overview.topic in TOPICS:
            ui.html(f'<img src="/console/topics/{overview.topic}.svg" alt="" loading="lazy">', sanitize=False)
        with ui.element("div"):
            with ui.row().classes("items-center gap-2"):
                ui.label(name).classes("twin-h")
                if overview.has_controls:
                    ui.badge("has controls").props("outline")
            ui.label(f"{overview.title}{f', {duration}' if duration else ''}").classes("twin-soft")


def starting(context: PageContext) -> None:
    """Show the progress of a starting session, or why it failed."""
    console = context.console
    with ui.column().classes("twin-home items-center"):
        busy = ui.spinner(size="32px")
        ui.label(console.scenario.stem if console.scenario else "").classes("text-h6")
        message = ui.label().classes("twin-soft")
        back = ui.button("another scenario", on_click=context.on_press(lambda: console.leave)).props("no-caps outline")

        def update() -> None:
            live = console.live
            if live is None:
                return
            failed = live.state.phase == "failed"
            message.text = live.state.message or "preparing ..."
            busy.visible, back.visible = not failed, failed

        update()
        ui.timer(0.1, update)
