"""`twin describe`: what a component, a scenario or an FMU consists of."""

from __future__ import annotations

import inspect
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from twin.cli import completion
from twin.cli.terminal import paper, say, working
from twin.errors import TwinError, nearest

if TYPE_CHECKING:
    from collections.abc import Iterable

    from twin.component import Component, Variable
    from twin.coupling import MemberVariable
    from twin.results import Expectation
    from twin.scenario import Scenario

HIDDEN = ("state", "derivative", "local", "independent")  # roles and causalities that nobody sets or connects
TITLES = ("start", "bounds", "what it is")


@click.command("describe", short_help="Variables, units, bounds and sources of a component, scenario or FMU.")
@click.argument("what", metavar="NAME", shell_complete=completion.anything)
@click.option("--all", "everything", is_flag=True, help="States and local variables too.")
@click.option("--matching", default="", metavar="TEXT", help="Only variables that have this in their names.")
def command(what: str, everything: bool, matching: str) -> None:
    """Describe a component (by name or `module:Class`), a scenario (by name or file), or any FMU file.

    Values stand in the unit one prefers to read; `from` names the source of a parameter's value.

    \b
    twin describe servomotor
    twin describe heart_wall_force
    twin describe any.fmu --all
    """
    from twin.component import catalog
    from twin.scenario import scenario_paths

    path = Path(what)
    if path.suffix == ".fmu":
        show_fmu(path, everything, matching)
    elif ":" in what or what in catalog.names():
        cls = catalog.component(what)
        say(f"{what}: {kind(cls)}")
        show_component(cls, everything, matching)
    elif path.suffix or what in (known := scenario_paths.scenarios()):
        show_scenario(path)
    else:
        raise TwinError(
            f"There is no component, scenario or FMU {what!r}. {nearest(what, [*catalog.names(), *known])} See `twin list`."
        )


def kind(cls: type[Component]) -> str:
    """How a component runs."""
    from twin import clock
    from twin.component import PythonComponent

    if issubclass(cls, PythonComponent):
        return "Python-side component"
    if hasattr(cls, "derivatives"):
        return "continuous component"
    return f"sampled component, {clock.text(cls.period_ns)}" if cls.period_ns else "component of the loop's step"


def show_component(cls: type[Component], everything: bool, matching: str) -> None:
    """What a component says of itself, its variables, its terminals."""
    say_lines(inspect.cleandoc(cls.__doc__ or ""))
    chosen = [one for one in cls.variables if (everything or one.role not in HIDDEN) and matching in one.name]
    for role in dict.fromkeys(one.role for one in chosen):
        rows = [
            (called(one), start(one), bounds(one), f"{one.description}{f' (from: {one.source})' * bool(one.source)}")
            for one in chosen
            if one.role == role
        ]
        table(role, rows)
    terminals = cls.terminals.items()
    table("terminal", [(name, "", "", f"{one.description}: {', '.join(one.members)}") for name, one in terminals])


def show_fmu(path: Path, everything: bool, matching: str) -> None:
    """What an FMU says of itself, of any platform; its variables."""
    from twin.fmi import fmu_info

    found = fmu_info.outline(path)
    say(f"{path.name}: FMU, FMI {found.fmi}, {' and '.join(found.interfaces)}")
    say_lines(found.about)
    say(f"made by {found.generator or 'a tool it does not name'}, for {', '.join(found.platforms) or 'no platform'}")
    chosen = [
        one for one in found.variables.values() if (everything or one.causality not in HIDDEN) and matching in one.name
    ]
    for causality in dict.fromkeys(one.causality for one in chosen):
        rows = [
            (called(one), start(one), bounds(one), ": ".join(filter(None, (found.kind(one.name), one.description))))
            for one in chosen
            if one.causality == causality
        ]
        table(causality, rows)


def show_scenario(path: Path) -> None:
    """What a scenario says of itself, its members, variants, figures and verdicts."""
    from twin import clock
    from twin.scenario import load_scenario

    with working(f"reading {path}"):
        scenario = load_scenario(path)
    say(f"{scenario.path}: {scenario.title}")
    say_lines(f"{scenario.description}\n{scenario.source and f'From: {scenario.source}.'}")
    seeds = ", ".join(map(str, scenario.seeds))
    say(
        f"{clock.text(scenario.stop_ns)} at {clock.text(scenario.step_ns)}, {scenario.algorithm.described}, seeds {seeds}"
    )
    table("variant", [(case.variant, "", "", case.title) for case in scenario.variants])
    table("member", [(name, "", "", component) for name, component in made_of(scenario).items()], "made of")
    metrics = [
        (name, "", "", one.description or f"{one.reduce} of {one.signal}") for name, one in scenario.metrics.items()
    ]
    table("metric", metrics)
    table("expectation", [(one.name, "", limits(one), "") for one in scenario.expectations])
    if (record := scenario.mutations) is not None:
        noticed = record.tried - len(record.unnoticed)
        say(f"The expectations notice {noticed} of {record.tried} deliberate faults (benchmarks/mutations.py).")
        table("fault that they do not notice", [(name, "", "", why) for name, why in record.unnoticed.items()], "why")


def limits(one: Expectation) -> str:
    """What an expectation demands, in short."""
    if one.ordered:
        return (" > " if one.descending else " < ").join(one.ordered)
    least, most = (None if limit is None else one.shown(limit) for limit in (one.at_least, one.at_most))
    return between(least, most) or one.ends


def say_lines(text: str) -> None:
    """Print a text, a line for each of its own, without empty ones."""
    for line in filter(str.strip, text.splitlines()):
        say(line)


def made_of(scenario: Scenario) -> dict[str, str]:
    """What each member of any variant is made of."""
    every = [(name, local(spec.component)) for case in scenario.variants for name, spec in case.members.items()]
    return {name: " or ".join(dict.fromkeys(of for other, of in every if other == name)) for name, _ in every}


def local(component: str) -> str:
    """A component's name; the path of a file as it is seen from here."""
    path = Path(component)
    return os.path.relpath(path) if path.is_absolute() else component


def called(one: Variable | MemberVariable) -> str:
    """A variable's name with its shape."""
    return f"{one.name}[{','.join(map(str, one.shape))}]" if one.shape else one.name


def start(one: Variable | MemberVariable) -> str:
    """A start value with its unit; of an array where all are the same, or its first and that there are more."""
    import numpy as np

    values = [] if one.start is None else list(np.ravel(one.start))
    if not values:
        return unit(one)
    several = len({*map(str, values)}) > 1
    return f"{value(values[0], one)}{', ...' * several}"


def bounds(one: Variable | MemberVariable) -> str:
    """What a variable is allowed to be."""
    return between(*(None if limit is None else value(limit, one) for limit in (one.minimum, one.maximum)))


def between(least: str | None, most: str | None) -> str:
    """Limits in words, of which there may be none."""
    if least is not None and most is not None:
        return f"{least} to {most}"
    return f"at least {least}" if least is not None else f"at most {most}" if most is not None else ""


def value(number: Any, one: Variable | MemberVariable) -> str:
    """A number in the unit that people prefer to read; what is no number as it is."""
    from twin.results import signals

    if one.type == "Boolean":
        return str(bool(number)).lower()
    if isinstance(number, str | bytes):
        return str(number)
    return signals.format_value(float(number), unit(one))


def unit(one: Variable | MemberVariable) -> str:
    """The unit that people prefer to read."""
    return one.display_unit or one.unit


def table(title: str, rows: Iterable[tuple[str, str, str, str]], last: str = TITLES[-1]) -> None:
    """Print rows under a title; columns in which nothing stands are left out."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    rows = list(rows)
    if not rows:
        return
    titles = (title, *TITLES[:-1], last)
    used = [column for column in range(len(titles)) if any(row[column] for row in rows)]
    grid = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold")
    for column in used:
        grid.add_column(titles[column], overflow="fold")
    for row in rows:
        grid.add_row(*(Text(row[column]) for column in used))
    paper().print(grid)
