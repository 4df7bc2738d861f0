"""Packages whose functions a test of a command replaces: their own imports, up to a second each, are left out."""

import ast
import sys
from pathlib import Path
from types import SimpleNamespace

import twin


def replace(monkeypatch, package, **functions):
    """Let a command import these functions from a package; their names must be those that the package offers."""
    text = Path(twin.__file__).parent.joinpath(*package.split(".")[1:], "__init__.py").read_text()
    assert functions.keys() <= set(ast.literal_eval(text.partition("__all__ = ")[2].partition("]")[0] + "]"))
    monkeypatch.setitem(sys.modules, package, SimpleNamespace(**functions))


class Calls(list):
    """Records calls: `calls("name", result)` is a function that returns `result`."""

    def __call__(self, name, result=None):
        def call(*arguments, **options):
            self.append((name, *arguments, *([options] if options else [])))
            return result

        return call
