"""Digital twins of robotic catheters: components, native FMUs and a compiled co-simulation loop.

    run = twin.run("heart_wall_force", variants=["PI"], values={"heart.rate": "1.4 Hz"})
    run.metrics; run["sensor.measured_force"]; run.plot("Contact force")

    with twin.live("heart_wall_force", "PI") as simulation:
        simulation.advance("5 s"); simulation["controller.setpoint"] = "0.3 N"

What the command line does, as objects; `twin.face` has them. Nothing is imported before it is used.
"""

import importlib
import inspect
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

import lazy_loader

if TYPE_CHECKING:
    from twin.errors import TwinError
    from twin.face import (
        Run,
        Scenario,
        Simulation,
        StudyResult,
        System,
        export,
        follow,
        live,
        load,
        open_run,
        open_study,
        run,
        simulate,
        study,
    )

__version__ = "0.1.0"

__all__ = [
    "Run",
    "Scenario",
    "Simulation",
    "StudyResult",
    "System",
    "TwinError",
    "export",
    "follow",
    "live",
    "load",
    "open_run",
    "open_study",
    "run",
    "simulate",
    "study",
]
PACKAGES = ("follow", "live", "run", "study")  # that are functions, too

if not TYPE_CHECKING:  # else any name would be one
    __getattr__, _, _ = lazy_loader.attach(
        __name__,
        submodules=PACKAGES,
        submod_attrs={
            "errors": ["TwinError"],
            "face": [name for name in __all__ if name not in ("TwinError", *PACKAGES)],
        },
    )


class CallablePackage:
    """A package that is also the function of its name in `twin.face`: `twin.run("heart_wall_force")`.

    It is no `ModuleType`: `help(twin.run)` would list the modules of the package instead of the function. `__get__` makes it a
    routine for `inspect`, so that `help(twin.run)` and `help(twin)` show it like any function.
    """

    def __init__(self, package: ModuleType) -> None:
        self.__dict__ = vars(package)  # the same attributes, whether package or function sets them

    def __call__(self, *arguments: Any, **options: Any) -> Any:
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


def __dir__() -> list[str]:
    """Public names, for `dir(twin)` and completion: no module of the engine, and nothing that this file imports."""
    return sorted({*__all__, "__doc__", "__file__", "__path__", "__version__"})
