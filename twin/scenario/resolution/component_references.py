"""Components made from files: a table, `command.csv`, or a group of another scenario, `rig.yaml#rig` or `rig.yaml#rig@variant`.

A group becomes one compiled component with the other scenario's values as its start values.
"""

from __future__ import annotations

from contextvars import ContextVar
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from twin.errors import ScenarioError, TwinError
from twin.scenario.grouping import group
from twin.scenario.resolution.variable_names import nearest
from twin.scenario.resolution.variable_resolution import resolve_case
from twin.scenario.scenario_paths import missing_file_advice
from twin.scenario.yaml_files.member_removal import members

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.component import Component
    from twin.scenario.spec import ScenarioSpec
    from twin.scenario.yaml_files.yaml_node import Node

DEEPEST = 20  # levels of nested groups
_above: ContextVar[tuple[str, ...]] = ContextVar("above", default=())  # files that are being resolved, to detect cycles


def is_group(component: object) -> bool:
    """Whether a member's component is a group of another scenario."""
    return isinstance(component, str) and component.partition("#")[0].endswith((".yaml", ".yml")) and "#" in component


def is_table(component: object) -> bool:
    """Whether a member's component is a CSV file of values over time."""
    return isinstance(component, str) and component.endswith(".csv")


def table(path: str) -> type[Component]:
    """Create the component class of a CSV file of values over time."""
    from twin.fmi import csv_source

    return csv_source.component(path)


def components(
    trees: dict[str, Node], load: Callable[[str], ScenarioSpec]
) -> tuple[dict[str, type[Component]], list[str]]:
    """Create the components of all groups and tables of the members: reference -> class, and problems. `load` reads a scenario."""
    classes: dict[str, type[Component]] = {}
    problems: dict[str, None] = {}
    read = cache(partial(read_part, load=load))  # several groups of a file
    for tree in trees.values():
        for name, member in members(tree).items():
            node = member.get("component")
            if not (is_group(node.value) or is_table(node.value)) or node.value in classes:
                continue
            try:
                classes[node.value] = table(node.value) if is_table(node.value) else component(node.value, read)
            except TwinError as error:
                problems |= dict.fromkeys(f"{node.location}: member `{name}`: {message}" for message in error.problems)
    return classes, list(problems)


def component(reference: str, read: Callable[[str], ScenarioSpec]) -> type[Component]:
    """Create the component class of `path.yaml#group@variant`. `read`: of `read_part`."""
    path, _, rest = reference.partition("#")
    name, _, variant = rest.partition("@")
    scenario = read(path)
    if name not in scenario.groups:
        hint = nearest(name, scenario.groups) or " Name its members under `groups` there."
        raise ScenarioError(f"{path} has no group `{name}`.{hint}")
    case = scenario.cases([variant] if variant else [])[0]
    variables = resolve_case(case)
    title = "_".join(part for part in (Path(path).stem, name, variant) if part)
    cls_name = "".join(letter if letter.isalnum() else "_" for letter in title)
    return group(cls_name, case, variables, list(scenario.groups[name]))


def read_part(path: str, load: Callable[[str], ScenarioSpec]) -> ScenarioSpec:
    """Load a scenario whose groups are members of another one."""
    if path in _above.get():
        raise ScenarioError(f"{path} is a part of itself. Break the circle.")
    if len(_above.get()) >= DEEPEST:
        raise ScenarioError(
            f"{path}: groups lie in each other more than {DEEPEST} deep. Name the inner members directly."
        )
    if not Path(path).is_file():
        raise ScenarioError(f"there is no file {path}. {missing_file_advice(Path(path))}")
    token = _above.set((*_above.get(), path))
    try:
        return load(path)
    finally:
        _above.reset(token)
