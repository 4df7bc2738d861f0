"""Scenario of a single FMU for the console: one member, its DefaultExperiment, a plot for each unit of its outputs."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import yaml

from twin import clock
from twin.files import write_atomically
from twin.fmi import member, plan

if TYPE_CHECKING:
    from pathlib import Path

    from twin.coupling import MemberVariable

MAX_PLOTS, MAX_CURVES = 3, 8
NUMBERS = ("Float", "Int", "UInt")  # beginnings of FMI types that a chart shows


def write_fmu_scenario(fmu: Path, folder: Path) -> Path:
    """Write the scenario of an FMU to `folder`; return its path. FMUError if the FMU cannot be loaded."""
    loaded = member(fmu.stem, fmu)
    try:
        planned, variables = plan(loaded), dict(loaded.variables)
    finally:
        loaded.close()
    name = re.sub(r"\W", "_", fmu.stem)
    name = name if name.isidentifier() else f"fmu_{name}"
    content: dict[str, Any] = {
        "title": fmu.name,
        "start_time": clock.exact_text(planned.start),
        "stop_time": clock.exact_text(planned.start + planned.steps * planned.step),
        "step": clock.exact_text(planned.step),
        "members": {name: {"component": str(fmu.resolve())}},
        "plots": plots(name, variables),
        "console": {"parameters": {f"{name}.{key}": [] for key, each in variables.items() if is_settable(each)}},
    }
    target = folder / f"{name}.yaml"
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(target, yaml.safe_dump(content, sort_keys=False, allow_unicode=True))
    return target


def is_settable(variable: MemberVariable) -> bool:
    """Return whether a person can set a variable while the FMU runs."""
    is_tunable = variable.causality == "parameter" and variable.variability == "tunable"
    return (is_tunable or variable.causality == "input") and variable.connectable and not variable.shape


def plots(name: str, variables: dict[str, MemberVariable]) -> list[dict[str, Any]]:
    """Return a plot for each unit of the scalar numeric outputs of the member `name`."""
    by_unit: dict[str, list[str]] = {}
    for key, variable in variables.items():
        if variable.causality == "output" and not variable.shape and variable.type.startswith(NUMBERS):
            by_unit.setdefault(variable.unit, []).append(f"{name}.{key}")
    return [
        {"title": f"Outputs {number}" if number > 1 else "Outputs", "signals": signals[:MAX_CURVES]}
        for number, signals in enumerate(list(by_unit.values())[:MAX_PLOTS], 1)
    ]
