"""A study's cases beside the loop alone, FMPy in a process pool, and a shell that calls `twin run`.

    python -m benchmarks.study [40] [10000]     prints `name: value` lines: cases, and cases of the memory test
    python -m benchmarks.study beside [9]       by the clock: pairs of a study's cases and the loop alone
    python -m benchmarks.study whole [1000]     by the clock: a whole study, from nothing to its report
    python -m benchmarks.study prefix [16]      cases that differ from 12 s on, with a common prefix and without

All on the force scenario with PI, 22 s each. What counts is processor time, so that others on the machine do not: of the
loop alone (`advance`, nothing else) beside that of a whole case in the engine, one after the other; and of all of a
study's processes from their start to their end. By the clock a study's processes and as many that do nothing but the loop
have the cores in turn, some seconds each: all cores are busy in both, and each is beside what the machine does at that
time. The median of pairs counts, the loops' initialization does not. FMPy gets the whole scenario as one FMU, extracted once, without any
metric: more than fair. `twin run` starts a process per case. Memory is that of the engine's process, with runs of 10 ms.
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from itertools import cycle
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin.coupling import MemoryRecorder
from twin.fmi.exporting import exporter
from twin.run import build_simulation, resolve_catalogs
from twin.scenario import Backend, group, load_scenario
from twin.study import load_study
from twin.study.design import StudyRequest
from twin.study.execution import Engine, Job, run_study
from twin.study.execution.process_pool import AHEAD, Pool, cores

if TYPE_CHECKING:
    from collections.abc import Callable

BUILD = Path("build").resolve()
SCENARIO = Path("scenarios/heart_wall_force.yaml").resolve()
STUDY = """
scenario: {scenario}
variants: [PI]
set: {options}
samples: {{method: sobol, count: {count}, seed: 1}}
vary:
  heart.rate: {{normal: [70 /min, 12 /min], from: 45 /min, to: 110 /min, source: assumed}}
  friction: {{scales: sheath.friction, log_normal: [1, 1.3], source: assumed}}
"""
PREFIX_STUDY = """
scenario: {scenario}
variants: [PI]
set: {options}
samples: {{method: grid, seeds: [1]}}
vary: {{friction: {{scales: sheath.friction, grid: [0.5, 2, {count}], at: 12 s, source: assumed}}}}
"""
SLICE = 20  # cases between two looks at the memory
ALONE = 12  # rounds of loop and case
THEIRS = 6  # cases of FMPy
SHELL = 3  # calls of `twin run`
PAIRS = 9
WINDOW = 4.0  # of a study or of loops alone, in turn [s]
WHOLE = 1000  # cases of a whole study


def studied(folder: Path, count: int, options: str = "{}", text: str = STUDY) -> tuple[Any, Job]:
    """A study with so many cases, and its job."""
    path = folder / "study.yaml"
    path.write_text(text.format(scenario=SCENARIO, count=count, options=options))
    study = load_study(path)
    frozen = folder / "frozen.yaml"
    frozen.write_text(study.scenario.frozen())
    return study, Job(frozen, study.scenario.overrides, study.factors, (), 50_000_000, BUILD)


def loop_alone(clock: Callable[[], float] = time.process_time) -> float:
    """Time of the loop of one case [s], by default of the processor."""
    if not _loaded:
        scenario = load_scenario(SCENARIO)
        _loaded.extend((scenario.cases(["PI"], [1])[0], resolve_catalogs(scenario)["PI"]))
    case, catalog = _loaded
    simulated = build_simulation(case, catalog, Backend.compiled, BUILD, MemoryRecorder(1 << 20))
    simulated.initialize(case.start_ns, case.stop_ns)
    begin = clock()
    simulated.advance(case.stop_ns)
    took = clock() - begin
    simulated.terminate()
    return took


_loaded: list[Any] = []  # the case and its catalog


def loops_until(end: float) -> float:
    """Loops per second of the clock until a time of `time.time`, all in this process."""
    taken = []
    while not taken or time.time() < end:
        taken.append(loop_alone(time.perf_counter))
    return len(taken) / sum(taken)


def loops_of_all(others: ProcessPoolExecutor, window: float) -> float:
    """Loops per second of the clock of as many processes as there are cores, all at it at once."""
    end = time.time() + window
    return sum(one.result() for one in [others.submit(loops_until, end) for _ in range(cores())])


def measure_beside(folder: Path, pairs: int = PAIRS, window: float = WINDOW) -> None:
    """Print what a study does by the clock, in parts of what as many processes do that know nothing but the loop."""
    study, job = studied(folder, 1024)
    ratios, busy = [], []
    with Pool(job, cores(), 0) as pool, ProcessPoolExecutor(cores(), get_context("spawn")) as others:
        loops_of_all(others, 0.0)
        rows = pool.run(cycle(study.requests()))
        for _ in range(pairs):
            for _ in range((AHEAD + 1) * cores()):  # those that were ready, and until all are at it again
                next(rows)
            spent, begin = [], time.perf_counter()
            while time.perf_counter() - begin < window:
                spent.append(next(rows).seconds)
            took = time.perf_counter() - begin
            time.sleep(AHEAD * 2 * max(spent))  # until the processes wait
            ratios.append(len(spent) / took / loops_of_all(others, window))
            busy.append(sum(spent) / took / cores())
    print(f"study_beside_wall_to_loops: {statistics.median(ratios):.3f}  # {min(ratios):.3f} to {max(ratios):.3f}")
    print(f"study_beside_busy: {statistics.median(busy):.3f}  # the rest is waiting for the next case", flush=True)


def measure_whole(folder: Path, count: int = WHOLE) -> None:
    """Print what a whole `twin study` takes by the clock, from nothing to its report, between two times of loops alone."""
    study, _ = studied(folder, count)
    told = []
    with ProcessPoolExecutor(cores(), get_context("spawn")) as others:
        loops_of_all(others, 0.0)
        speeds = [loops_of_all(others, 2 * WINDOW)]
        begin = time.perf_counter()
        run_study(study, root=folder, build=BUILD, listen=lambda _: told.append(time.perf_counter() - begin))
        took = time.perf_counter() - begin
        speeds.append(loops_of_all(others, 2 * WINDOW))
    loops = statistics.mean(speeds)
    print(f"study_whole_{count}_s: {took:.1f}  # {told[0]:.1f} to the first row, {took - told[-1]:.1f} after the last")
    print(f"study_whole_loops_per_s: {loops:.2f}  # {speeds[0]:.2f} before, {speeds[1]:.2f} after, {cores()} processes")
    print(f"study_whole_{count}_cases_to_loops: {count / told[-1] / loops:.3f}  # from nothing to the last row")
    print(f"study_whole_{count}_to_loops: {count / took / loops:.3f}  # with tables and report", flush=True)


def measure_engine(folder: Path, rounds: int = ALONE) -> float:
    """Print what a case in the engine costs beside the loop alone; the loop's time [s]."""
    study, job = studied(folder, rounds)
    engine = Engine(job)
    requests = list(study.requests())
    engine.row(requests[0])
    alone, whole = [], []
    for request in requests:
        alone.append(loop_alone())
        begin = time.process_time()
        engine.row(request)
        whole.append(time.process_time() - begin)
    engine.close()
    print(f"study_loop_alone_ms: {1e3 * statistics.median(alone):.0f}")
    print(f"study_case_ms: {1e3 * statistics.median(whole):.0f}")
    print(f"study_case_to_loop: {statistics.median(a / b for a, b in zip(alone, whole, strict=True)):.3f}", flush=True)
    return statistics.median(alone)


def measure_prefix(folder: Path, count: int = 16) -> None:
    """Print the processor time of cases that share their first 12 s of 22 s, and of the same cases run whole."""
    study, job = studied(folder, count, "{stop_time: 22 s}", PREFIX_STUDY)
    spent, results = [], []
    for is_shared in (True, False):
        engine = Engine(job)
        if not is_shared:
            engine.prefixes.times = ()
        engine.cell("PI")
        begin = time.process_time()
        rows = [engine.row(request) for request in study.requests()]
        spent.append(time.process_time() - begin)
        results.append([row.metrics for row in rows])
        engine.close()
    if results[0] != results[1]:
        raise RuntimeError("cases with a common prefix have other metrics than whole ones")
    print(f"study_prefix_{count}_cases_s: {spent[0]:.2f}")
    print(f"study_prefix_{count}_whole_cases_s: {spent[1]:.2f}")
    print(
        f"study_prefix_{count}_to_whole: {spent[0] / spent[1]:.3f}  # simulated time: {(12 + 10 * count) / 22 / count:.3f}"
    )


def measure_pool(folder: Path, count: int, alone: float) -> float:
    """Print what a whole study costs, with its processes; processor time of a case [s]."""
    study, job = studied(folder, count)
    before, begin = children(), time.perf_counter()
    pool = Pool(job, cores(), 0)
    rows = list(pool.run(study.requests()))
    pool.close()
    took, own = time.perf_counter() - begin, (children() - before) / count
    failed = sum(row.status != "done" for row in rows)
    print(f"study_pool_{count}_cases_s: {took:.1f}  # {failed} failed")
    print(f"study_pool_{count}_cpu_to_loop: {alone / own:.3f}")
    print(f"study_pool_{count}_wall_to_cores_times_loop: {count * alone / (cores() * took):.3f}", flush=True)
    return own


def children() -> float:
    """Processor time of all processes that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def measure_memory(folder: Path, count: int) -> None:
    """Print how much memory the engine's process has after a hundredth of the cases, and after all."""
    study, job = studied(folder, 1, "{stop_time: 13 s}")
    engine = Engine(job)
    (first,) = study.requests()
    (cell,) = [engine.cell("PI")]
    object.__setattr__(cell.inputs.case, "stop_ns", 10_000_000)
    sizes = []
    for number in range(1, count + 1):
        engine.row(StudyRequest(number, first.part, number, first.variant, number, first.values))
        if number in (count // 100, count):
            sizes.append(resident())
    engine.close()
    print(f"study_memory_after_{count // 100}_cases_MB: {sizes[0]:.1f}")
    print(f"study_memory_after_{count}_cases_MB: {sizes[1]:.1f}", flush=True)


def resident() -> float:
    """Memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


_extracted: dict[str, Any] = {}


def theirs(folder: str, rate: float) -> float:
    """A case by FMPy from what was extracted; its last force."""
    from fmpy import read_model_description, simulate_fmu

    if folder not in _extracted:
        _extracted[folder] = read_model_description(folder)
    found = simulate_fmu(
        folder,
        model_description=_extracted[folder],
        stop_time=22.0,
        step_size=1e-3,
        output_interval=5e-3,
        start_values={"heart.rate": rate},
        output=["sensor.measured_force"],
    )
    return float(found[-1][1])


def measure_fmpy(folder: Path, count: int = THEIRS) -> float:
    """Print what FMPy takes; processor time of a case [s]."""
    from fmpy import extract

    scenario = load_scenario(SCENARIO)
    case = scenario.cases(["PI"])[0]
    cls = group("whole", case, resolve_catalogs(scenario)["PI"], list(case.members))
    place = extract(str(exporter.export(cls, "2.0", folder / "whole.fmu", BUILD)), str(folder / "whole"))
    before = children()
    with ProcessPoolExecutor(cores()) as pool:
        list(pool.map(theirs, [place] * count, [1.0 + 0.01 * i for i in range(count)]))
    own = (children() - before) / count
    print(f"study_fmpy_case_ms: {1e3 * own:.0f}", flush=True)
    return own


def measure_shell(count: int = SHELL) -> float:
    """Print what a call of `twin run` takes; processor time of a case [s]."""
    command = [
        sys.executable,
        "-c",
        "from twin.cli import main; main()",
        "run",
        str(SCENARIO),
        "--variant",
        "PI",
        "--no-report",
    ]
    before = children()
    with tempfile.TemporaryDirectory() as runs:
        for seed in range(1, count + 1):
            options = ["--seed", str(seed), "--runs", runs, "--build", str(BUILD)]
            subprocess.run([*command, *options], capture_output=True, check=False)
    own = (children() - before) / count
    print(f"study_twin_run_case_ms: {1e3 * own:.0f}", flush=True)
    return own


def main(count: int = 40, memory: int = 10_000) -> None:
    """Print all figures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        alone = measure_engine(folder)
        own = measure_pool(folder, count, alone)
        measure_beside(folder)
        for other, measured in (("fmpy", measure_fmpy(folder)), ("twin_run", measure_shell())):
            print(f"study_{other}_to_study: {measured / own:.2f}")
        measure_memory(folder, memory)


if __name__ == "__main__":
    measures = {"beside": measure_beside, "whole": measure_whole, "prefix": measure_prefix}
    named = measures.get(sys.argv[1] if sys.argv[1:] else "")
    if named:
        with tempfile.TemporaryDirectory() as name:
            named(Path(name), *map(int, sys.argv[2:]))
    else:
        main(*(int(one) for one in sys.argv[1:]))
