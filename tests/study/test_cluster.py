"""A study on a dask scheduler with workers, all in processes of their own; one of them is killed on the way."""

import os
import re
import signal
import subprocess
import sys
import time

import pytest
from pyarrow import parquet

from tests.study.patients import study_file
from twin.errors import ScenarioError
from twin.study import load_study, run_study

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
