"""Start page of a console: scenarios, recent ones first, and the progress of a starting session."""

from __future__ import annotations

import re
import time
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from nicegui import ui

from twin.scenario import scenario_paths

if TYPE_CHECKING:
    from twin.console.page import PageContext

MAX_RECENT = 4
LIKE = 0.8  # similarity (difflib ratio) from which a word of a search counts although it is typed otherwise
TOPICS = scenario_paths.TOPICS
OTHERS = "Others"
TOPIC_PICTURES = Path(__file__).parent / "static" / "topics"
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
    headings = {heading for _, entries in groups for _, each in entries for heading in headings_of(each)}
    with ui.column().classes("twin-home"):
        ui.label("Select a scenario").classes("text-h6")
        search = (
            ui.input(placeholder="search")
            .props("dense outlined clearable debounce=100 autofocus aria-label='search scenarios'")
            .classes("full-width")
        )
        topic = ui.toggle(
            ["All", *(heading for heading in (*TOPICS.values(), OTHERS) if heading in headings)], value="All"
        )
        topic.props("dense no-caps unelevated aria-label='topic'").classes("twin-topics")

        def selected() -> list[Group]:
            return select_groups(groups, search.value or "", "" if topic.value == "All" else topic.value)

        @ui.refreshable
        def cards() -> None:
            if not selected():
                ui.label(no_match(search.value)).classes("twin-soft").props("role=status")
            for heading, entries in selected():
                ui.label(heading).classes("twin-h")
                with ui.element("div").classes("twin-cards"):
                    for name, overview in entries:
                        _card(context, name, scenarios[name], overview)

        async def begin_single_match() -> None:
            matches = [entry for _, entries in selected() for entry in entries]
            if len(matches) == 1:
                ((name, overview),) = matches
                await context.run(context.console.begin, scenarios[name], overview.variant)

        search.on_value_change(cards.refresh)
        topic.on_value_change(cards.refresh)
        search.on("keydown.escape", lambda: search.set_value(""))
        search.on("keydown.enter", begin_single_match)
        cards()


def headings_of(overview: scenario_paths.Overview) -> list[str]:
    """Return the headings under which a scenario is looked for: to operate, and its topic."""
    topics = ("operate",) * overview.has_controls + (overview.topic,)
    return list(dict.fromkeys(TOPICS.get(topic, OTHERS) for topic in topics))


def group_scenarios(recent: list[str], scenarios: dict[str, Path]) -> list[Group]:
    """Return each scenario once: those to begin with and the recent ones, then the others by topic."""
    overviews = {name: scenario_paths.overview(path) for name, path in sorted(scenarios.items())}
    first = [name for name in scenario_paths.START_HERE if name in overviews]
    listed = {"Start here, and recent" if recent else "Start here": list(dict.fromkeys((*first, *recent)))}
    groups, earlier = list[Group](), set[str]()
    for heading in (*listed, *TOPICS.values(), OTHERS):
        of_topic = [name for name, each in overviews.items() if headings_of(each)[0] == heading]
        names = [name for name in listed.get(heading, of_topic) if name not in earlier]
        earlier.update(names)
        groups.append((heading, [(name, overviews[name]) for name in names]))
    return groups


def select_groups(groups: list[Group], search: str, topic: str = "") -> list[Group]:
    """Return the groups with the scenarios whose name, title, headings, description or variants contain all words; no empty groups.

    If none contains them, words that are similar count too. `topic`: a heading, of which one group is returned with all its scenarios.
    """
    words = search.casefold().split()

    def is_selected(name: str, each: scenario_paths.Overview, is_tolerant: bool) -> bool:
        headings = headings_of(each)
        if topic and topic not in headings:
            return False
        text = f"{name} {each.title} {' '.join(headings)} {each.details}".casefold()
        parts = re.findall(r"\w+", text.replace("_", " ")) if is_tolerant else []
        return all(word in text or get_close_matches(word, parts, 1, LIKE) for word in words)

    for is_tolerant in (False, True):
        selected = [
            (heading, [entry for entry in entries if is_selected(*entry, is_tolerant)]) for heading, entries in groups
        ]
        if any(entries for _, entries in selected):
            break
    if topic:
        selected = [(topic, [entry for _, entries in selected for entry in entries])]
    return [(heading, entries) for heading, entries in selected if entries]


def no_match(search: str) -> str:
    """Return what a search without a match may have meant: a study is run in the terminal."""
    studies = [name for name in scenario_paths.scenarios("study") if search.strip().casefold() in name.casefold()]
    study = f" {studies[0]} is a study: run `twin study {studies[0]}` in a terminal." if studies else ""
    return f"No scenario matches.{study}"


@cache
def topic_pictures() -> dict[str, str]:
    """Return the SVG picture of each topic, a part of the page, so that it appears with its card."""
    return {path.stem: path.read_text(encoding="utf-8") for path in TOPIC_PICTURES.glob("*.svg")}


def facts(overview: scenario_paths.Overview) -> str:
    """Return what distinguishes a scenario from others of its topic: how it is operated or how many variants it has, and how long it lasts."""
    if overview.has_controls:
        return "operate by keys or gamepad, until you end it"
    variants = f"{overview.variants} variants" if overview.variants > 1 else ""
    return ", ".join(filter(None, (variants, overview.duration.replace(" ", "\N{NO-BREAK SPACE}"))))


def _card(context: PageContext, name: str, path: Path, overview: scenario_paths.Overview) -> None:
    with (
        ui.element("button")
        .classes("twin-card twin-pick")
        .on("click", context.on_press(lambda: context.console.begin, path, overview.variant))
    ):
        if overview.topic in TOPICS:
            ui.html(topic_pictures()[overview.topic], sanitize=False).props("aria-hidden=true")
        with ui.element("div"):
            ui.label(name).classes("twin-h")
            ui.label(overview.title)
            ui.label(facts(overview)).classes("twin-soft")


def starting(context: PageContext) -> None:
    """Show the progress of a starting session, or why it failed."""
    console, begin = context.console, time.monotonic()
    with ui.column().classes("twin-home items-center"):
        busy = ui.spinner(size="32px")
        ui.label(console.scenario.stem if console.scenario else "").classes("text-h6")
        message = ui.label().props("role=status")
        note = ui.label("Only the first time: members are translated to C and compiled, and stored.").classes(
            "twin-soft"
        )
        back = ui.button("another scenario", on_click=context.on_press(lambda: console.leave)).props("no-caps outline")

        def update() -> None:
            live = console.live
            if live is None:
                return
            failed = live.state.phase == "failed"
            elapsed = "" if failed else f", {time.monotonic() - begin:.0f} s"
            message.text = (live.state.message or "starting a process for the session") + elapsed
            busy.visible, back.visible = not failed, failed
            note.visible = live.state.message.startswith("building")

        update()
        ui.timer(0.1, update)
