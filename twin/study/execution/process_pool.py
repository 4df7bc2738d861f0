"""Processes on this machine that run cases; one that dies, hangs or runs out of memory costs its case a retry."""

from __future__ import annotations

import os
import pickle
import queue
import subprocess
import sys
import tempfile
import threading
from collections import deque
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Self

from twin.errors import ScenarioError, SimulationError
from twin.study.execution.case_engine import FAILED, Job, Row
from twin.study.execution.worker import NO_MEMORY

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from twin.study.design import StudyRequest

TRIES = 2
AHEAD = 2  # groups of requests per process that are taken
FIRST_CASE_TIMEOUT = 600.0  # for a process to begin, and for its first case [s]
MIN_CASE_TIMEOUT = 60.0  # for the others at least [s]
LONGER = 20.0  # and so many times the longest until now
SHARE = 0.9  # of the machine's memory that all processes together may have
TAIL = 400  # letters of what a dead process said last


class LostError(SimulationError):
    """A process was lost with its case."""


class NotReadyError(ScenarioError):
    """A process cannot begin: no other one would."""


class Process:
    """One process that runs one case after the other; started anew when it was lost."""

    def __init__(self, job: Job, memory: int, timeout: float = 0.0) -> None:
        self.job, self.memory, self.timeout = job, memory, timeout
        self._process: subprocess.Popen[bytes] | None = None
        self._longest = 0.0
        self._is_first = True
        self._hung = self._closed = False
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - as long as this object

    def _start_process(self) -> subprocess.Popen[bytes]:
        if self._closed:
            raise LostError("closed")
        if self._process is None:
            self._said.seek(0)
            self._said.truncate()
            self._process = subprocess.Popen(
                [sys.executable, "-m", "twin.study.execution.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._said,
            )
            self._is_first = True
            self._send((self.job, self.memory))
        return self._process

    def _send(self, what: Any) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # heard when the answer is missing
            pickle.dump(what, self._process.stdin)
            self._process.stdin.flush()

    @property
    def time_limit(self) -> float:
        """Longest permitted time of a case [s]."""
        return self.timeout or (
            FIRST_CASE_TIMEOUT if not self._longest else max(MIN_CASE_TIMEOUT, LONGER * self._longest)
        )

    def run_request(self, request: StudyRequest) -> Row:
        """Run a case; LostError if the process does not come back from it."""
        process = self._start_process()
        if self._is_first and (trouble := self._answer(process, FIRST_CASE_TIMEOUT)):
            raise NotReadyError(trouble)
        self._is_first = False
        self._send(request)
        row: Row = self._answer(process, self.time_limit)
        self._longest = max(self._longest, row.seconds)
        return row

    def _answer(self, process: subprocess.Popen[bytes], time_limit: float) -> Any:
        assert process.stdout is not None
        self._hung = False
        watch = threading.Timer(time_limit, self._give_up)
        watch.daemon = True
        watch.start()
        try:
            return pickle.load(process.stdout)  # noqa: S301 - of our own process
        except (EOFError, pickle.UnpicklingError, OSError, ValueError):
            raise LostError("closed" if self._closed else self._ended(time_limit)) from None
        finally:
            watch.cancel()

    def _give_up(self) -> None:
        self._hung = True
        self.kill()

    def _ended(self, time_limit: float) -> str:
        process, self._process = self._process, None
        code = shut(process)
        if self._hung:
            return f"hung: no end of the case within {time_limit:.3g} s"
        if code == NO_MEMORY:
            return f"ran out of memory ({self.memory / 1e9:.3g} GB)"
        said = self._last_words()
        if code < 0:
            import signal

            with suppress(ValueError):
                killer = signal.Signals(-code).name
                return f"its process was killed by {killer}{said}"
        return f"its process ended with exit code {code}{said}"

    def _last_words(self) -> str:
        size = self._said.seek(0, os.SEEK_END)
        self._said.seek(max(0, size - TAIL))
        lines = self._said.read().decode(errors="replace").split("\n")
        last = [line.strip() for line in lines if line.strip()]
        return f": {last[-1]}" if last else ""

    def row(self, request: StudyRequest) -> Row:
        """Run a case, once more if its process is lost, and then give a row that says so."""
        for attempt in range(1, TRIES + 1):
            try:
                row = self.run_request(request)
            except LostError as error:
                last = str(error)
                if self._closed:
                    break
                continue
            row.tries = attempt
            return row
        return Row(request.number, FAILED, f"lost {TRIES} times, last: {last}", (), (), tries=TRIES)

    def kill(self) -> None:
        """End the process at once."""
        if self._process is not None:
            self._process.kill()

    def close(self) -> None:
        """End the process."""
        self.stop()
        shut(self._process)
        self._process = None
        self._said.close()

    def stop(self) -> None:
        """Kill the process and start none again; callers that wait for it continue."""
        self._closed = True
        self.kill()


def shut(process: subprocess.Popen[bytes] | None) -> int:
    """Wait for a process's end, and close what led to it; its exit code."""
    if process is None:
        return 0
    code = process.wait()
    for pipe in (process.stdin, process.stdout):
        with suppress(OSError):
            pipe.close()  # type: ignore[union-attr]
    return code


def singles(requests: Iterable[StudyRequest]) -> Iterator[list[StudyRequest]]:
    """Yield each request as a group of its own."""
    return ([request] for request in requests)


class Pool:
    """Several processes, each with a thread here that waits for it.

    `grouped`: yields groups of requests that one process runs faster than several. A process that has none left takes
    half of what another one has left.
    """

    def __init__(
        self,
        job: Job,
        workers: int,
        memory: int,
        timeout: float = 0.0,
        grouped: Callable[[Iterable[StudyRequest]], Iterator[list[StudyRequest]]] = singles,
    ) -> None:
        self._grouped = grouped
        self._processes = [Process(job, memory, timeout) for _ in range(workers)]
        self._groups: deque[deque[StudyRequest]] = deque()  # that no process has begun
        self._assigned: list[deque[StudyRequest]] = [deque() for _ in range(workers)]  # what is left, by process
        self._lock = threading.Lock()  # of the threads here; never taken by the thread that signals interrupt
        # simple queues: a signal that interrupts one that waits leaves no lock behind
        self._wanted: queue.SimpleQueue[bool] = queue.SimpleQueue()  # True for each request, False: no more
        self._rows: queue.SimpleQueue[Row | NotReadyError] = queue.SimpleQueue()
        self._threads = [threading.Thread(target=self._work, args=(i,), daemon=True) for i in range(workers)]
        for thread in self._threads:
            thread.start()

    def _work(self, index: int) -> None:
        while self._wanted.get():
            try:
                self._rows.put(self._processes[index].row(self._take(index)))
            except NotReadyError as error:
                self._rows.put(error)

    def _take(self, index: int) -> StudyRequest:
        """Return the next request for a process; there is one for each True of the queue."""
        with self._lock:
            if not self._assigned[index]:
                if self._groups:
                    self._assigned[index] = self._groups.popleft()
                else:
                    longest = max(self._assigned, key=len)
                    half = [longest.pop() for _ in range((len(longest) + 1) // 2)]
                    self._assigned[index] = deque(reversed(half))
            return self._assigned[index].popleft()

    def run(self, requests: Iterable[StudyRequest]) -> Iterator[Row]:
        """Rows as they come; few groups are taken ahead."""
        groups, more = self._grouped(requests), True
        pending: dict[int, set[int]] = {}  # number of a request -> numbers that its group has left
        count = 0  # of groups that are not finished
        while more or pending:
            while more and count < AHEAD * len(self._processes):
                if (group := next(groups, None)) is None:
                    more = False
                else:
                    numbers = {request.number for request in group}
                    pending |= dict.fromkeys(numbers, numbers)
                    count += 1
                    self._groups.append(deque(group))
                    for _ in group:
                        self._wanted.put(True)
            if pending:
                row = self._rows.get()
                if isinstance(row, NotReadyError):
                    raise row
                rest = pending.pop(row.number)
                rest.remove(row.number)
                count -= not rest
                yield row

    def close(self) -> None:
        """End all processes, whatever they are at."""
        if not self._threads:
            return
        with suppress(queue.Empty):
            while True:
                self._wanted.get_nowait()
        for process in self._processes:
            self._wanted.put(False)
            process.stop()
        while self._threads:
            self._threads.pop().join()
        for process in self._processes:
            process.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def memory_of_each(workers: int) -> int:
    """Return the memory that a process may use [byte]; 0 if it cannot be determined."""
    with suppress(ValueError, OSError, AttributeError):
        return int(SHARE * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / workers)
    return 0
