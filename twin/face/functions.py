"""Functions that run, step or follow a file in one call."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin.face.scenario import Scenario, load

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from twin.face.finished_run import Run
    from twin.face.progress import Progress
    from twin.face.simulation import Simulation
    from twin.follow import Following


def run(
    scenario: str | Path | Scenario,
    variants: str | Sequence[str] | None = None,
    seeds: int | Sequence[int] | None = None,
    *,
    values: Mapping[str, Any] | None = None,
    progress: Progress = None,
    report: bool = True,
    out: str | Path = "runs",
    build: str | Path = "build",
    backend: str = "fmu",
    checkpoint: float | str = 0.0,
) -> Run:
    """Run a scenario, by its path or the name of a shipped one, with changed `values`; ScenarioError with all `problems`.

        run = twin.run("heart_wall_force", "PI", values={"heart.rate": "1.4 Hz"})
        run.metrics; run["sensor.measured_force"]

    `values`: by name, as of `Scenario.set`. `variants`, `seeds`: all of the scenario by default. `progress`: True for a bar,
    or a callback. `report`: whether report.html is written. `out`: folder of the run folders, `build`: of compiled FMUs.
    `backend`: fmu, compiled or interpreted. `checkpoint`: simulated time [s] between checkpoints; 0: none.
    """
    return with_values(scenario, values).run(
        variants,
        seeds,
        progress=progress,
        report=report,
        out=out,
        build=build,
        backend=backend,
        checkpoint=checkpoint,
    )


def live(
    scenario: str | Path | Scenario,
    variant: str | None = None,
    seed: int | None = None,
    *,
    values: Mapping[str, Any] | None = None,
    rate: float = 1.0,
    backend: str = "compiled",
    build: str | Path = "build",
) -> Simulation:
    """Initialize one case of a scenario and return it as a simulation that `advance` paces against the wall clock.

        with twin.live("heart_wall_force", "PI") as simulation:
            simulation.advance("5 s")
            simulation["controller.setpoint"] = "0.3 N"
            simulation.advance(until=simulation.stop_time)

    `rate`: simulated over wall-clock time, 0.1 to 10, or inf: as fast as possible. `values`: by name, as of `Scenario.set`,
    also of fixed parameters. All else as of `Scenario.simulate`; signals are those of `run` to the bit if nothing is set.
    """
    simulation = with_values(scenario, values).simulate(variant, seed, backend=backend, build=build)
    simulation.rate = rate
    return simulation


def with_values(scenario: str | Path | Scenario, values: Mapping[str, Any] | None) -> Scenario:
    """Return a scenario with changed values."""
    changed = scenario if isinstance(scenario, Scenario) else load(scenario)
    for name, value in (values or {}).items():
        changed = changed.set(name, value)
    return changed


def follow(
    file: str | Path,
    *,
    recording: str | Path | None = None,
    rig: str | Path | None = None,
    build: str | Path = "build",
) -> Following:
    """Return the estimates of a follow file's recording or rig, to be iterated; ScenarioError with all problems."""
    from twin.follow import Following

    return Following(file, recording, rig, build)
