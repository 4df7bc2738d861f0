"""Computing time of a cycle of following: 25 points of the whole force scenario, every 5 ms, on one core.

    python -m benchmarks.follow_cycle           prints `name: value` lines

The rig is a simulation of the same scenario. A bare loop, which only waits for the next period, and the follower take turns of
one second each in one run, so that both see the same other work on the machine. `lateness` is that of the begin of a cycle;
computing time is wall time from the begin of `advance` to the end of `correct`.
"""

from __future__ import annotations

import gc
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.force import one_core
from twin.follow import Follower, load
from twin.follow.problem import times_of
from twin.run import build_simulation, resolve_catalogs
from twin.scenario import Backend, load_scenario

BUILD = Path("build")
SCENARIO = Path("scenarios/heart_wall_force.yaml").resolve()
VARIANT = "PI+FF+BW"
CYCLE = 5e-3  # [s]
SECONDS = 21  # followed in one pass: the scenario takes 22 s
PASSES = 3
GOALS = {"p99": 2.5e-3, "p99.9": 4e-3}  # [s]
NOISES = {"sensor.measured_force": (3e-3, "N"), "servomotor.position_actual_value": (20e-6, "m")}

FOLLOW = f"""
scenario: {SCENARIO}
variant: {VARIANT}
data: rig.csv
outputs:
  "sensor.measured_force [N]": {{signal: sensor.measured_force, noise: 5 mN}}
  "servomotor.position_actual_value [m]": {{signal: servomotor.position_actual_value, noise: 20 um}}
estimate:
  sheath.position[1]: {{deviation: 0.1 mm, walk: 0.05 mm}}
  sheath.position[2]: {{deviation: 0.1 mm, walk: 0.05 mm}}
  sheath.position[3]: {{deviation: 0.1 mm, walk: 0.05 mm}}
  wall.indentation: {{deviation: 0.1 mm, walk: 0.05 mm}}
  servomotor.rod_position: {{deviation: 0.05 mm, walk: 0.05 mm}}
  servomotor.rod_velocity: {{deviation: 1 mm/s, walk: 1 mm/s}}
  servomotor.winding_current: {{deviation: 0.01 A, walk: 0.01 A}}
  servomotor.current_integral: {{deviation: 0.01 A, walk: 0.01 A}}
  sheath.play[3]: {{deviation: 0.05 mm, walk: 0.005 mm, from: 0 mm, to: 1 mm}}
  sheath.friction[2]: {{deviation: 0.1 N, walk: 0.01 N, from: 0.1 N, to: 3 N}}
  wall.surface_position: {{deviation: 0.2 mm, walk: 0.02 mm}}
  wall.wall_modulus: {{deviation: 5 kPa, walk: 1 kPa, from: 50 kPa, to: 300 kPa}}
"""


def record(folder: Path) -> None:
    """Write a recording of the simulated rig."""
    scenario = load_scenario(SCENARIO)
    (case,) = (case for case in scenario.variants if case.variant == VARIANT)
    simulation = build_simulation(case, resolve_catalogs(scenario)[VARIANT], Backend.compiled, BUILD)
    simulation.initialize(case.start_ns, case.stop_ns)
    simulation.advance(case.stop_ns)
    recording, random = simulation.recording(), np.random.default_rng(1)
    simulation.terminate()
    columns = [recording.time]
    for name, (deviation, _) in NOISES.items():
        columns.append(recording.signals[name] + deviation * random.standard_normal(len(recording.time)))
    header = ",".join(["time [s]", *(f"{name} [{unit}]" for name, (_, unit) in NOISES.items())])
    np.savetxt(folder / "rig.csv", np.column_stack(columns), "%.9g", ",", header=header, comments="")
    (folder / "follow.yaml").write_text(FOLLOW)


def wait(until: float) -> float:
    """Sleep until a time; return how much later it is."""
    while (left := until - time.perf_counter()) > 0.0:
        time.sleep(left)
    return -left


def measure(folder: Path, passes: int) -> tuple[list[float], list[float], list[float]]:
    """Return lateness of the bare loop and of the follower's cycles, and computing times [s]."""
    problem, period = load(folder / "follow.yaml"), round(1.0 / CYCLE)
    bare, late, computing = [], [], []
    times = list(times_of(problem).items())
    for _ in range(passes):
        with Follower(problem, BUILD) as follower:
            print(f"follow_points: {follower.batch.count}")
            gc.collect()
            gc.freeze()
            gc.disable()
            for first in range(0, SECONDS * period, period):
                begin = time.perf_counter() + CYCLE
                bare += [wait(begin + i * CYCLE) for i in range(period)]
                begin = time.perf_counter() + CYCLE
                for i, (tick, measurements) in enumerate(times[first : first + period]):
                    late.append(wait(begin + i * CYCLE))
                    start = time.perf_counter()
                    follower.advance(tick)
                    follower.correct(measurements)
                    computing.append(time.perf_counter() - start)
            gc.enable()
    return bare, late, computing


def show(name: str, values: list[float]) -> None:
    """Print percentiles [ms]."""
    for label, quantile in (("p50", 50.0), ("p99", 99.0), ("p99.9", 99.9), ("max", 100.0)):
        print(f"{name}_{label}_ms: {1e3 * np.percentile(values, quantile):.3f}")


def main() -> None:
    """Print the figures, on one core."""
    with tempfile.TemporaryDirectory() as folder:
        record(Path(folder))
        one_core()
        bare, late, computing = measure(Path(folder), PASSES)
    print(f"follow_cycles: {len(computing)}")
    show("follow_bare_lateness", bare)
    show("follow_lateness", late)
    show("follow_computing", computing)
    for label, goal in GOALS.items():
        value = np.percentile(computing, float(label[1:]))
        print(f"follow_computing_{label}_goal: {1e3 * goal:g} ms {'met' if value <= goal else 'missed'}")


if __name__ == "__main__":
    main()
