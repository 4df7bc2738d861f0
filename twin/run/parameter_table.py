"""Parameters of a run, for the report: values, and where they come from."""

from __future__ import annotations

import math
import os
import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import catalog
from twin.component import unit as units
from twin.coupling import find
from twin.errors import CouplingError, quote_names, suggestion
from twin.results import MILLI_UNITS, si_conversion
from twin.scenario import number, slider_range

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from twin.coupling import Catalog, MemberVariable
    from twin.scenario import Case, MemberSpec, Node, ScenarioSpec


WARNING = "warning: "
BARE = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*")  # a number without a unit
NUMBERS = re.compile(r"[\s\[\]\d.,eE+-]+")  # the value of `--set` is one number or several, without a unit
TIMES = ("start_time", "stop_time", "step", "period", "communication_step")
FAR = 100.0  # factor from which a set value is implausible, if the scenario states no range
SMALL = 0.1  # parameters all of whose values are below are shown in the smaller unit [SI]


@dataclass(frozen=True)
class ParameterRow:
    """Parameter in the report. `given`: not a component's default; `variants`: where, if not in all.

    `default`: of a parameter that is given, with its unit.
    """

    member: str
    name: str
    value: str
    unit: str = ""
    description: str = ""
    source: str = ""
    given: bool = False
    variants: str = ""
    default: str = ""


def parameter_rows(
    cases: Sequence[Case], catalogs: Mapping[str, Catalog], scenario_file: str = ""
) -> list[ParameterRow]:
    """List every parameter, and input that a file sets, of every variant, equal ones once. `scenario_file`: as in locations; other files are named."""
    variants_of: dict[tuple[str, str], dict[tuple[str, str, str, bool], list[str]]] = {}
    descriptions: dict[tuple[str, str], str] = {}
    defaults: dict[tuple[str, str], str] = {}
    for case in cases:
        for member, variables in catalogs[case.variant].items():
            spec, values = case.members[member], case.values(member, variables)
            group_values, sources = getattr(spec.made, "starts", {}), declared_sources(spec)
            for name, variable in variables.items():
                setter = find_setter(spec, name, scenario_file)
                is_given_input = variable.causality == "input" and setter
                if variable.causality not in ("parameter", "structuralParameter") and not is_given_input:
                    continue
                if name == "seed" and not setter:
                    continue  # differs in every run
                value = values.get(name, group_values.get(name, variable.start))
                if name not in values and not is_default(value, variable):
                    setter = Path(spec.component.partition("#")[0]).name
                source = sources.get(name, "")
                if setter:
                    defaults[member, name] = default = " ".join(shown_value(variable.start, variable)).rstrip()
                    parts = [f"default {default}"] * bool(default) + [source.removeprefix(f"{default}: ")] * bool(
                        source
                    )
                    source = "; ".join([f"set by {setter}", *[": ".join(parts)] * bool(parts)])
                key = (*shown_value(value, variable), source, bool(setter))
                variants_of.setdefault((member, name), {}).setdefault(key, []).append(case.variant)
                descriptions[member, name] = variable.description
    count = len({case.variant for case in cases})
    return [
        ParameterRow(
            member,
            name,
            text,
            unit,
            descriptions[member, name],
            source,
            given,
            "" if len(variants) == count else ", ".join(quote_names(variants)),
            defaults.get((member, name), ""),
        )
        for (member, name), texts in variants_of.items()
        for (text, unit, source, given), variants in texts.items()
    ]


def declared_sources(spec: MemberSpec) -> dict[str, str]:
    """Return the sources of the defaults of a member's parameters, as its component declares them."""
    if spec.component.endswith(".fmu"):
        return {}
    return {variable.name: variable.source for variable in (spec.made or catalog.component(spec.component)).variables}


def find_setter(spec: MemberSpec, name: str, scenario_file: str) -> str:
    """Return what sets a parameter or an element of it: the scenario, an option, or file:line; empty for a default."""
    key = next((key for key in spec.parameters if key.partition("[")[0] == name), None)
    if key is None:
        return ""
    location = spec.locations.get(key, "")
    if location.startswith("--"):
        return f"`{location}`"
    file, _, line = location.rpartition(":")
    if file in ("", scenario_file):
        return "the scenario"
    return (
        f"{os.path.relpath(file, Path(scenario_file).parent.resolve())}:{line}"
        if Path(file).is_absolute()
        else location
    )


def is_default(value: Any, variable: MemberVariable) -> bool:
    """Whether a value is the start value that is declared, for all elements."""
    if variable.start is None:
        return value is None
    return np.array_equal(value, np.broadcast_to(variable.start, np.shape(value)))


def shown_value(value: Any, variable: MemberVariable) -> tuple[str, str]:
    """Format a value of a parameter, and the unit in which it is shown."""
    unit = variable.display_unit or unit_for_size(value, variable.unit)
    return format_parameter(value, variable.unit, unit), unit


def unit_for_size(value: Any, unit: str) -> str:
    """Return the unit in which a parameter is shown: a smaller one such as mm for small values [SI]."""
    array = np.asarray(value)
    is_small = array.dtype.kind == "f" and 0.0 < np.max(np.abs(array), initial=0.0) < SMALL
    return MILLI_UNITS.get(unit, unit) if is_small else unit


def format_parameter(value: Any, unit: str, display: str) -> str:
    """Format a value in its display unit, long arrays shortened; conversion adds no digits: 573 deg/s for 10 rad/s."""
    if value is None:
        return ""
    array = np.asarray(value)
    if array.dtype.kind == "f" and display != unit:
        (factor, offset), (shown_factor, shown_offset) = si_conversion(unit), si_conversion(display)
        array = (array * factor + offset - shown_offset) / shown_factor
    texts = [
        f"{item:.6g}" if isinstance(item, float) else str(item).lower() if isinstance(item, bool) else str(item)
        for item in array.ravel().tolist()
    ]
    if display != unit:
        texts = [
            f"{float(text):.4g}" if re.fullmatch(r"-?(0\.0*\d{6}|(?=.{7}$)\d{1,3}\.\d+)", text) else text
            for text in texts
        ]
    if array.ndim == 0:
        return texts[0]
    return f"[{', '.join(texts)}]" if len(texts) <= 6 else f"[{', '.join(texts[:3])}, … {texts[-1]}] ({len(texts)})"


def remarks_on_values(scenario: ScenarioSpec, catalogs: Mapping[str, Catalog]) -> list[str]:
    """Return a line for each implausible value of an override, or of the file over the scenario that it extends.

    Also for an override without a unit that is shown in another one than SI, and for a misspelled member of the file.
    """
    remarks: dict[str, None] = {}
    for option, previous in zip(scenario.overrides, scenario.previous_values(), strict=True):
        for case in scenario.variants:
            remarks |= dict.fromkeys(value_remarks(scenario, case, catalogs[case.variant], option, previous))
    if (base := scenario.base_tree()) is None:
        return list(remarks)
    for case in scenario.variants:
        own = catalogs[case.variant]
        for where, option, previous in own_values(scenario, case, base):
            lines = value_remarks(scenario, case, own, option, previous)
            remarks |= {line.replace(WARNING, f"{WARNING}{where}: "): None for line in lines if WARNING in line}
        connected = {end.partition(".")[0] for link in case.connections for end in (link.source, link.target)}
        names = base.get("members").entries
        for member in case.members.keys() - names.keys() - connected:
            if hint := suggestion(member, names, "`"):
                remarks[f"note: {case.members[member].where}: member `{member}` is connected to nothing. {hint}"] = None
    return list(remarks)


def own_values(scenario: ScenarioSpec, case: Case, base: Node) -> Iterator[tuple[str, str, str]]:
    """Iterate over the values that a file sets in members of the scenario that it extends: location, `path=value`, value before."""
    trees = [base.get("variants").get(case.variant).get("members"), base.get("members")]
    for member, spec in case.members.items():
        nodes = [tree.get(member) for tree in trees if tree.get(member).value is not None]
        for name, value in spec.parameters.items():
            where = spec.locations.get(name, "")
            if nodes and Path(where.rpartition(":")[0]) == scenario.path and not isinstance(value, list):
                before = (node.get("parameters").get(name).value for node in nodes)
                previous = next((each for each in before if each is not None), "")
                yield where, f"{member}.{name}={value}", str(previous)


def changes_of_base(scenario: ScenarioSpec) -> str:
    """Return what a file changes in members of the scenario that it extends; empty if it extends none.

    Such as `changed from contact: heart.rate 60 -> 90 /min; soft wall: wall.wall_modulus 50 kPa`.
    """
    base = scenario.base_tree()
    if base is None:
        return ""
    variants: dict[str, list[str]] = {}
    for case in scenario.variants:
        for _, option, previous in own_values(scenario, case, base):
            name, _, value = option.partition("=")
            unit, before = value.partition(" ")[2], previous
            with suppress(CouplingError):
                before = in_unit(number(before, spelled(unit), name), spelled(unit), unit).removesuffix(f" {unit}")
            variants.setdefault(f"{name} {f'{before} -> ' * bool(before)}{value}", []).append(case.variant)
    texts = {
        text: ("" if len(names) == len(scenario.variants) else f"{', '.join(quote_names(names))}: ") + text
        for text, names in variants.items()
    }
    return f"changed from {Path(base.location.file).stem}: {'; '.join(texts.values())}" if texts else ""


def case_settings(scenario: ScenarioSpec, variant: str) -> tuple[dict[str, str], dict[str, str]]:
    """Return times, algorithm, components and parameters of a variant as they are run, as texts, by `member.parameter`; and defaults."""
    from twin.run.cases import resolve_catalogs

    case = next(case for case in scenario.variants if case.variant == variant)
    texts = {"stop_time": clock.text(scenario.stop_ns), "step": clock.text(scenario.step_ns)}
    texts["algorithm"] = scenario.algorithm.described
    texts |= {name: spec.component for name, spec in case.members.items()}
    rows = parameter_rows([case], resolve_catalogs(scenario))
    for row in rows:
        name = f"{row.member}.{row.name}"
        shown, value = range_unit(scenario, name), f"{row.value} {units.label(row.unit)}".rstrip()
        texts[name] = in_unit(float(row.value), row.unit, shown) if shown and row.unit != spelled(shown) else value
    return texts, {f"{row.member}.{row.name}": row.default for row in rows}


def value_remarks(scenario: ScenarioSpec, case: Case, catalog: Catalog, option: str, previous: str) -> list[str]:
    """Return the remarks on a value in one variant; `previous`: the one that it replaces, empty if there is none."""
    path, _, text = option.partition("=")
    name = path.strip().removeprefix(f"variants.{case.variant}.").replace(".parameters.", ".", 1)
    try:
        variable = find(name, catalog).variable
        value = number(text, variable.unit, name)
        before = number(previous, variable.unit, name) if previous else float(np.ravel(variable.start)[0])
        ends = slider_range(scenario, case, catalog, name) if name in scenario.console_parameters else None
    except (CouplingError, TypeError, ValueError, IndexError):  # a key of the run, no number, another variant
        return []
    if variable.dtype.kind != "f":
        return []
    limits = " to ".join(map(str, scenario.console_parameters.get(name, ())))
    return override_remarks(option, value, before, variable, ends, limits)


def with_unit(option: str, scenario: ScenarioSpec, catalogs: Mapping[str, Catalog]) -> tuple[str, list[str]]:
    """Return a `--set` option with the unit of a bare number, and notes: the value in the unit of its range, how many elements it sets."""
    path, _, text = (part.strip() for part in option.partition("="))
    symbol, notes = "s" if path.rpartition(".")[2] in TIMES else "", list[str]()
    for variant, own in catalogs.items():
        name = path.removeprefix(f"variants.{variant}.").replace(".parameters.", ".", 1)
        try:
            reference = find(name, own)
        except CouplingError:  # a key of the run, or a member of other variants
            continue
        symbol = units.label(reference.variable.unit)
        shown = range_unit(scenario, name) or shown_value(reference.variable.start, reference.variable)[1]
        if BARE.fullmatch(text) and units.label(shown) != symbol:
            notes = [in_unit(float(text), reference.variable.unit, shown)]
        if reference.size > 1 and "," not in text:
            notes.append(f"all {reference.size} elements")
        break
    if BARE.fullmatch(text):
        return f"{path}={text} {symbol}".rstrip(), notes
    return option, [symbol] * bool(symbol and NUMBERS.fullmatch(text)) + notes


def range_unit(scenario: ScenarioSpec, name: str) -> str:
    """Return the unit of the range that a scenario states for a parameter; empty without one."""
    return next((str(end).partition(" ")[2] for end in scenario.console_parameters.get(name, ())[-1:]), "")


def in_unit(value: float, symbol: str, shown: str) -> str:
    """Return a value in another unit, as text: 72 Hz as `4320 /min`."""
    (factor, offset), (shown_factor, shown_offset) = si_conversion(symbol), si_conversion(spelled(shown))
    return f"{(value * factor + offset - shown_offset) / shown_factor:.6g} {units.label(shown)}"


def spelled(symbol: str) -> str:
    """Return `1/min` for the `/min` of values such as `60 /min`."""
    return f"1{symbol}" if symbol.startswith("/") else symbol


def override_remarks(
    option: str,
    value: float,
    before: float,
    variable: MemberVariable,
    ends: tuple[float, float] | None,
    limits: str = "",
) -> list[str]:
    """Return the remarks on one value. `before`: the scenario's; `ends`: the range that it states, `limits` as written."""
    _, _, text = option.partition("=")
    usual, shown_unit = shown_value(before, variable)
    shown_unit = limits.rpartition(" ")[2] if " " in limits.rpartition(" to ")[2] else shown_unit
    own_unit, shown_unit = units.label(variable.unit), units.label(shown_unit)
    meaning, advice = f"{option} is", ""
    if shown_unit != own_unit:
        converted = in_unit(value, variable.unit, shown_unit)
        meaning = f"{option} is {converted},"
        if BARE.fullmatch(text):
            meaning = f"{option} means {value:g} {own_unit} = {converted},"
            meant = value * si_conversion(spelled(shown_unit))[0] / si_conversion(variable.unit)[0]
            is_meant = ends[0] <= meant <= ends[1] if ends else distance(meant, before) <= distance(value, before)
            advice = f" Write '{text.strip()} {shown_unit}' if you mean {shown_unit}." * is_meant
    if ends is not None and not ends[0] <= value <= ends[1]:
        return [f"{WARNING}{meaning} outside of {limits}.{advice}"]
    if ends is None and value and before and not 1.0 / FAR <= abs(value / before) <= FAR:
        size = f"{abs(value / before):.4g} times the scenario's {usual} {units.label(shown_value(before, variable)[1])}".rstrip()
        return [f"{WARNING}{meaning} implausible, {size}.{advice}"]
    return [f"note: {meaning.rstrip(',')}.{advice}"] if advice else []


def distance(value: float, other: float) -> float:
    """Return by how many powers of ten two values differ; 0 if one of them is zero."""
    return abs(math.log10(abs(value / other))) if value and other else 0.0
