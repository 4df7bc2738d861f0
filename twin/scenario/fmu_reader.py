"""An FMU as a scenario of one member, with the start, stop and step that it suggests."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from twin import clock
from twin.errors import FMUError, ScenarioError
from twin.scenario.yaml_files.yaml_node import Node, SourceLocation

if TYPE_CHECKING:
    from pathlib import Path

SUFFIX = ".fmu"


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
    tree = {
        "title": f"{path.name} alone",
        "start_time": clock.exact_text(planned.start),
        "stop_time": clock.exact_text(planned.stop),
        "step": clock.exact_text(planned.step),
        "members": {name: {"component": str(path.resolve())}},
    }
    if not any(variable.causality == "output" for variable in part.variables.values()):
        tree["record"] = {"variables": [f"{name}.{variable}" for variable in planned.record]}
    return Node.of(tree, SourceLocation(shown))
