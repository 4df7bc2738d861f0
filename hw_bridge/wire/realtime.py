"""Real-time settings of a process: priority, locked memory, no pauses of the garbage collector."""

from __future__ import annotations

import ctypes
import gc
import os

MASTER, DRIVE = 20, 10  # of SCHED_FIFO: a master before simulated drives, both before everything ordinary
MCL_CURRENT, MCL_FUTURE = 1, 2  # of mlockall, sys/mman.h


def set_fifo_priority(priority: int) -> bool:
    """Set SCHED_FIFO, where the system has and allows it; only for a loop that always waits."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except (AttributeError, OSError):
        return False
    return True


def lock() -> bool:
    """Lock the process's memory, where the system has and allows it (`ulimit -l`)."""
    try:
        return bool(ctypes.CDLL(None).mlockall(MCL_CURRENT | MCL_FUTURE) == 0)
    except (AttributeError, OSError, TypeError):
        return False


def unlock() -> None:
    """Undo `lock`."""
    ctypes.CDLL(None).munlockall()


class RealtimeScope:
    """Real-time settings while a bus is open. `real_time`, `locked`: what was allowed."""

    def __init__(self, priority: int) -> None:
        self._collecting = gc.isenabled()
        gc.collect(1)  # what is new; to look at all there is may take a quarter of a second, with drives on the bus
        gc.disable()  # its pauses are longer than a cycle
        self.real_time = set_fifo_priority(priority)
        self.locked = False

    def lock(self) -> bool:
        """Lock the memory too. It takes a large process long: not while something moves."""
        self.locked = self.locked or (self.real_time and lock())  # a process that waits for its turn gains nothing
        return self.locked

    def end(self) -> None:
        """Restore the previous settings."""
        if self._collecting:
            gc.enable()
        if self.real_time:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        if self.locked:
            unlock()


def freeze_gc_and_set_fifo() -> bool:
    """Exclude present objects from garbage collection and set SCHED_FIFO, for a process that runs for ever."""
    gc.collect()
    gc.freeze()
    return set_fifo_priority(DRIVE) and lock()
