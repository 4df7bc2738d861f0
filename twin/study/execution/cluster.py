"""Cases on the workers of a dask scheduler. How those come to be, by SSH, SLURM or Kubernetes, is dask's business.

What a study needs travels once to each worker. There, each thread has a process of its own, as on this machine: what dies,
hangs or runs out of memory costs its case a retry. A worker that is lost itself costs its cases a try on another one.
"""

from __future__ import annotations

import shutil
import tempfile
import threading
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from distributed import Client, WorkerPlugin, as_completed

from twin.errors import ScenarioError
from twin.study.execution.case_engine import FAILED, Job, Row
from twin.study.execution.process_pool import NotReadyError, Process
from twin.study.execution.study_archive import pack, unpack

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from twin.study.design import StudyRequest

AHEAD = 2  # cases per thread that are on their way
CONNECTING = 20.0  # time for the scheduler to answer [s]


class WorkerState(WorkerPlugin):  # type: ignore[misc] # dask has no types
    """What a worker keeps of a study while it is connected to it."""

    states: dict[str, WorkerState] = {}  # noqa: RUF012 - of this worker's process, by name

    def __init__(self, name: str, archive: bytes, job: Job, timeout: float) -> None:
        self.name, self.archive, self.job, self.timeout = name, archive, job, timeout

    def setup(self, worker: Any) -> None:
        """Unpack what has come."""
        self.folder = Path(tempfile.mkdtemp(prefix="twin-study-"))
        self.here = unpack(self.archive, self.folder, self.job)
        limit = getattr(worker.memory_manager, "memory_limit", None)
        self.memory = int(limit / max(worker.state.nthreads, 1)) if limit else 0
        self.own = threading.local()
        self.processes: list[Process] = []
        WorkerState.states[self.name] = self

    def process(self) -> Process:
        """The process of this thread."""
        if not hasattr(self.own, "process"):
            self.own.process = Process(self.here, self.memory, self.timeout)
            self.processes.append(self.own.process)
        process: Process = self.own.process
        return process

    def teardown(self, worker: Any) -> None:  # noqa: ARG002 - dask's signature
        """Leave nothing behind."""
        WorkerState.states.pop(self.name, None)
        for process in self.processes:
            process.close()
        shutil.rmtree(self.folder, ignore_errors=True)


def row(name: str, request: StudyRequest) -> Row | str:
    """Run a case on a worker; a text tells why none can be run."""
    try:
        return WorkerState.states[name].process().row(request)
    except NotReadyError as error:
        return str(error)


class WorkerCluster:
    """The workers of a scheduler."""

    def __init__(self, job: Job, address: str, timeout: float, variants: tuple[str, ...]) -> None:
        try:
            self.client: Any = Client(address, timeout=CONNECTING)  # type: ignore[no-untyped-call] # nor any other
        except (OSError, ValueError, TimeoutError) as error:
            raise ScenarioError(
                f"--scheduler {address}: does not answer ({error}). Start it with `dask scheduler`."
            ) from None
        if not self.threads:
            self.client.close()  # type: ignore[no-untyped-call]
            raise ScenarioError(f"--scheduler {address}: has no workers. Start some with `dask worker {address}`.")
        self.name = f"twin-{job.scenario.parent.name}-{id(self)}"
        self.client.register_plugin(WorkerState(self.name, pack(job, variants), job, timeout), name=self.name)

    @property
    def threads(self) -> int:
        """Cases that can run at once."""
        return sum(self.client.nthreads().values())

    def run(self, requests: Iterable[StudyRequest]) -> Iterator[Row]:
        """Rows as they come."""
        left = iter(requests)
        wanted: dict[Any, StudyRequest] = {}
        coming: Any = as_completed(with_results=False)  # type: ignore[no-untyped-call]

        def send() -> None:
            if (request := next(left, None)) is not None:
                future = self.client.submit(row, self.name, request, key=f"{self.name}-{request.number}", pure=False)
                wanted[future] = request
                coming.add(future)

        for _ in range(AHEAD * self.threads):
            send()
        while wanted:
            future = next(coming)
            request = wanted.pop(future)
            if (error := future.exception()) is not None:  # dask has tried it on other workers
                lost = f"lost with its workers: {type(error).__name__}: {error}".splitlines()[0]
                result: Row | str = Row(request.number, FAILED, lost, (), ())
            else:
                result = future.result()
            if isinstance(result, str):
                raise ScenarioError(result)
            yield result
            send()

    def close(self) -> None:
        """Take the study off the workers, and leave them as they are."""
        with suppress(Exception):  # the scheduler may be gone
            self.client.unregister_worker_plugin(self.name)
        self.client.close()
