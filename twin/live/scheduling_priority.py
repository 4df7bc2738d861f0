"""Real-time priority of a paced loop, where the system allows it; a loop that computes without pause has none.

A browser that draws the page can use all cores of a small machine for milliseconds, which delays a normal process. With
real-time priority the loop is not delayed. It loses the priority when it works more than it waits: a busy process with
real-time priority would block all others, including the server with its STOP.
"""

from __future__ import annotations

import os

PRIORITY = 1  # of SCHED_FIFO: below that of drives
MAX_SHARE = 0.5  # largest fraction of working time with real-time priority
SMOOTHING = 0.9  # weight of the previous estimate of the share, from one block to the next


class LoopPriority:
    """Scheduling priority of the thread that created it. `is_raised`: real-time priority is active."""

    def __init__(self) -> None:
        self.is_raised = False
        # one core stays free for other processes
        self.allowed = hasattr(os, "sched_setscheduler") and (os.cpu_count() or 1) > 1
        self.share = 1.0  # fraction of working time; 1 until measured

    def update(self, worked: float, planned: float) -> None:
        """Account for a block: processor time used, and wall-clock time planned [s]."""
        self.share = SMOOTHING * self.share + (1.0 - SMOOTHING) * (worked / planned if planned > 0.0 else 1.0)
        self._go(self.share < MAX_SHARE)

    def end(self) -> None:
        """Return to normal priority: processes started from here must not inherit it."""
        self.share = 1.0
        self._go(False)

    def _go(self, is_raised: bool) -> None:
        if not self.allowed or is_raised == self.is_raised:
            return
        try:
            if is_raised:
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
            else:
                os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        except OSError:  # not permitted: see `ulimit -r`
            self.allowed = False
            return
        self.is_raised = is_raised
