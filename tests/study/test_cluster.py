"""A study on a dask scheduler with workers, all in processes of their own; one of them is killed on the way."""

import os
import re
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest
from pyarrow import parquet

from tests.study.patients import study_file
from twin.errors import ScenarioError
from twin.study import load_study, run_study
from twin.study.execution.case_engine import Row

pytest.importorskip("distributed", reason="the extra `cluster` is not installed")

DASK = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]


def started(command, pattern, path):
    """A process, and what it says of itself in its log."""
    with path.open("w") as log:
        process = subprocess.Popen(command, stdout=log, stderr=log)
    for _ in range(600):
        if found := re.search(pattern, path.read_text()):
            return process, found[1] if found.groups() else ""
        assert process.poll() is None, path.read_text()
        time.sleep(0.1)
    pytest.fail(path.read_text())


@pytest.fixture
def scheduler(tmp_path):
    process, address = started(DASK, r"Scheduler at:\s+(tcp://\S+)", tmp_path / "scheduler.log")
    yield address
    process.terminate()
    process.wait()


def worker(address, tmp_path, name):
    command = [
        sys.executable,
        "-m",
        "distributed.cli.dask_worker",
        address,
        "--nthreads",
        "1",
        "--no-dashboard",
        "--no-nanny",
    ]
    return started([*command, "--local-directory", str(tmp_path / name)], r"Registered to", tmp_path / f"{name}.log")[0]


@pytest.mark.slow
def test_a_study_on_a_cluster_is_that_on_this_machine(scheduler, tmp_path, build):
    study = load_study(study_file(tmp_path))
    first, second = (worker(scheduler, tmp_path, name) for name in ("one", "two"))

    def kill_one(progress):
        if progress.done == 3:
            os.kill(first.pid, signal.SIGKILL)

    try:
        there = run_study(study, root=tmp_path, build=build, scheduler=scheduler, listen=kill_one, report=False)
    finally:
        for one in (first, second):
            one.kill()
            one.wait()
    here = run_study(study, root=tmp_path, build=build, workers=1, report=False)
    tables = [
        parquet.read_table(one.folder / "cases.parquet").drop_columns(["seconds", "tries"]) for one in (there, here)
    ]
    assert tables[0].equals(tables[1])


@pytest.mark.slow
def test_a_scheduler_without_workers_is_told(scheduler, tmp_path, build):
    study = load_study(study_file(tmp_path))
    with pytest.raises(ScenarioError, match="has no workers"):
        run_study(study, root=tmp_path, build=build, scheduler=scheduler)


class Future:
    """A case on a cluster that has ended."""

    def __init__(self, request, end):
        self.request, self.end = request, end

    def exception(self):
        return self.end if isinstance(self.end, Exception) else None

    def result(self):
        return self.end


@pytest.fixture
def cluster(monkeypatch):
    """Two workers with one and two threads, on which cases end as `ends` says, else with their row; what is asked."""
    from twin.study.execution import cluster as module

    waiting, taken = [], []
    own = object.__new__(module.WorkerCluster)
    own.name, own.ends, own.taken = "study", {}, taken

    def submit(function, name, request, *, key, pure):
        assert (function, name, key, pure) == (module.row, "study", f"study-{request}", False)
        taken.append(request)
        return Future(request, own.ends.get(request, Row(request, "done", "", (), ())))

    own.client = SimpleNamespace(nthreads=lambda: {"a": 1, "b": 2}, submit=submit)
    monkeypatch.setattr(module, "as_completed", lambda **_: Coming(waiting))
    return own


class Coming:
    """Futures, the newest first."""

    def __init__(self, waiting):
        self.add, self._waiting = waiting.append, waiting

    def __next__(self):
        return self._waiting.pop()


@pytest.mark.slow
def test_two_cases_for_each_thread_are_on_their_way(cluster):
    """Of three threads six; a row that comes makes room for another request."""
    rows = cluster.run(iter(Number(k) for k in range(1, 10)))
    first = next(rows)
    assert first.number == 6  # the newest
    assert cluster.taken == [1, 2, 3, 4, 5, 6]
    others = [next(rows).number for _ in range(8)]
    assert cluster.taken == list(range(1, 10))
    assert sorted([6, *others]) == list(range(1, 10))
    assert next(rows, None) is None
    assert cluster.threads == 3


class Number(int):
    """A request that is its number."""

    @property
    def number(self):
        return int(self)


@pytest.mark.slow
def test_a_case_that_is_lost_with_its_workers_fails(cluster):
    cluster.ends[2] = RuntimeError("killed\nby the system")
    lost = {row.number: row for row in cluster.run(iter([Number(1), Number(2)]))}
    assert (lost[1].status, lost[2].status) == ("done", "failed")
    assert lost[2].why == "lost with its workers: RuntimeError: killed"


@pytest.mark.slow
def test_a_study_that_no_worker_can_begin_is_refused(cluster):
    cluster.ends[1] = "a.yaml: cannot be read"
    with pytest.raises(ScenarioError, match=r"^a\.yaml: cannot be read$"):
        list(cluster.run(iter([Number(1)])))


@pytest.mark.slow
def test_the_memory_of_a_worker_is_shared_by_its_threads(monkeypatch):
    from twin.study.execution import cluster as module

    monkeypatch.setattr(module, "unpack", lambda archive, folder, job: (archive, folder.is_dir(), job))
    monkeypatch.setattr(
        module, "Process", lambda *arguments: SimpleNamespace(arguments=arguments, close=lambda: closed.append(1))
    )
    closed = []
    for limit, threads, memory in ((1000, 3, 333), (1000, 0, 1000), (None, 2, 0)):
        state = module.WorkerState("study", b"archive", "job", 2.0)
        state.setup(
            SimpleNamespace(memory_manager=SimpleNamespace(memory_limit=limit), state=SimpleNamespace(nthreads=threads))
        )
        assert state.memory == memory
        process = state.process()
        assert process is state.process()
        assert process.arguments == ((b"archive", True, "job"), memory, 2.0)
        assert module.WorkerState.states == {"study": state}
        state.teardown(None)
        assert module.WorkerState.states == {}
        assert not state.folder.exists()
    assert closed == [1, 1, 1]
