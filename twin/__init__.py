"""Digital twins of robotic catheters: components, native FMUs and a compiled co-simulation loop.

    scenario = twin.load("scenarios/heart_wall_force.yaml")
    run = scenario.set("heart.rate", "1.4 Hz").run(variants=["PI"], seeds=[1])
    run.metrics; run["sensor.measured_force"]; run.plot("Contact force")

What the command line does, as objects; `twin.face` has them. Nothing is imported before it is used.
"""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.errors import TwinError
    from twin.face import Run, Scenario, Simulation, System, export, load, open_run, simulate

__version__ = "0.1.0"

__all__ = ["Run", "Scenario", "Simulation", "System", "TwinError", "export", "follow", "load", "open_run", "simulate"]

if not TYPE_CHECKING:  # else any name would be one
    __getattr__, _, _ = lazy_loader.attach(
        __name__,
        submodules=["follow"],  # a package that can be called
        submod_attrs={
            "errors": ["TwinError"],
            "face": [name for name in __all__ if name not in ("TwinError", "follow")],
        },
    )


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
