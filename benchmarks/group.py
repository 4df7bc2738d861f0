"""A compiled group beside the same members as separate FMUs and as compiled members, in one run.

python -m benchmarks.group            prints `name: value` lines; times are ns per communication step of 1 ms
"""

from __future__ import annotations

import statistics
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from twin.coupling import CoSimulation
from twin.fmi.exporting import exporter
from twin.run import build_simulation, resolve_catalogs
from twin.scenario import Backend, group, load_scenario, make

if TYPE_CHECKING:
    from collections.abc import Callable

BUILD = Path("build")
SCENARIO = Path("scenarios/heart_wall_force.yaml")
SECONDS = 20
REPEATS = 9


def timed(made: CoSimulation) -> float:
    """Time of a communication step [ns]."""
    stop = SECONDS * 1_000_000_000
    made.initialize(0, stop)
    begin = time.perf_counter()
    made.advance(stop)
    took = time.perf_counter() - begin
    made.terminate()
    return 1e9 * took / (stop / made.step)


def main() -> None:
    """The whole force experiment as one group, and as seven members."""
    scenario = load_scenario(SCENARIO)
    catalogs = resolve_catalogs(scenario)
    case = scenario.cases(["PI+FF+BW"])[0]
    catalog = catalogs[case.variant]
    cls = group("force", case, catalog, list(case.members))
    with tempfile.TemporaryDirectory() as folder:
        path = exporter.export(cls, "3.0", Path(folder) / "force.fmu", BUILD)
        ways: dict[str, Callable[[], CoSimulation]] = {
            "group_fmu": lambda: CoSimulation(
                {"force": make("force", str(path), {}, Backend.fmu, BUILD)}, [], case.step_ns, build=BUILD, record=[]
            ),
            "members_fmu": lambda: build_simulation(case, catalog, Backend.fmu, BUILD),
            "members_compiled": lambda: build_simulation(case, catalog, Backend.compiled, BUILD),
        }
        rounds = [{name: timed(way()) for name, way in ways.items()} for _ in range(REPEATS)]
    for name in ways:
        print(f"{name}_ns: {statistics.median(one[name] for one in rounds):.0f}")
    for name in ("members_fmu", "members_compiled"):
        print(f"group_to_{name}_ratio: {statistics.median(one['group_fmu'] / one[name] for one in rounds):.3f}")


if __name__ == "__main__":
    main()
