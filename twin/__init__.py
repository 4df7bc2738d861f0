"""Digital twins of robotic catheters: components, native FMUs and a compiled co-simulation loop.

    run = twin.run("heart_wall_force", variants=["PI"], values={"heart.rate": "1.4 Hz"})
    run.metrics; run["sensor.measured_force"]; run.plot("Contact force")

    with twin.live("heart_wall_force", "PI") as simulation:
        simulation.advance("5 s"); simulation["controller.setpoint"] = "0.3 N"

Functions: run, live, load, study, open_run, open_study, follow, simulate, export; `help(twin.run)` tells the arguments.
Classes: Run, Scenario, Simulation, StudyResult, System, TwinError. The packages below are the engine; you need none of them.
"""

import typing as _typing  # private names: completion in an editor shows the others

import lazy_loader as _lazy_loader

if _typing.TYPE_CHECKING:
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
_PACKAGES = ("follow", "live", "run", "study")  # that are functions, too

if not _typing.TYPE_CHECKING:  # else any name would be one
    _attribute, _, _ = _lazy_loader.attach(
        __name__,
        submodules=_PACKAGES,
        submod_attrs={
            "errors": ["TwinError"],
            "face": [name for name in __all__ if name not in ("TwinError", *_PACKAGES)],
        },
    )

    def __getattr__(name: str) -> object:
        """Import a public name; of a method of a run, such as `compare`, say so."""
        try:
            return _attribute(name)
        except AttributeError:
            if name in ("branch", "compare", "metrics", "plot", "resume", "signals"):
                hint = f"It belongs to a run: run.{name}, with run = twin.run(...) or twin.open_run(...)."
                raise AttributeError(f"module 'twin' has no attribute {name!r}. {hint}") from None
            raise


def __dir__() -> list[str]:
    """Public names, for `dir(twin)` and completion: no module of the engine, and nothing that this file imports."""
    return sorted({*__all__, "__doc__", "__file__", "__path__", "__version__"})
