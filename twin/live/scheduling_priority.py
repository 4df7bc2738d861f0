"""A loop that keeps the time goes before ordinary processes, where the system allows it; one that only computes does not.

A browser that draws the page takes all cores of a small machine for some milliseconds, and a process that wakes up waits for
its turn. With real-time priority it does not. It gives that back as soon as it works more than it waits: whoever has such a
priority and never waits keeps everybody else from running, the server with its STOP among them.
"""

from __future__ import annotations

import os

PRIORITY = 1  # of SCHED_FIFO: below all that drives use
MAX_SHARE = 0.5  # of the time that may be work, for that
SMOOTHING = 0.9  # weight of the previous estimate of the share, from one block to the next


class LoopPriority:
    """Of the thread that made it. `first`: whether it goes before ordinary ones now."""

    def __init__(self) -> None:
        self.is_raised = False
        self.allowed = hasattr(os, "sched_setscheduler") and (os.cpu_count() or 1) > 1  # the others need one
        self.share = 1.0  # part of the time that is work; 1 until it is measured

    def update(self, worked: float, planned: float) -> None:
        """A block took so much processor time, and stands for so much of the wall clock's [s]."""
        self.share = SMOOTHING * self.share + (1.0 - SMOOTHING) * (worked / planned if planned > 0.0 else 1.0)
        self._go(self.share < MAX_SHARE)

    def end(self) -> None:
        """As every process: what is built and started is not to inherit it."""
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
        except OSError:  # not without the right to it: `ulimit -r`
            self.allowed = False
            return
        self.is_raised = is_raised
