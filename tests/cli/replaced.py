"""Packages whose functions a test of a command replaces: their own imports, up to a second each, are left out."""

import sys
from pathlib import Path
from types import SimpleNamespace

import twin
from tests.public_names import public_names


def replace(monkeypatch, package, **functions):
    """Let a command import these functions from a package; their names must be those that the package offers."""
    assert functions.keys() <= public_names(Path(twin.__file__).parent.joinpath(*package.split(".")[1:]))
    monkeypatch.setitem(sys.modules, package, SimpleNamespace(**functions))


class Calls(list):
    """Records calls: `calls("name", result)` is a function that returns `result`."""

    def __call__(self, name, result=None):
        def call(*arguments, **options):
            self.append((name, *arguments, *([options] if options else [])))
            return result

        return call
