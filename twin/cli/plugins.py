"""Commands of other packages: entry points of the group `twin.commands`, so that the engine does not depend on them."""

from __future__ import annotations

import ast
import importlib.util
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin import installed

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

WIDTH = 90  # of a command's line in `twin --help`


@cache
def plugin_commands() -> dict[str, EntryPoint]:
    """Entry points of the commands of other packages, by name."""
    return installed.entry_points("twin.commands")


def summary(name: str) -> str:
    """Return the short help of a command, read from its source: an import would load all that it depends on."""
    try:
        command = _parse_command(name)
    except (OSError, SyntaxError, ValueError, ImportError):
        command = None
    command = command or plugin_commands()[name].load()
    assert command is not None
    return command.get_short_help_str(limit=WIDTH)


def _parse_command(name: str) -> click.Command | None:
    """Return a command with the help of its decorator and docstring alone; None if the source does not contain them."""
    module, _, function = plugin_commands()[name].value.partition(":")
    top, *rest = module.split(".")
    spec = importlib.util.find_spec(top)
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        tree = ast.parse(Path(folder, *rest).with_suffix(".py").read_text(encoding="utf-8"))
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and node.name == function:
                calls = [decorator for decorator in node.decorator_list if isinstance(decorator, ast.Call)]
                attributes = {
                    keyword.arg: ast.literal_eval(keyword.value)
                    for call in calls
                    for keyword in call.keywords
                    if keyword.arg in ("help", "short_help", "deprecated")
                    and ast.unparse(call.func) in ("click.command", "click.group")
                }
                return click.Command(name, **{"help": ast.get_docstring(node), **attributes})
    return None
