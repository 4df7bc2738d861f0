"""`twin list`: what there is to work with, one line each."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin import installed
from twin.cli.terminal import paper, say
from twin.errors import TwinError, nearest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

Lines = dict[str, str]  # what there is, and what it is, by name


@click.command("list", short_help="Components, scenarios, drive profiles and runs, one line each.")
@click.argument("kinds", nargs=-1, metavar="[KIND]...")
@click.option("--matching", default="", metavar="TEXT", help="Only what has this in its name or its line.")
@click.option("--runs", type=click.Path(file_okay=False, path_type=Path), default=Path("runs"), show_default=True,
              help="Folder of the runs.")  # fmt: skip
def command(kinds: tuple[str, ...], matching: str, runs: Path) -> None:
    """List what there is: components, scenarios, studies, profiles (of drives), runs. By default all of it.

    Nothing is imported or run. Each may be named where a command wants one; `twin describe NAME` tells more.

    \b
    twin list
    twin list components --matching force
    """
    listings: dict[str, Callable[[], Lines]] = {
        "components": components,
        "scenarios": partial(scenarios, "scenario"),
        "studies": partial(scenarios, "study"),
        **{kind: point.load() for kind, point in installed.entry_points("twin.listed").items()},
        "runs": lambda: finished(runs),
    }
    for kind in kinds:
        if kind not in listings:
            raise TwinError(f"There is no list of {kind!r}. {nearest(kind, listings)}")
    for kind in kinds or listings:
        lines = [
            (name, line) for name, line in listings[kind]().items() if matching.lower() in f"{name} {line}".lower()
        ]
        say(f"{kind}: {len(lines)}")
        show(lines)


def show(lines: Iterable[tuple[str, str]]) -> None:
    """Print names and what they are, indented."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, show_header=False, pad_edge=True)
    table.add_column("name", no_wrap=True)
    table.add_column("line", overflow="fold")
    for name, line in lines:
        table.add_row(Text(name), Text(line))
    if table.row_count:
        paper().print(table)


def components() -> Lines:
    """Components of `fmus`, and what their files say in the first line."""
    from twin.component import catalog

    return {name: catalog.summary(name) for name in catalog.names()}


def scenarios(kind: str) -> Lines:
    """Scenarios or studies here and those that came with the project, by their titles."""
    from twin.scenario import scenario_paths

    return {name: scenario_paths.title(path) for name, path in scenario_paths.scenarios(kind).items()}


def finished(folder: Path) -> Lines:
    """Finished runs, the latest first, and how they ended."""
    return {path.parent.as_posix(): ending(path) for path in sorted(folder.glob("*/*/summary.json"), key=stamp)[::-1]}


def stamp(path: Path) -> str:
    """When a run began, by its folder."""
    return path.parent.name


def ending(path: Path) -> str:
    """How a run ended, by its summary."""
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
        verdicts = [one["verdict"] for one in summary["expectations"] if one["verdict"] != "skipped"]
        cases = len(summary["cases"])
        held = f"{verdicts.count('pass')} of {len(verdicts)} verdicts passed"
        return f"{summary['status']}, {cases} case{'s' * (cases != 1)}, {held}"
    except (OSError, ValueError, KeyError, TypeError):
        return "its summary.json cannot be read"
