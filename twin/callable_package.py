"""Packages that are also the function of their name, such as `twin.run`."""

import importlib
import inspect
import sys
from types import ModuleType
from typing import Any


class CallablePackage:
    """A package that is also the function of its name in `twin.face`: `twin.run("heart_wall_force")`.

    It is no `ModuleType`: `help(twin.run)` would list the modules of the package instead of the function. `__get__` makes it a
    routine for `inspect`, so that `help(twin.run)` and `help(twin)` show it like any function.
    """

    def __init__(self, package: ModuleType) -> None:
        self.__dict__ = vars(package)  # the same attributes, whether package or function sets them

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Call the function."""
        return self.__wrapped__(*arguments, **options)

    def __getattr__(self, name: str) -> Any:
        if name != "__getattr__" and "__getattr__" in vars(self):  # of modules, PEP 562
            return vars(self)["__getattr__"](name)
        raise AttributeError(f"package {self.__name__} has no attribute {name!r}")

    def __dir__(self) -> list[str]:
        own = vars(self).get("__dir__", lambda: list(vars(self)))
        return list(own())

    def __repr__(self) -> str:
        return f"<function {self.__name__}, and the package of its name>"

    def __get__(self, instance: object, owner: type | None = None) -> "CallablePackage":
        return self

    @property
    def __wrapped__(self) -> Any:
        """The function: `inspect` and notebooks show its signature."""
        return getattr(importlib.import_module("twin.face"), self.__name__.rpartition(".")[2])

    @property
    def __doc__(self) -> str:  # type: ignore[override]
        """Docstring of the function."""
        return inspect.getdoc(self.__wrapped__) or ""


CallablePackage.__name__ = "function"  # what `help` calls it


def make_callable(package: str) -> None:
    """Let an imported package be the function of its name, too."""
    sys.modules[package] = CallablePackage(sys.modules[package])  # type: ignore[assignment]
