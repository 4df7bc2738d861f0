"""A process that runs cases: `python -m twin.study.execution.worker`, told by its stdin, heard by its stdout.

First comes a `Job`, to which it answers what is wrong with it, if anything; then requests, for each a row. The process ends with its stdin, so that none is left
when whoever started it is gone. What components print goes to stderr.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, BinaryIO

from twin.process import SIGNALS

if TYPE_CHECKING:
    from twin.study.execution.case_engine import Job

NO_MEMORY = 77  # exit code


def limit_memory(size: int) -> None:
    """Let this process have so many bytes of its own, where the system can limit that; 0: as many as there are."""
    if not size:
        return
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (size, size))


def serve(take: BinaryIO, give: BinaryIO) -> None:
    """Run cases until there are no more."""
    job: Job
    job, memory = pickle.load(take)  # noqa: S301 - from the parent process
    from twin.errors import TwinError
    from twin.study.execution.case_engine import Engine

    limit_memory(memory)
    try:
        engine, trouble = Engine(job), ""
    except (TwinError, OSError, ImportError) as error:
        trouble = str(error) or type(error).__name__
    pickle.dump(trouble, give)
    give.flush()
    while not trouble:
        try:
            request = pickle.load(take)  # noqa: S301
        except EOFError:
            return
        pickle.dump(engine.row(request), give)
        give.flush()


def main() -> int:
    """Serve; the exit code tells whether memory ran out."""
    # those of a terminal or a batch system reach all processes, and are for the one that started this
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    give = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    try:
        serve(sys.stdin.buffer, give)
    except MemoryError:
        return NO_MEMORY
    except BrokenPipeError:
        pass
    return 0


if __name__ == "__main__":
    os._exit(main())
