"""Names and patterns of recorded signals in the Python interface."""

from __future__ import annotations

import re
from dataclasses import replace
from math import prod
from typing import TYPE_CHECKING, Any

from twin.errors import TwinError, UnknownNameError, nearest
from twin.face.conversions import as_list
from twin.scenario import resolve_variables

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from twin.results import Expression, RecordedVariable
    from twin.scenario import ScenarioSpec

ELEMENT = re.compile(r"([^\[\]]+)\[[^\[\]]*\]")  # `tip.position[3]`
MAX_ELEMENTS = 16  # of a local array that is no buffer


def flatten(names: Iterable[Any]) -> list[Any]:
    """Return names of which some are in lists as one list."""
    return [name for item in names for name in as_list(item)]


def array_of(name: str, recorded: Mapping[str, RecordedVariable]) -> RecordedVariable | None:
    """Return the recorded variable of which a name is an element, that may not exist."""
    matched = ELEMENT.fullmatch(name)
    return recorded.get(matched[1]) if matched else None


def names_of(parsed: Expression) -> list[str]:
    """Return the variables of an expression, each once."""
    return list(dict.fromkeys(signal.name for signal in parsed.signals))


def describe_unknown(
    name: str, recorded: Mapping[str, RecordedVariable], candidates: Iterable[str] = (), reason: str = ""
) -> str:
    """Return a sentence on a name that was not recorded: the signals of a member of that name, or similar names."""
    names = sorted(recorded, key=lambda signal: recorded[signal].shape != ())  # stable: scalars first
    if own := [signal for signal in names if signal.startswith(f"{name}.")]:
        return (
            f"{name!r} is a member. Name a signal of it, such as {', '.join(map(repr, own[:3]))}, or all: '{name}.*'."
        )
    if "." not in name and not candidates:  # `force`: signals with this word, else the members
        if own := [signal for signal in names if name and name in signal.partition(".")[2]]:
            return f"{name!r} was not recorded{reason}. Did you mean {', '.join(map(repr, own[:6]))}?"
        names = [f"{signal.partition('.')[0]}.*" for signal in recorded]
    return f"{name!r} was not recorded{reason}. {nearest(name, candidates or names)}"


def find_variable(name: str, recorded: Mapping[str, RecordedVariable], where: str) -> RecordedVariable:
    """Return a recorded variable or element, counted from 1; UnknownNameError if there is none."""
    if name in recorded:
        return recorded[name]
    if (variable := array_of(name, recorded)) is None:
        raise UnknownNameError(f"{where}: {describe_unknown(name, recorded)}")
    if name in variable.columns and variable.shape:
        return replace(variable, name=name, shape=())
    size, last = (sign.join(map(str, variable.shape)) for sign in (" x ", ","))
    first = ",".join("1" * len(variable.shape))
    text = f"has {size} elements, from {first} to {last}" if variable.shape else "is a single value"
    raise UnknownNameError(f"{where}: {name!r}: {variable.name} {text}.")


def variants_with(name: str, scenario: ScenarioSpec) -> list[str]:
    """Return the variants whose members have a variable, or that of an element; none if a component is missing."""
    member, _, variable = name.partition("[")[0].partition(".")
    try:
        catalogs, _ = resolve_variables(scenario)
    except TwinError:
        return []
    return [variant for variant, catalog in catalogs.items() if variable in catalog.get(member, ())]


def internal_names(scenario: ScenarioSpec) -> set[str]:
    """Return memory of components: local variables that are 64-bit integers, such as states of random generators, or buffers.

    Nothing of a member whose component is missing.
    """
    try:
        catalogs, _ = resolve_variables(scenario)
    except TwinError:
        return set()
    return {
        f"{member}.{name}"
        for catalog in catalogs.values()
        for member, variables in catalog.items()
        for name, variable in variables.items()
        if variable.causality == "local" and (variable.type == "Int64" or prod(variable.shape) > MAX_ELEMENTS)
    }
