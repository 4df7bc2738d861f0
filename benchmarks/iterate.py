"""What iterating and choosing steps cost: rings of cheap FMUs beside the fixed C loop, and the force scenario.

    python benchmarks/iterate.py         prints `name: value` lines; times are ns per member and sweep

A sweep steps every member once. Each but the first of a step also brings all of them back, and each step keeps their states
once; the C loop (ring.c) does neither. Both take turns; the median of the paired ratios counts.
"""

from __future__ import annotations

import statistics
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from benchmarks.parts import Drift, Relay
from benchmarks.ring import BUILD, c_loop, time_c
from twin.coupling import Algorithm, Connection, CoSimulation, CoupledSystem
from twin.fmi import FMUMember
from twin.fmi.exporting import exporter
from twin.run import build_simulation, noop, resolve_catalogs, run_case
from twin.scenario import Backend, load_scenario

MS = 1_000_000  # [ns]
REPEATS = 9
CALLS = 500_000  # members times steps of one measurement
FORCE = "scenarios/heart_wall_force.yaml"
RUNS = ("jacobi", "iterative", "step_doubling", "predictive")


def time_ours(path: Path, members: int, steps: int) -> tuple[float, float]:
    """Ns per member and sweep, and sweeps per step."""
    ring = {f"m{i}": FMUMember(f"m{i}", path) for i in range(members)}
    wires = [Connection(f"m{i - 1 if i else members - 1}.y", f"m{i}.u") for i in range(members)]
    links = CoupledSystem({name: member.variables for name, member in ring.items()}, wires).links()
    simulation = CoSimulation(ring, links, MS, Algorithm("iterative", agreement=1e-9), build=BUILD)
    simulation.initialize(0, steps * MS)
    begin = time.perf_counter()
    simulation.advance(steps * MS)
    took = time.perf_counter() - begin
    sweeps = int(simulation.state["sweeps"])
    simulation.terminate()
    return 1e9 * took / (sweeps * members), sweeps / steps


def time_force(algorithm: str, stop: str = "22 s") -> float:
    """Processor time of the force scenario [s]; step control without rejecting: as many steps as `jacobi`."""
    options = [] if algorithm in ("jacobi", "iterative") else ["algorithm.tolerance=1", "algorithm.smallest=0.5 ms"]
    scenario = load_scenario(FORCE, ["seeds=1", f"stop_time={stop}", f"algorithm={algorithm}", *options])
    case = scenario.cases()[0]
    simulated = build_simulation(case, resolve_catalogs(scenario)[case.variant], Backend.fmu, BUILD)
    begin = time.process_time()
    run_case(case, simulated, noop)
    took = time.process_time() - begin
    simulated.terminate()
    return took


def main() -> None:
    """Print the figures."""
    program = c_loop()
    for version in ("2.0", "3.0"):
        fixed, drifting = exporter.build(Relay, version, BUILD), exporter.build(Drift, version, BUILD)
        for members in (2, 8, 32):
            steps = CALLS // members
            ours, theirs, sweeps = [], [], 0.0
            for _ in range(REPEATS):
                taken, sweeps = time_ours(drifting, members, steps)
                ours.append(taken)
                theirs.append(time_c(program, version, fixed, members, steps)[0])
            name = f"iterate_fmi{version[0]}_{members}"
            print(f"{name}_sweeps: {sweeps:.2f}")
            print(f"{name}_ns: {statistics.median(ours):.2f}")
            print(f"{name}_ratio: {statistics.median(a / b for a, b in zip(ours, theirs, strict=True)):.3f}")
            print(f"{name}_best_ratio: {min(ours) / min(theirs):.3f}", flush=True)
    best = {one: min(time_force(one) for _ in range(REPEATS)) for one in RUNS}
    for one in RUNS[1:]:
        print(f"force_{one}_ratio: {best[one] / best['jacobi']:.3f}", flush=True)


if __name__ == "__main__":
    main()
