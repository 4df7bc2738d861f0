"""`twin describe`: show the content of a component, a scenario or an FMU.

Over 400 lines: one table for all kinds of variables, of components, FMUs and members.
"""

from __future__ import annotations

import inspect
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from twin.cli import completion
from twin.cli.options import filter_option, runs_option
from twin.cli.terminal import say, show_elapsed, show_table, show_text
from twin.errors import CouplingError, TwinError, quote_names, suggestion

if TYPE_CHECKING:
    from collections.abc import Iterable

    from twin.component import Component, Variable
    from twin.coupling import MemberVariable
    from twin.results import Expectation
    from twin.scenario import ScenarioSpec

HIDDEN = ("state", "derivative", "local", "independent")  # roles and causalities that cannot be set or connected
SHORT_NUMBER = 9  # digits and point of a converted value that is printed in full
SHORT = 30  # characters of a vector
TITLES = ("start", "bounds", "description")
NOT_PLAIN = ("scenarios", "studies", "components", "runs")  # kinds that are described by more than a line
USES = {"profiles": " Use it in a hardware file, `profile: {name}`, or simulate it: twin drive --profile {name}"}


@click.command("describe")
@click.argument("what", metavar="NAME", shell_complete=completion.components_and_scenarios)
@click.option(
    "--all",
    "everything",
    is_flag=True,
    help="Also show sources of values, states and local variables, whole vectors; of a scenario parameters and connections.",
)
@filter_option
@runs_option
def command(what: str, everything: bool, text: str, runs: Path) -> None:
    """Describe what `twin list` lists: a component, a scenario, a study, a drive profile or a run; also a file or any FMU.

    Values are in the display unit; --all adds the source of a parameter's value. Of a scenario, --all and --filter show
    the parameters of its members as they will run, and the connections.

    \b
    twin describe servomotor
    twin describe heart_wall_force --filter heart.rate
    twin describe thousand_patients
    twin describe latest
    twin describe any.fmu --all
    """
    shown = show_named(what, everything, text, runs)
    if text and not shown:
        raise TwinError(f"{what}: nothing contains {text!r}. Leave --filter out to see all.")


def show_named(what: str, everything: bool, text: str, runs: Path) -> bool:
    """Describe something by its name or file; return whether a table was printed."""
    from twin.cli.check import is_study
    from twin.cli.export import SCENARIO_FILES
    from twin.cli.list import STUDY, kinds_of_names, show_run, show_study_run
    from twin.cli.study import show_study
    from twin.component import catalog
    from twin.results import find_by_time, resolve_latest
    from twin.scenario import scenario_paths

    path = Path(what)
    if path.suffix == ".fmu":
        return show_fmu(path, everything, text)
    scenarios, studies = scenario_paths.scenarios(), scenario_paths.scenarios("study")
    files = scenarios | studies
    if ":" in what or what in catalog.names():
        cls = catalog.component(what)
        say(f"{what}: {kind(cls)}")
        shown = show_component(cls, everything, text)
        if what in files:
            say(f"There is also a scenario of this name: twin describe {what}.yaml")
        return shown
    if path.stem in files and not path.exists() and (path.suffix or path.parent.name in ("", "scenarios", "studies")):
        path = files[path.stem]  # such as heart_motion.yaml, where heart_motion is also a component
    if path.suffix in SCENARIO_FILES:
        return show_study(path, text) if is_study(str(path)) else show_scenario(path, everything, text)
    folder = resolve_latest(path, root=runs) if path.name == "latest" else find_by_time(runs, path)
    if (folder / "summary.json").is_file():
        return show_run(folder)
    if (folder / STUDY).is_file():
        return show_study_run(folder)
    listings = {name: listing for name, listing in kinds_of_names(runs).items() if name not in NOT_PLAIN}
    for listed_kind, listing in listings.items():
        if what in (lines := listing()):
            show_text(f"{what}: {lines[what]}")
            show_text(f"One of `twin list {listed_kind}`.{USES.get(listed_kind, '').format(name=what)}")
            details = getattr(sys.modules[listing.__module__], "describe", None)  # of another package
            for line in details(what) if details is not None else ():
                say(line) if line.startswith(" ") else show_text(line)  # a line of a file stays whole
            return True
    names = [*catalog.names(), *scenarios, *studies, *(name for listing in listings.values() for name in listing())]
    file = path.with_suffix(".yaml")
    here = f"There is a file of this name: twin describe {file}." if file.is_file() else suggestion(what, names)
    advice = " ".join(filter(None, [here, "See `twin list`."]))
    raise TwinError(f"There is nothing called {what!r}. {advice}")


def kind(cls: type[Component]) -> str:
    """Return how a component is executed."""
    from twin import clock
    from twin.component import PythonComponent

    if issubclass(cls, PythonComponent):
        return "Python-side component"
    if hasattr(cls, "derivatives"):
        return "continuous component"
    return f"sampled component, {clock.text(cls.period_ns)}" if cls.period_ns else "component of the communication step"


def show_component(cls: type[Component], everything: bool, text: str) -> bool:
    """Print the documentation of a component, its variables and its terminals; return whether it has any."""
    say_lines(inspect.cleandoc(cls.__doc__ or ""))
    selected = [
        variable for variable in cls.variables if (everything or variable.role not in HIDDEN) and text in variable.name
    ]
    for role in dict.fromkeys(variable.role for variable in selected):
        rows = [
            (
                name_with_shape(variable),
                start(variable, everything),
                bounds(variable),
                f"{variable.description}{f' (from: {variable.source})' * bool(variable.source and everything)}",
            )
            for variable in selected
            if variable.role == role
        ]
        print_table(role, rows)
    terminals = [item for item in cls.terminals.items() if text in item[0]]
    rows = [(name, "", "", f"{terminal.description}: {', '.join(terminal.members)}") for name, terminal in terminals]
    print_table("terminal", rows)
    if not everything and any(variable.source for variable in selected):
        say("Sources of the values, states and local variables: --all")
    return bool(selected or rows)


def show_fmu(path: Path, everything: bool, text: str) -> bool:
    """Print the model description and the variables of an FMU of any platform; return whether it has any."""
    from twin.fmi import fmu_info

    info = fmu_info.outline(path)
    say(f"{path.name}: FMU, FMI {info.fmi}, {' and '.join(info.interfaces)}")
    say_lines(info.about)
    say(f"generated by {info.generator or 'an unnamed tool'}, platforms: {', '.join(info.platforms) or 'none'}")
    selected = [
        variable
        for variable in info.variables.values()
        if (everything or variable.causality not in HIDDEN) and text in variable.name
    ]
    for causality in dict.fromkeys(variable.causality for variable in selected):
        rows = [
            (
                name_with_shape(variable),
                start(variable, everything),
                bounds(variable),
                ": ".join(filter(None, (info.kind(variable.name), variable.description))),
            )
            for variable in selected
            if variable.causality == causality
        ]
        print_table(causality, rows)
    return bool(selected)


def show_scenario(path: Path, everything: bool = False, text: str = "") -> bool:
    """Print the description of a scenario, its variants, members, metrics and expectations; with `text` what contains it."""
    from twin import clock
    from twin.run import changes_of_base
    from twin.scenario import load_scenario

    with show_elapsed(f"reading {path}"):
        scenario = load_scenario(path)
    say(f"{scenario.name if has_listed_name(scenario.path) else scenario.path}: {scenario.title}")
    if not text:
        say_lines(changes_of_base(scenario))
        is_inherited = scenario.source.startswith("From ")
        source = f"{'' if is_inherited else 'From: '}{scenario.source}." * bool(scenario.source)
        say_lines(f"{scenario.description}\n{source}")
    seeds = ", ".join(map(str, scenario.seeds))
    say(
        f"{clock.text(scenario.stop_ns)} at {clock.text(scenario.step_ns)}, {scenario.algorithm.described}, seeds {seeds}"
    )
    metrics = [
        (name, "", "", metric.description or f"{metric.reduce} of {metric.signal.text}")
        for name, metric in scenario.metrics.items()
    ]
    members = [(name, "", "", component) for name, component in member_components(scenario).items()]
    tables: list[tuple[str, list[tuple[str, str, str, str]], str]] = [
        ("variant", [(case.variant, "", "", case.title) for case in scenario.variants], "description"),
        ("member", members, "component"),
        ("metric", metrics, "description"),
        ("requirement", [(item.name, "", limits(item), "") for item in scenario.expectations], "description"),
    ]
    shown = False
    for title, rows, last in tables:
        shown |= print_table(title, [row for row in rows if text.lower() in " ".join(row).lower()], last)
    if everything or text:
        shown |= show_settings(scenario, text)
    if (record := scenario.mutations) is not None and not text:
        detected = record.tried - len(record.unnoticed)
        say(f"The requirements detect {detected} of {record.tried} deliberate faults (benchmarks/mutations.py).")
        print_table("undetected fault", [(name, "", "", reason) for name, reason in record.unnoticed.items()], "reason")
    if not everything and not text:
        show_often_changed(scenario)
    return shown


def show_often_changed(scenario: ScenarioSpec) -> None:
    """Print the parameters that the scenario lists first, with their ranges, and commands to copy."""
    listed = scenario.console_parameters
    settings = {name: (value, meaning) for name, value, _, meaning, _ in settings_of(scenario)} if listed else {}
    rows = []
    for name, ends in listed.items():
        value, meaning = settings.get(name, ("", ""))
        rows.append((name, value, span(ends), meaning))
    show_table(("often changed", "value", "range", "meaning"), rows, 4)
    command = f"twin run {scenario.name if has_listed_name(scenario.path) else scenario.path}"
    say(f"Run it: {command}")
    if rows and (value := halfway(rows[0][1], next(iter(listed.values())))):
        quoted = f'"{value}"' if " " in value else value
        say(f"Change it: {command} --set {rows[0][0]}={quoted}")
    say("Parameters and connections: --all or --filter NAME")


def in_unit_of(value: str, ends: tuple[Any, ...]) -> str:
    """Return a value such as `1 Hz` in the unit of the ends of its range: `60 /min`."""
    from twin.scenario import number

    unit = str(ends[-1]).partition(" ")[2] if ends else ""
    if not unit or value.partition(" ")[2] == unit:
        return value
    try:
        return f"{number(value, f'1{unit}' if unit.startswith('/') else unit, '.'):.6g} {unit}"
    except (TwinError, ValueError):  # an array, or a unit of another kind
        return value


def halfway(value: str, ends: tuple[Any, ...]) -> str:
    """Return the middle between a value and the upper end of its range, in its unit, which requirements rarely exclude; "" without."""
    try:
        numbers = [float(str(each).partition(" ")[0]) for each in (value, *ends[-1:])]
        return " ".join([f"{sum(numbers) / len(numbers):.3g}", *value.split(" ")[1:]]) if ends else ""
    except ValueError:  # an array
        return ""


def span(ends: tuple[Any, ...]) -> str:
    """Return a range that a scenario states, a common unit once: `40 to 120 /min`."""
    texts = [f"{end:.6g}" if isinstance(end, float) else str(end) for end in ends]
    unit_text = texts[-1].partition(" ")[2] if texts else ""
    return " to ".join([*(text.removesuffix(f" {unit_text}") for text in texts[:-1]), *texts[-1:]])


def has_listed_name(path: Path) -> bool:
    """Whether the name alone leads to the file."""
    from twin.scenario import scenario_paths

    return scenario_paths.scenarios().get(path.stem) == path


def settings_of(scenario: ScenarioSpec) -> list[tuple[str, str, str, str, str]]:
    """Return name, value, bounds, meaning, and what sets it, of each parameter as it will run, equal ones once."""
    from twin.run import parameter_rows, resolve_catalogs

    catalogs = resolve_catalogs(scenario)
    variables = {
        f"{member}.{name}": variable
        for catalog in catalogs.values()
        for member, own in catalog.items()
        for name, variable in own.items()
    }
    rows: dict[tuple[str, str], tuple[str, list[str]]] = {}
    for row in parameter_rows(scenario.variants, catalogs, str(scenario.path)):
        name, value = f"{row.member}.{row.name}", f"{row.value} {row.unit}".rstrip()
        source = row.source.partition(": ")[0] if row.given else ""  # without that of the component's default
        source = source.replace(f"{scenario.path.parent}/", "").removesuffix(f"; default {value}")
        notes = ", ".join(filter(None, (source, row.variants and f"only {row.variants}")))
        rows.setdefault((name, value), (row.description, []))[1].append(notes)
    values = [name for name, _ in rows]
    return [
        (
            name,
            in_unit_of(value, ends := scenario.console_parameters.get(name, ())),
            span(ends) or bounds(variables[name]),
            meaning,
            notes[0] if len(notes) == 1 or values.count(name) > 1 else "",
        )
        for (name, value), (meaning, notes) in rows.items()
    ]


def show_settings(scenario: ScenarioSpec, text: str) -> bool:
    """Print the parameters of the members as they will run, and the connections: those that contain a text."""
    own = [
        (name, *texts, f"{meaning} ({note})".lstrip() if note else meaning)
        for name, *texts, meaning, note in settings_of(scenario)
        if text.lower() in name.lower()
    ]
    shown = show_table(("parameter", "value", "range", "meaning"), own, 4)
    connections: dict[tuple[str, str], list[str]] = {}
    for case in scenario.variants:
        for link in case.connections:
            connections.setdefault((link.source, link.target), []).append(case.variant)
    several = any(len(variants) < len(scenario.variants) for variants in connections.values())
    wires = [
        (*ends, "" if len(variants) == len(scenario.variants) else f"only {', '.join(quote_names(variants))}")
        for ends, variants in connections.items()
        if text.lower() in " ".join(ends).lower()
    ]
    return show_table(("from", "to", *["variants"] * several), (wire[: 2 + several] for wire in wires), 3) or shown


def limits(item: Expectation) -> str:
    """Return the limits of an expectation as text."""
    if item.ordered:
        return (" > " if item.descending else " < ").join(item.ordered)
    lower, upper = (None if limit is None else item.shown(limit) for limit in (item.at_least, item.at_most))
    return range_text(lower, upper) or item.ends


def say_lines(text: str) -> None:
    """Print the lines of a text, without empty ones; on a terminal wrapped at words."""
    for line in filter(str.strip, text.splitlines()):
        show_text(line.strip(), " " * (len(line) - len(line.lstrip())))


def member_components(scenario: ScenarioSpec) -> dict[str, str]:
    """Return the component of each member; several joined by `or` where variants differ."""
    components: dict[str, list[str]] = {}
    for case in scenario.variants:
        for name, spec in case.members.items():
            components.setdefault(name, []).append(relative_name(spec.component, scenario.path.parent))
    return {name: " or ".join(dict.fromkeys(names)) for name, names in components.items()}


def relative_name(component: str, folder: Path) -> str:
    """Return a component's name, or the path of a file from the scenario's folder, or the name of a shipped scenario."""
    from twin.scenario import scenario_paths

    path = Path(component)
    if not path.is_absolute():
        return component
    if path.is_relative_to(folder.resolve()):
        return path.relative_to(folder.resolve()).as_posix()
    file, mark, rest = component.partition("#")
    name = Path(file).stem
    shipped = scenario_paths.scenarios().get(name)
    return f"{name}{mark}{rest}" if shipped and shipped.resolve() == Path(file) else os.path.relpath(path)


def name_with_shape(variable: Variable | MemberVariable) -> str:
    """Return the name of a variable with its shape, and with its unit if no start value shows it."""
    name = f"{variable.name}[{','.join(map(str, variable.shape))}]" if variable.shape else variable.name
    return f"{name} [{unit(variable)}]" if variable.start is None and unit(variable) not in ("", "1") else name


def start(variable: Variable | MemberVariable, everything: bool = False) -> str:
    """Return a start value with its unit: of an array the common value, else all if they are short, or else the first and dots."""
    import numpy as np

    values = [] if variable.start is None else list(np.ravel(variable.start))
    if not values:
        return ""
    texts = [value_text(value, variable) for value in values]
    if len(set(texts)) == 1:
        return texts[0]
    label = f" {unit(variable)}".rstrip()
    full_text = f"{', '.join(text.removesuffix(label) for text in texts)}{label}"
    return full_text if everything or len(full_text) <= SHORT else f"{texts[0]}, ... (--all)"


def bounds(variable: Variable | MemberVariable) -> str:
    """Return the allowed range of a variable."""
    return range_text(
        *(None if limit is None else value_text(limit, variable) for limit in (variable.minimum, variable.maximum))
    )


def range_text(lower: str | None, upper: str | None) -> str:
    """Return a range as text; empty without limits."""
    if lower is not None and upper is not None:
        return f"{lower} to {upper}"
    return f"at least {lower}" if lower is not None else f"at most {upper}" if upper is not None else ""


def value_text(value: Any, variable: Variable | MemberVariable) -> str:
    """Return a number, given in the variable's own unit, in its display unit, other values unchanged."""
    from twin.results import signals

    if variable.type == "Boolean":
        return str(bool(value)).lower()
    if isinstance(value, str | bytes):
        return str(value)
    factor, offset = signals.si_conversion(variable.unit)  # other than 1 and 0 in an FMU of another tool
    value, shown = float(value) * factor + offset, unit(variable)
    exact = signals.format_value(value, shown, digits=15)  # conversion adds no digits: 573 deg/s for 10 rad/s
    is_short = shown == variable.unit or len(exact.partition(" ")[0].strip("-0.")) <= SHORT_NUMBER
    return exact if is_short else signals.format_value(value, shown)


def unit(variable: Variable | MemberVariable) -> str:
    """Return the display unit, or the unit if there is none or it does not convert."""
    from twin.component import unit as units

    try:
        units.conversion(variable.unit, variable.display_unit, variable.name)
    except CouplingError:
        return variable.unit
    return variable.display_unit or variable.unit


def print_table(title: str, rows: Iterable[tuple[str, str, str, str]], last: str = TITLES[-1]) -> bool:
    """Print rows under a title, without empty columns; return whether there are any."""
    columns = zip((title, *TITLES[:-1], last), *rows, strict=True)
    if used := [column for column in columns if any(column[1:])]:
        titles, *used_rows = zip(*used, strict=True)
        return show_table(titles, used_rows, len(titles))
    return False
