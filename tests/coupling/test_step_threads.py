"""Members stepped at the same time give the results of one thread, to the bit, and fail as there."""

import threading
import zipfile

import numpy as np
import pytest

from benchmarks.parallel import work_fmu
from twin.coupling import Algorithm, Connection, CoSimulation, CoupledSystem, IsolatedMember
from twin.coupling.threads.step_threads import cores, merge_independent_stages
from twin.errors import SimulationError
from twin.fmi import FMUMember

MS = 1_000_000
WIRES = [("a", "b"), ("b", "c"), ("a", "d"), ("d", "a"), ("c", "a2"), ("b", "e")]
NAMES = ("a", "b", "c", "d", "e", "a2")
ALGORITHMS = [
    "jacobi",
    "gauss_seidel",
    {"name": "jacobi", "order": 1},
    {"name": "gauss_seidel", "order": 2},
    "iterative",
    {"name": "iterative", "order": 1},
    "step_doubling",
    "predictive",
]


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    """An FMU of which a step takes some 20 us, or a pause."""
    return work_fmu(tmp_path_factory.mktemp("work") / "work.fmu", count=5000.0)


@pytest.fixture(scope="module")
def sleeper(tmp_path_factory):
    """An FMU that sleeps for 2 ms in every step."""
    return work_fmu(tmp_path_factory.mktemp("work") / "sleeper.fmu", pause=0.002)


def system_of(fmu, build, threads, algorithm="jacobi", starts=None, periods=None, isolate=()):
    starts = {name: {"offset": 1.0 + i} for i, name in enumerate(NAMES)} | (starts or {})
    members = {name: FMUMember(name, fmu, starts[name]) for name in NAMES}
    members = {name: IsolatedMember(one, build) if name in isolate else one for name, one in members.items()}
    links = CoupledSystem({name: one.variables for name, one in members.items()}, wires_of()).links()
    return CoSimulation(members, links, MS, Algorithm(algorithm), build=build, threads=threads, periods=periods)


def wires_of():
    sources = {target: source for source, target in WIRES}
    return [Connection(f"{source}.y", f"{target}.u") for target, source in sources.items()]


def run(simulation, steps=60):
    """Recorded signals as bytes."""
    try:
        simulation.initialize(0, steps * MS)
        simulation.advance(steps * MS)
        return {name: values.tobytes() for name, values in simulation.recording().signals.items()}
    finally:
        simulation.terminate()


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=str)
@pytest.mark.parametrize("periods", [None, {"b": 2 * MS, "e": 4 * MS}], ids=["equal", "slow"])
def test_results_do_not_depend_on_threads(algorithm, periods, fmu, build):
    results = [run(system_of(fmu, build, threads, algorithm, periods=periods)) for threads in (1, 2, 3, None)]
    assert all(result == results[0] for result in results[1:])
    assert np.isfinite(np.frombuffer(results[0]["a.y"])).all()


@pytest.mark.slow
def test_twenty_runs_are_equal(fmu, build):
    results = [run(system_of(fmu, build, 3), steps=300) for _ in range(20)]
    assert all(result == results[0] for result in results)


@pytest.mark.slow
def test_isolated_members_overlap(sleeper, build):
    names = NAMES[:4]
    serial = run(system_of(sleeper, build, 1, isolate=names))
    simulation = system_of(sleeper, build, None, isolate=names)
    assert run(simulation) == serial
    assert simulation._threads.overlaps_isolated


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize(
    ("what", "text"),
    [
        (3.0, "c: failed with ERROR in the step from t = 20 ms"),
        (4.0, "c: failed with FATAL in the step from t = 20 ms"),
    ],
)
def test_a_failing_step(threads, what, text, fmu, build):
    simulation = system_of(fmu, build, threads, starts={"c": {"what": what, "crash": 0.02}})
    with pytest.raises(SimulationError, match=text):
        run(simulation)
    assert len(simulation.recording().time) == 21


@pytest.mark.slow
def test_a_crash_of_an_isolated_member(fmu, build):
    simulation = system_of(fmu, build, 2, starts={"c": {"crash": 0.02}}, isolate=("b", "c"))
    with pytest.raises(SimulationError, match=r"c: crashed with SIGSEGV .* in the step from t = 20 ms"):
        run(simulation)


def test_no_thread_for_cheap_members(tmp_path, build):
    cheap = work_fmu(tmp_path / "cheap.fmu")
    simulation = system_of(cheap, build, None)
    try:
        simulation.initialize(0, 100 * MS)
        before = threading.active_count()
        simulation.advance(100 * MS)
        assert threading.active_count() == before
    finally:
        simulation.terminate()


@pytest.mark.slow
@pytest.mark.skipif(cores() < 2, reason="one core")
def test_expensive_members_step_at_the_same_time_from_the_second_step_on(tmp_path, build):
    expensive = work_fmu(tmp_path / "expensive.fmu", count=50000.0)
    starts = {"d": {"offset": 4.0, "count": 500000.0}}
    simulation = system_of(expensive, build, None, starts=starts)
    before = threading.active_count()
    try:
        simulation.initialize(0, 8 * MS)
        simulation.advance(MS)
        assert threading.active_count() == before
        simulation.advance(2 * MS)
        assert threading.active_count() > before
        simulation.advance(8 * MS)
        ((_, tasks),) = simulation._threads._blocks.values()
        assert tasks[0]["instance"] == simulation.members["d"].instance, "the longest step is begun first"
        signals = {name: values.tobytes() for name, values in simulation.recording().signals.items()}
    finally:
        simulation.terminate()
    assert signals == run(system_of(expensive, build, 1, starts=starts), steps=8)


@pytest.mark.slow
@pytest.mark.skipif(cores() < 2, reason="one core")
def test_crash_reports_know_the_blocks_of_measured_members(tmp_path, build):
    simulation = system_of(work_fmu(tmp_path / "expensive.fmu", count=50000.0), build, None)
    try:
        simulation.initialize(0, 40 * MS)
        known = set(simulation._threads.calls)
        simulation.advance(40 * MS)
        assert set(simulation._threads._blocks) <= known
        assert simulation._threads._blocks
    finally:
        simulation.terminate()


def test_members_that_allow_one_instance_or_log_stay_on_the_thread_of_the_loop(fmu, tmp_path, build):
    single = tmp_path / "single.fmu"
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(single, "w") as new:
        for name in old.namelist():
            flag = b'<CoSimulation canBeInstantiatedOnlyOncePerProcess="true" '
            new.writestr(name, old.read(name).replace(b"<CoSimulation ", flag))
    members = {name: FMUMember(name, fmu, {}) for name in ("a", "b")}
    members |= {"single": FMUMember("single", single, {}), "logs": FMUMember("logs", fmu, {}, logging=True)}
    simulation = CoSimulation(members, [], MS, build=build, threads=8)
    try:
        simulation.initialize(0, MS)
        ((names, _),) = simulation._threads.calls.values()
        assert names == "a or b"
        assert len(simulation._threads._workers) == 1, "no more than have a member"
    finally:
        simulation.terminate()


def test_threads_end_with_the_run(fmu, build):
    before = threading.active_count()
    simulation = system_of(fmu, build, 3)
    simulation.initialize(0, 10 * MS)
    assert threading.active_count() == before + 2
    simulation.terminate()
    simulation.terminate()
    assert threading.active_count() == before


def test_stages_of_independent_members_are_merged(fmu, build):
    simulation = system_of(fmu, build, 1, "gauss_seidel")
    order = [["a"], ["b"], ["c"], ["d"], ["e"], ["a2"]]
    assert merge_independent_stages(order, simulation.links, NAMES) == [["a"], ["b", "d"], ["c", "e"], ["a2"]]
    serial = merge_independent_stages(order, simulation.links, [name for name in NAMES if name not in "cd"])
    assert [name for stage in serial for name in stage if name in "cd"] == ["c", "d"]
    simulation.terminate()
