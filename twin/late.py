"""Lazy attribute access for packages (PEP 562): a module is imported when one of its names is used first."""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping


def names(package: str, places: Mapping[str, str]) -> Callable[[str], Any]:
    """`__getattr__` of a package: its names, each with the module that has it, or "" if it is one."""

    def __getattr__(name: str) -> Any:  # noqa: N807 - so that tracebacks show what it is
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if not places[name]:
            return importlib.import_module(f"{package}.{name}")
        module = importlib.import_module(f"{package}.{places[name]}")

        # all of it: the import itself put the module there, maybe in its function's place
        for one in (one for one, place in places.items() if place == places[name]):
            setattr(sys.modules[package], one, getattr(module, one))
        return getattr(module, name)

    return __getattr__
