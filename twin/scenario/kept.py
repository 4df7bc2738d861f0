"""Checked scenarios, kept under what they were made from: what has not changed is neither read nor checked again.

A scenario is plain data once it is checked, and kept as such: JSON with its hash in front. It counts if its file and all
that it extends, its components and FMUs, the engine and the libraries that have a say are what they were; else, and where
the file is damaged or cannot be written, the scenario is checked as if nothing had been kept.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import compiler, installed
from twin.component import catalog
from twin.coupling import MemberVariable, TerminalMember
from twin.errors import ScenarioError, TwinError
from twin.fmi import built
from twin.results import Curve, Expectation, Expression, Metric, Plot, Window, expression
from twin.scenario.node import Node, Place
from twin.scenario.spec import Case, ConnectionSpec, EventSpec, MemberSpec, RecordSpec, Scenario

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from twin.coupling import Catalog

ENGINE = Path(__file__).parents[1]
LIBRARIES = ("numpy", "pint", "pydantic", "PyYAML")
LARGEST = 4_000_000  # of a text that is kept [byte]: beyond it, reading takes as long as checking
KINDS: dict[str, Any] = {
    one.__name__: one
    for one in (
        *(Scenario, Case, MemberSpec, ConnectionSpec, EventSpec, RecordSpec, Node, Place),
        *(Metric, Expectation, Plot, Curve, Window, MemberVariable, TerminalMember),
    )
}


def checked(path: Path, overrides: Sequence[str], build: Path) -> tuple[Scenario, dict[str, Catalog]]:
    """A scenario with its members' variables by variant, all of it checked; ScenarioError lists every problem."""
    place = build / "scenarios" / f"{digest(str(Path.cwd()), str(path), *overrides)[:32]}.json"
    if (found := find(place)) is not None:
        return found
    from twin.scenario.dimensions import displayed
    from twin.scenario.load import load_scenario
    from twin.scenario.lookup import look_up

    scenario = load_scenario(path, overrides)
    catalogs, problems = look_up(scenario)
    if problems:
        raise ScenarioError(problems)
    scenario = displayed(scenario, catalogs)
    keep(place, scenario, catalogs)
    return scenario, catalogs


def find(place: Path) -> tuple[Scenario, dict[str, Catalog]] | None:
    """What is kept, if it still holds."""
    try:
        sum_, _, text = place.read_text().partition("\n")
        if sum_ != digest(text):
            return None
        told = json.loads(text)
        if told["made_from"] != made_from(told["made_from"]["files"], told["made_from"]["components"]):
            return None
        variables = [decoded(one) for one in told["variables"]]
        scenario: Scenario = decoded(told["scenario"])
    except (OSError, ValueError, TypeError, LookupError, AttributeError, TwinError):
        return None  # nothing is kept, or something that it was made from is gone: whoever checks it will say so
    return scenario, {
        variant: {member: variables[number] for member, number in members.items()}
        for variant, members in told["catalogs"].items()
    }


def keep(place: Path, scenario: Scenario, catalogs: Mapping[str, Catalog]) -> None:
    """Keep a scenario, if it is nothing but data: parts of other scenarios and analyses are code that may change."""
    specs = [spec for case in scenario.variants for spec in case.members.values()]
    if scenario.analyses or scenario.scenes or any(spec.made for spec in specs):
        return
    numbers: dict[int, int] = {}
    variables: list[Any] = []
    try:
        for case in catalogs.values():
            for one in case.values():
                if id(one) not in numbers:
                    numbers[id(one)] = len(variables)
                    variables.append(encoded(one))
        told = {
            "made_from": made_from(sorted(files(scenario)), sorted({spec.component for spec in specs})),
            "scenario": encoded(replace(scenario, text=scenario.frozen())),
            "variables": variables,
            "catalogs": {
                variant: {member: numbers[id(one)] for member, one in case.items()}
                for variant, case in catalogs.items()
            },
        }
        text = json.dumps(told)
        if len(text) < LARGEST:
            compiler.put(place, f"{digest(text)}\n{text}".encode())
    except (TypeError, OSError, TwinError):
        return  # something that is no plain data, or no place to keep it


def made_from(
    names: Sequence[str] | Mapping[str, str], components: Sequence[str] | Mapping[str, str]
) -> dict[str, Any]:
    """Hashes of all that decides what a scenario is and whether it is right."""
    return {
        "engine": engine(),
        "files": {name: hashlib.sha256(Path(name).read_bytes()).hexdigest() for name in names},
        "components": {name: content(name) for name in components},
    }


def files(scenario: Scenario) -> set[str]:
    """Every file that something in the scenario comes from."""

    def places(node: Node) -> Iterator[str]:
        yield node.place.file
        for one in (*node.entries.values(), *node.items):
            yield from places(one)

    return {name for tree in (scenario.tree, scenario.written) for name in places(tree) if Path(name).is_file()}


def content(component: str) -> str:
    """Hash of an FMU's file, or of all that a component's FMU would be made from."""
    if component.endswith(".fmu"):
        return hashlib.sha256(Path(component).read_bytes()).hexdigest()
    return built.made_from(catalog.component(component), "3.0")


@cache
def engine() -> str:
    """Hash of the engine's files by name, size and time, and of the libraries' versions."""
    words = [f"{name} {installed.version(name)}" for name in LIBRARIES]
    for folder, _, names in os.walk(ENGINE):
        for name in names:
            if name.endswith(".py"):
                told = os.stat(f"{folder}{os.sep}{name}")  # noqa: PTH116 - two hundred files
                words.append(f"{folder} {name} {told.st_size} {told.st_mtime_ns}")
    return digest(*sorted(words))


def digest(*words: str) -> str:
    """Hash of texts."""
    return hashlib.sha256("\0".join(words).encode()).hexdigest()


def encoded(value: Any) -> Any:
    """As JSON has it: what is no text, number or list, as a dict of its kind and content; TypeError for other things."""
    match value:
        case None | bool() | str():
            return value
        case np.generic() if value.dtype.kind != "O":
            return {"scalar": [value.dtype.str, value.item()]}
        case int() | float():
            return value
        case list():
            return [encoded(one) for one in value]
        case tuple():
            return {"tuple": [encoded(one) for one in value]}
        case Mapping():
            return {"dict": [[encoded(key), encoded(one)] for key, one in value.items()]}
        case Path():
            return {"path": str(value)}
        case np.dtype():
            return {"dtype": value.str}
        case np.ndarray():
            return {"array": [value.dtype.str, list(value.shape), [encoded(one) for one in value.reshape(-1).tolist()]]}
        case bytes():
            return {"bytes": value.hex()}
        case Expression():
            return {"expression": value.text}
    if type(value).__name__ in KINDS and is_dataclass(value):
        return {type(value).__name__: [encoded(getattr(value, one.name)) for one in fields(value)]}
    raise TypeError(f"{type(value).__name__} is no plain data")


DECODERS: dict[str, Callable[[Any], Any]] = {
    "scalar": lambda told: np.dtype(told[0]).type(told[1]),
    "tuple": lambda told: tuple(map(decoded, told)),
    "dict": lambda told: {decoded(key): decoded(one) for key, one in told},
    "path": Path,
    "dtype": np.dtype,
    "array": lambda told: np.array([decoded(one) for one in told[2]], told[0]).reshape(told[1]),
    "bytes": bytes.fromhex,
    "expression": expression.parse,
}


def decoded(value: Any) -> Any:
    """What was encoded."""
    if isinstance(value, list):
        return [decoded(one) for one in value]
    if not isinstance(value, dict):
        return value
    ((kind, told),) = value.items()
    if kind in KINDS:
        return KINDS[kind](*map(decoded, told))
    return DECODERS[kind](told)
