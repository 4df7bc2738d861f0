"""`twin identify` on recordings made with other parameters: how often the truth lies in the interval, and how fast it is.

    python -m benchmarks.identify [true|drive] [20] [jacobian]     prints `name: value` lines: 20 recordings, some minutes

Each recording is a run of the hysteresis scenario's chirp: an EM tracker at 40 Hz and the gripper's force at 200 Hz, both
with noise, and the gripper's position: the true one in every step, or what its drive says at 200 Hz, in its increments.
Plant and noise have other values for each seed. What is looked for are four parameters of the sheath and two delays, with
nothing told about the noise.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from twin.identify import Result, identify, load
from twin.run import build_simulation, recorded_signals, resolve_catalogs
from twin.scenario import Backend, load_scenario

BUILD = Path("build")
SCENARIO = Path("scenarios/hysteresis_identification.yaml")
RECORDINGS = 20
ENOUGH = 18
DURATION = 20.0  # of a recording [s]
FORCE_NOISE = 0.05  # standard deviation [N]
TRUTH = {  # from and to, in SI; even by the logarithm
    "sheath.stiffness[1]": (1.2e3, 4.0e3),
    "sheath.friction[1]": (0.3, 1.2),
    "sheath.play[2]": (0.15e-3, 0.6e-3),
    "sheath.drag[1]": (3.0, 12.0),
}
# the tracker publishes a period late; the drive's position is one of its samples old, and with it the model is late
DELAYS = {
    "true": {"delay of tip [mm]": 25e-3, "delay of force [N]": 0.0},
    "drive": {"delay of tip [mm]": 25e-3 - 0.5e-3, "delay of force [N]": -0.5e-3},
}
GRIPPER = {"true": ("servomotor.position", 1), "drive": ("servomotor.position_actual_value", 5)}  # and how often [ms]
FILE = """
component: sheath
data: [{file: bus.csv}, {file: em.csv}, {file: force.csv}]
inputs: {"gripper [m]": sheath.gripper_position}
outputs:
  "tip [mm]": {signal: sheath.tip_position, delay: {from: 0 ms, to: 50 ms}}
  "force [N]": {signal: sheath.reaction_force, delay: {from: -5 ms, to: 5 ms}}
fit:
  "sheath.stiffness[1]": {from: 0.5 N/mm, to: 8 N/mm, scale: log}
  "sheath.friction[1]": {from: 0.1 N, to: 3 N, scale: log}
  "sheath.play[2]": {from: 0 mm, to: 1.5 mm}
  "sheath.drag[1]": {from: 1.5 N*s/m, to: 40 N*s/m, scale: log}
"""


def drawn(seed: int) -> dict[str, float]:
    """The plant of a seed."""
    places = np.random.default_rng([seed, 1]).random(len(TRUTH))
    return {name: float(a * (b / a) ** place) for (name, (a, b)), place in zip(TRUTH.items(), places, strict=True)}


def write(path: Path, header: str, *columns: np.ndarray) -> None:
    """A CSV file."""
    np.savetxt(path, np.stack(columns, 1), fmt="%.9g", delimiter=",", header=header, comments="")


def record(seed: int, folder: Path, gripper: str = "true", duration: float = DURATION) -> dict[str, float]:
    """Write the recordings of a seed; the values that were in force, with the tracker's delay."""
    truth = drawn(seed)
    options = [f"{name}={value!r}" for name, value in truth.items()]
    scenario = load_scenario(SCENARIO, options)
    catalogs = resolve_catalogs(scenario)
    case = scenario.cases(["chirp"], [seed])[0]
    simulated = build_simulation(case, catalogs["chirp"], Backend.compiled, BUILD)
    simulated.every = case.step_ns
    try:
        simulated.initialize(case.start_ns, None)
        simulated.advance(round(duration * 1e9))
        table = recorded_signals(simulated, complete=True)
    finally:
        simulated.terminate()
    values, time_s = table.values, table.time
    noise = np.random.default_rng([seed, 2])
    bus, em = slice(None, None, 5), slice(25, None, 25)
    name, every = GRIPPER[gripper]
    write(folder / "bus.csv", "time [s],gripper [m]", time_s[::every], values[name][::every])
    write(folder / "em.csv", "time [s],tip [mm]", time_s[em], 1e3 * values["tracker.measured_position"][em])
    force = values["sheath.reaction_force"][bus]
    write(
        folder / "force.csv", "time [s],force [N]", time_s[bus], force + FORCE_NOISE * noise.standard_normal(len(force))
    )
    return {**truth, **DELAYS[gripper]}


def identified(seed: int, folder: Path, intervals: str = "jacobian", starts: int = 3) -> Result:
    """The identification of a seed's recordings."""
    path = folder / "identify.yaml"
    path.write_text(FILE)
    return identify(load(path), starts=starts, seed=seed, intervals=intervals, build=BUILD)


def holds(result: Result, truth: dict[str, float]) -> dict[str, bool]:
    """Whether the truth of each unknown lies in its interval."""
    names = [one.name for one in result.problem.unknowns]
    return {name: low <= truth[name] <= high for name, (low, high) in zip(names, result.intervals, strict=True)}


def distance(result: Result, truth: dict[str, float]) -> float:
    """Squared distance of the truth by the covariance: chi-square with a degree of freedom for each unknown."""
    error = np.array([truth[one.name] for one in result.problem.unknowns]) - result.values
    return float(error @ np.linalg.solve(result.covariance, error))


def measure(gripper: str = "true", recordings: int = RECORDINGS, intervals: str = "jacobian") -> dict[str, int]:
    """Print how often which truth was found; how often, by unknown."""
    counts = dict.fromkeys([*TRUTH, *DELAYS[gripper]], 0)
    errors: dict[str, list[float]] = {name: [] for name in counts}
    simulations, seconds, all_of_them, verdicts = 0, 0.0, 0, 0
    distances: list[float] = []
    for seed in range(1, recordings + 1):
        with tempfile.TemporaryDirectory() as folder:
            truth = record(seed, Path(folder), gripper)
            begin = time.perf_counter()
            result = identified(seed, Path(folder), intervals)
            seconds += time.perf_counter() - begin
        found = holds(result, truth)
        simulations += result.fit.simulations
        all_of_them += all(found.values())
        verdicts += result.passed
        distances.append(distance(result, truth))
        for one, value in zip(result.problem.unknowns, result.values, strict=True):
            counts[one.name] += found[one.name]
            errors[one.name].append(abs(value - truth[one.name]))
    for name, count in counts.items():
        label = name.replace(" ", "_")
        print(f"identify_{gripper}_{intervals}_{label}_in_interval: {count} of {recordings}")
        print(f"identify_{gripper}_{intervals}_{label}_error_median: {np.median(errors[name]):.2g}  # SI")
    print(f"identify_{gripper}_{intervals}_all_in_intervals: {all_of_them} of {recordings}")
    inside = sum(one < chi2.ppf(0.95, len(counts)) for one in distances)
    print(f"identify_{gripper}_{intervals}_in_ellipsoid: {inside} of {recordings}")
    print(f"identify_{gripper}_{intervals}_said_to_be_identified: {verdicts} of {recordings}")
    print(f"identify_{gripper}_{intervals}_simulations: {simulations}")
    print(f"identify_{gripper}_{intervals}_simulations_per_second: {simulations / seconds:.3g}")
    print(f"identify_{gripper}_{intervals}_times_real_time: {simulations * DURATION / seconds:.3g}")
    return counts


if __name__ == "__main__":
    words = sys.argv[1:] or ["true"]
    measure(words[0], *(int(one) for one in words[1:2]), *words[2:])
