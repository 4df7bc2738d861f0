"""Timing statistics of SYNC."""

from __future__ import annotations

from typing import Any

import numpy as np

LONGEST = 2_000_000  # cycles that are kept: nearly three hours at 5 ms


class Timing:
    """Times of SYNC against the plan."""

    def __init__(self, cycle: int) -> None:
        self.cycle = cycle
        self.lateness: list[int] = []  # of each SYNC [ns]
        self.sent: list[int] = []  # time of each SYNC [ns]

    def synced(self, now: int, due: int) -> None:
        """Record a SYNC."""
        if len(self.sent) < LONGEST:
            self.sent.append(now)
            self.lateness.append(now - due)

    @property
    def jitter(self) -> np.ndarray[Any, Any]:
        """Each period between SYNCs minus the cycle [s]."""
        return (np.diff(np.array(self.sent, np.int64)) - self.cycle) / 1e9

    def summary(self) -> dict[str, Any]:
        """Figures in seconds."""
        jitter = np.abs(self.jitter)
        lateness = np.array(self.lateness, np.int64) / 1e9
        if not len(jitter):
            return {"cycles": len(lateness)}
        return {
            "cycles": len(lateness),
            "cycle": self.cycle / 1e9,
            "jitter_std": float(np.std(self.jitter)),
            "jitter_median": float(np.median(jitter)),
            "jitter_99": float(np.quantile(jitter, 0.99)),
            "jitter_999": float(np.quantile(jitter, 0.999)),
            "jitter_max": float(np.max(jitter)),
            "lateness_99": float(np.quantile(lateness, 0.99)),
            "lateness_max": float(np.max(lateness)),
        }
