"""Computing time of a cycle of following: 25 points of the whole force scenario, every 5 ms, on one core.

    python -m benchmarks.follow_cycle           prints `name: value` lines

The rig is a simulation of the same scenario. A bare loop and the follower take turns of one second each in one run, so that
both see the same other work on the machine. The bare loop waits for the next period, then adds integers for a millisecond
(`bare_computing`): what is longer there is the machine's doing. `lateness` is that of the begin of a cycle; computing time is
wall time from the begin of `advance` to the end of `correct`. All passes compute the same to the bit; `least_computing` is the
shortest time of each cycle in them, that is what it needs where nothing else takes the core. The exported estimator (`twin export --target c`,
compiled by `cc -O2`) gets the same measurements in turns with the follower: a `step` is one communication step of it, and a cycle
the steps until the next measurement. After a second both have the same estimates; rounding grows later, since the filter of the
whole scenario is not stable in contact.
"""

from __future__ import annotations

import ctypes
import gc
import subprocess
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.force import one_core
from twin import clock
from twin.compiler import library
from twin.coupling import RecordMember
from twin.follow import Follower, estimator, load, path_of
from twin.follow.problem import times_of
from twin.run import build_simulation, resolve_catalogs
from twin.scenario import Backend, load_scenario

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.follow import FollowProblem

BUILD = Path("build")
SCENARIO = Path("scenarios/heart_wall_force.yaml").resolve()
VARIANT = "PI+FF+BW"
CYCLE = 5e-3  # [s]
SECONDS = 21  # followed in one pass: the scenario takes 22 s
PASSES = 3
BARE_WORK = 1e-3  # [s]
TIMES = ("bare_lateness", "bare_computing", "lateness", "computing")
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


def additions(seconds: float) -> range:
    """Return numbers whose sum takes as long."""
    numbers, times = range(10_000), []
    for _ in range(100):
        start = time.perf_counter()
        sum(numbers)
        times.append(time.perf_counter() - start)
    return range(round(len(numbers) * seconds / float(np.median(times))))


@dataclass
class ExportedEstimator:
    """The estimator of a follow file as C, with its computing times [s]."""

    problem: FollowProblem
    folder: Path
    steps: list[float] = field(default_factory=list)
    cycles: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        cls, name = estimator(self.folder / "follow.yaml").component, "force_estimator"
        library.export(cls, name, self.folder / "c", BUILD, (), force=True)
        source, binary = self.folder / "c" / f"{name}.c", self.folder / "estimator.so"
        subprocess.run(
            ["cc", "-std=c11", "-O2", "-ffp-contract=off", "-shared", "-fPIC", source, "-o", binary, "-lm"], check=True
        )
        code = ctypes.CDLL(str(binary))
        self._start, self._step = getattr(code, f"{name}_start"), getattr(code, f"{name}_step")
        self._start.argtypes = [ctypes.c_void_p, ctypes.c_double]
        self._step.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double]
        self._size = clock.seconds(self.problem.experiment.case.step_ns)
        self.restart()

    def restart(self) -> None:
        """Go back to the start of the model."""
        self.member, self.tick = RecordMember("estimator", estimator(self.folder / "follow.yaml").component()), 0
        self._start(self.member.instance, 0.0)

    def cycle(self, tick: int, measurements: Mapping[int, float]) -> None:
        """Advance to a communication step, with the values measured there."""
        total = 0.0
        while self.tick <= tick:
            values = measurements if self.tick == tick else {}
            for number, output in enumerate(self.problem.outputs):
                self.member.set(path_of("measured", output.signal), values.get(number, np.nan))
            start = time.perf_counter()
            status = self._step(self.member.instance, self.tick * self._size, self._size)
            self.steps.append(time.perf_counter() - start)
            assert status == 0
            total += self.steps[-1]
            self.tick += 1
        self.cycles.append(total)

    def values(self) -> np.ndarray[Any, Any]:
        """Return the estimates."""
        return np.array([self.member.get(path_of("estimate", one.name)) for one in self.problem.estimates])


def measure(folder: Path, passes: int) -> tuple[dict[str, list[float]], ExportedEstimator]:
    """Return lateness and computing times of the bare loop and of the follower's cycles [s], and the exported estimator."""
    problem, period = load(folder / "follow.yaml"), round(1.0 / CYCLE)
    exported = ExportedEstimator(problem, folder)
    numbers = additions(BARE_WORK)
    seconds: dict[str, list[float]] = {name: [] for name in TIMES}
    times = list(times_of(problem).items())
    for _ in range(passes):
        with Follower(problem, BUILD) as follower:
            print(f"follow_points: {follower.batch.count}")
            gc.collect()
            gc.freeze()
            gc.disable()
            for first in range(0, SECONDS * period, period):
                begin = time.perf_counter() + CYCLE
                for i in range(period):
                    seconds["bare_lateness"].append(wait(begin + i * CYCLE))
                    start = time.perf_counter()
                    sum(numbers)
                    seconds["bare_computing"].append(time.perf_counter() - start)
                begin = time.perf_counter() + CYCLE
                for i, (tick, measurements) in enumerate(times[first : first + period]):
                    seconds["lateness"].append(wait(begin + i * CYCLE))
                    start = time.perf_counter()
                    follower.advance(tick)
                    follower.correct(measurements)
                    seconds["computing"].append(time.perf_counter() - start)
                for tick, measurements in times[first : first + period]:
                    exported.cycle(tick, measurements)
                if first == 0:
                    difference = float(np.abs(exported.values() / follower.filter.mean - 1.0).max())
                    print(f"follow_exported_relative_difference_after_1_s: {difference:.1e}")
            exported.restart()
            gc.enable()
    return seconds, exported


def show(name: str, values: list[float]) -> None:
    """Print percentiles [ms]."""
    for label, quantile in (("p50", 50.0), ("p99", 99.0), ("p99.9", 99.9), ("max", 100.0)):
        print(f"{name}_{label}_ms: {1e3 * np.percentile(values, quantile):.3f}")


def main() -> None:
    """Print the figures, on one core."""
    with tempfile.TemporaryDirectory() as folder:
        record(Path(folder))
        one_core()
        seconds, exported = measure(Path(folder), PASSES)
    print(f"follow_cycles: {len(seconds['computing'])}")
    seconds["least_computing"] = np.reshape(seconds["computing"], (PASSES, -1)).min(axis=0).tolist()
    for name, values in seconds.items():
        show(f"follow_{name}", values)
    show("follow_exported_step", exported.steps)
    show("follow_exported_cycle", exported.cycles)
    for label, goal in GOALS.items():
        value = np.percentile(seconds["computing"], float(label[1:]))
        print(f"follow_computing_{label}_goal: {1e3 * goal:g} ms {'met' if value <= goal else 'missed'}")


if __name__ == "__main__":
    main()
