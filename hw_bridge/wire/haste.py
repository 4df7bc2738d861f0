"""What a process can do against being kept waiting: priority, memory that stays, no pauses of the collector."""

from __future__ import annotations

import ctypes
import gc
import os

MASTER, DRIVE = 20, 10  # of SCHED_FIFO: a master before simulated drives, both before everything ordinary
MCL_CURRENT, MCL_FUTURE = 1, 2  # of mlockall, sys/mman.h


def hasten(priority: int) -> bool:
    """Go before ordinary processes, where the system has that and allows it; a loop that always waits may."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except (AttributeError, OSError):
        return False
    return True


def lock() -> bool:
    """Keep the process's memory from being paged out, where the system has that and allows it (`ulimit -l`)."""
    try:
        return bool(ctypes.CDLL(None).mlockall(MCL_CURRENT | MCL_FUTURE) == 0)
    except (AttributeError, OSError, TypeError):
        return False


def unlock() -> None:
    """Undo `lock`, where there was one."""
    ctypes.CDLL(None).munlockall()


class Haste:
    """All of it for as long as a bus is open. `real_time`, `locked`: what was allowed."""

    def __init__(self, priority: int) -> None:
        self._collecting = gc.isenabled()
        gc.collect(1)  # what is new; to look at all there is may take a quarter of a second, with drives on the bus
        gc.disable()  # its pauses are longer than a cycle
        self.real_time = hasten(priority)
        self.locked = False

    def lock(self) -> bool:
        """Lock the memory too. It takes a large process long: not while something moves already."""
        self.locked = self.locked or (self.real_time and lock())  # a process that waits for its turn gains nothing
        return self.locked

    def end(self) -> None:
        """As it was before."""
        if self._collecting:
            gc.enable()
        if self.real_time:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        if self.locked:
            unlock()


def settle() -> bool:
    """For a process that runs for ever: what there is now is never collected, only what is new. Whether it goes first."""
    gc.collect()
    gc.freeze()
    return hasten(DRIVE) and lock()
