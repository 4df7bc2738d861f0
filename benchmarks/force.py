"""The force experiment on one core: how many times faster than real time, and which member takes how much of it.

    python -m benchmarks.force           prints `name: value` lines

The real-time factor is simulated time over the wall time of the stepping alone, recording as the scenario says. What a
member costs is measured where it works: eight copies of it with the same inputs are added to the scenario, which
nothing reads and which are not recorded; an eighth of what the stepping then takes longer than just before is its
cost, with the connections of its inputs. Held inputs would not do, since some members take less work at rest. What the
members' costs leave of the whole is the loop and recording.
"""

from __future__ import annotations

import contextlib
import os
import statistics
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from twin.coupling import CoSimulation
from twin.run import build_simulation, resolve_catalogs
from twin.scenario import Backend, ConnectionSpec, load_scenario

if TYPE_CHECKING:
    from twin.coupling import Catalog
    from twin.scenario import Case

BUILD = Path("build")
SCENARIO = Path("scenarios/heart_wall_force.yaml")
REPEATS = 7
COPIES = 8
INTERPRETED_NS = 200_000_000  # simulated time of the interpreted form


def one_core() -> None:
    """Stay on one core from now on, if this system can."""
    with contextlib.suppress(AttributeError, OSError):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def with_copies(case: Case, catalog: Catalog, name: str) -> tuple[Case, Catalog]:
    """The case with copies of one member that take the same inputs; only what was recorded is."""
    copies = [f"{name}_{i}" for i in range(COPIES)]
    taken = [one for one in case.system(catalog).single()[0] if one.target.startswith(f"{name}.")]
    added = [ConnectionSpec(one.source, copy + one.target.removeprefix(name)) for copy in copies for one in taken]
    return replace(
        case,
        members={**case.members, **dict.fromkeys(copies, case.members[name])},
        connections=(*case.connections, *added),
        record=replace(case.record, patterns=tuple(case.record.select(catalog))),
    ), {**catalog, **dict.fromkeys(copies, catalog[name])}


def stepping(case: Case, catalog: Catalog, form: Backend, stop: int) -> float:
    """Wall time of the stepping until `stop` [s]."""
    simulated: CoSimulation = build_simulation(case, catalog, form, BUILD)
    simulated.initialize(case.start_ns, stop)
    begin = time.perf_counter()
    simulated.advance(stop)
    took = time.perf_counter() - begin
    simulated.terminate()
    return took


def figures(head: str, case: Case, catalog: Catalog, repeats: int, interpreted_ns: int) -> None:
    """Print a case's real-time factors, what a step costs with FMUs, and what each member takes of it."""
    fmus: list[float] = []
    compiled: list[float] = []
    added: dict[str, list[float]] = {name: [] for name in case.members}
    for _ in range(repeats):
        for name, costs in added.items():
            fmus.append(stepping(case, catalog, Backend.fmu, case.stop_ns))
            more = stepping(*with_copies(case, catalog, name), Backend.fmu, case.stop_ns)
            compiled.append(stepping(case, catalog, Backend.compiled, case.stop_ns))
            costs.append((more - fmus[-1]) / COPIES)
    interpreted = stepping(case, catalog, Backend.interpreted, case.start_ns + interpreted_ns)
    span = 1e-9 * (case.stop_ns - case.start_ns)
    print(f"{head}_fmu_factor: {span / statistics.median(fmus):.0f}")
    print(f"{head}_compiled_factor: {span / statistics.median(compiled):.0f}")
    print(f"{head}_interpreted_factor: {1e-9 * interpreted_ns / interpreted:.2f}")
    scale = case.step_ns / span
    step = scale * statistics.median(fmus)
    own = {name: scale * statistics.median(costs) for name, costs in added.items()}
    print(f"{head}_step_ns: {step:.0f}")
    print(f"{head}_step_per_member_ns: {step / len(own):.0f}")
    for name, cost in {**own, "rest": step - sum(own.values())}.items():
        print(f"{head}_step_{name}_ns: {cost:.0f}")
        print(f"{head}_step_{name}_share: {cost / step:.3f}", flush=True)


def measure(overrides: tuple[str, ...] = (), repeats: int = REPEATS) -> None:
    """Print the figures of every variant, with the first seed."""
    scenario = load_scenario(SCENARIO, overrides)
    catalogs = resolve_catalogs(scenario)
    for case in scenario.variants:
        figures(f"force_{case.variant}", case, catalogs[case.variant], repeats, INTERPRETED_NS)


def main() -> None:
    """Print the figures, on one core."""
    one_core()
    measure()


if __name__ == "__main__":
    main()
