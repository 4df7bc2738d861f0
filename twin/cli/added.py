"""Commands of packages above the engine: entry points of the group `twin.commands`, so that `twin` need not know them."""

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
def added() -> dict[str, EntryPoint]:
    """Commands of other packages, by name."""
    return installed.entry_points("twin.commands")


def summary(name: str) -> str:
    """What a command says of itself in one line, from its source: importing it would import all that it stands on."""
    try:
        said = _said(name)
    except (OSError, SyntaxError, ValueError, ImportError):
        said = None
    command: click.Command = said or added()[name].load()
    return command.get_short_help_str(limit=WIDTH)


def _said(name: str) -> click.Command | None:
    """A command that has only its help, as its decorator and its docstring give it; None if they do not show."""
    module, _, function = added()[name].value.partition(":")
    top, *rest = module.split(".")
    spec = importlib.util.find_spec(top)
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        tree = ast.parse(Path(folder, *rest).with_suffix(".py").read_text(encoding="utf-8"))
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and node.name == function:
                calls = [one for one in node.decorator_list if isinstance(one, ast.Call)]
                words = {
                    word.arg: ast.literal_eval(word.value)
                    for one in calls
                    for word in one.keywords
                    if word.arg in ("help", "short_help", "deprecated")
                    and ast.unparse(one.func) in ("click.command", "click.group")
                }
                return click.Command(name, **{"help": ast.get_docstring(node), **words})
    return None
