"""An FMU as a scenario of one member, with the start, stop and step that it suggests and a plot for each unit of its outputs."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.errors import FMUError, ScenarioError
from twin.scenario.yaml_files.yaml_node import Node, SourceLocation

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from twin.coupling import MemberVariable

SUFFIX = ".fmu"
MAX_PLOTS, MAX_CURVES = 3, 8
NUMBERS = ("Float", "Int", "UInt")  # beginnings of FMI types that a chart shows


def read(path: Path, shown: str, _problems: list[str]) -> Node:
    """Return the tree of the scenario; ScenarioError if the FMU cannot be read. Without outputs its locals are recorded."""
    from twin.fmi import member, plan

    name = re.sub(r"\W|^(?=\d)", "_", path.stem)
    try:
        part = member(name, path)
        part.close()
        planned = plan(part)
    except FMUError as error:
        raise ScenarioError(str(error)) from None
    tree: dict[str, Any] = {
        "title": f"{path.name} alone",
        "start_time": clock.exact_text(planned.start),
        "stop_time": clock.exact_text(planned.stop),
        "step": clock.exact_text(planned.step),
        "members": {name: {"component": str(path.resolve())}},
        "plots": plots(name, part.variables),
        "console": {
            "parameters": {f"{name}.{key}": [] for key, variable in part.variables.items() if is_settable(variable)}
        },
    }
    if not any(variable.causality == "output" for variable in part.variables.values()):
        tree["record"] = {"variables": [f"{name}.{variable}" for variable in planned.record]}
    return Node.of(tree, SourceLocation(shown))


def is_settable(variable: MemberVariable) -> bool:
    """Return whether a person can set a variable while the FMU runs."""
    is_tunable = variable.causality == "parameter" and variable.variability == "tunable"
    return (is_tunable or variable.causality == "input") and variable.connectable and not variable.shape


def plots(name: str, variables: Mapping[str, MemberVariable]) -> list[dict[str, Any]]:
    """Return a plot for each unit of the scalar numeric outputs of the member `name`."""
    by_unit: dict[str, list[str]] = {}
    for key, variable in variables.items():
        if variable.causality == "output" and not variable.shape and variable.type.startswith(NUMBERS):
            by_unit.setdefault(variable.unit, []).append(f"{name}.{key}")
    return [
        {"title": f"Outputs {number}" if number > 1 else "Outputs", "signals": signals[:MAX_CURVES]}
        for number, signals in enumerate(list(by_unit.values())[:MAX_PLOTS], 1)
    ]
