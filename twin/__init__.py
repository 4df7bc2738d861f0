"""Digital twins of robotic catheters: components, native FMUs and a compiled co-simulation loop.

    run = twin.run("heart_wall_force", variants=["PI"], values={"heart.rate": "1.4 Hz"})
    run.metrics; run["sensor.measured_force"]; run.plot("Contact force")

    with twin.live("heart_wall_force", "PI") as simulation:
        simulation.advance("5 s"); simulation["controller.setpoint"] = "0.3 N"

What the command line does, as objects; `twin.face` has them. Nothing is imported before it is used.
"""

import importlib
import inspect
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
]
PACKAGES = ("follow", "live", "run")  # that are functions, too

if not TYPE_CHECKING:  # else any name would be one
    __getattr__, _, _ = lazy_loader.attach(
        __name__,
        submodules=PACKAGES,
        submod_attrs={
            "errors": ["TwinError"],
            "face": [name for name in __all__ if name not in ("TwinError", *PACKAGES)],
        },
    )


class CallablePackage(ModuleType):
    """A package that is also the function of its name in `twin.face`: `twin.run("heart_wall_force")`."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return self.__wrapped__(*arguments, **options)

    @property
    def __wrapped__(self) -> Any:
        """The function: `inspect` and notebooks show its signature."""
        return getattr(importlib.import_module("twin.face"), self.__name__.rpartition(".")[2])

    @property
    def __doc__(self) -> str:  # type: ignore[override]
        """Docstring and signature of the function, then what the package holds: what `help(twin.run)` shows."""
        function, own = self.__wrapped__, vars(self).get("__doc__")
        synopsis, _, text = (inspect.getdoc(function) or "").partition("\n")
        parameters = inspect.signature(function).parameters.values()
        is_keyword = [parameter.kind is parameter.KEYWORD_ONLY for parameter in parameters]
        lines = [
            f"    {parameter.name}: {parameter.annotation}"
            f"{'' if parameter.default is parameter.empty else f' = {parameter.default!r}'},"
            for parameter in parameters
        ]
        if True in is_keyword:
            lines.insert(is_keyword.index(True), "    *,")
        signature = [f"{self.__name__}(", *lines, f") -> {inspect.signature(function).return_annotation}"]
        return "\n".join([synopsis, "", *signature, text, "", f"The package: {own}"])


def __dir__() -> list[str]:
    """Public names, for `dir(twin)` and completion: no module of the engine, and nothing that this file imports."""
    return sorted({*__all__, "__doc__", "__file__", "__path__", "__version__"})
