"""What is told of all cases of a run together."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from hw_bridge.hardware import HardwareKeys
    from hw_bridge.session import Session


Jitter = np.ndarray[Any, Any]  # periods between SYNCs minus the cycle [s]


def report(path: Path, keys: HardwareKeys, sessions: Sequence[Session], jitter: Jitter) -> dict[str, Any]:
    """What is worth keeping of a run, for its summary; `shown` is what the terminal tells."""
    reports = [session.report() for session in sessions if session.begun]
    lost = sum(node["lost_pdos"] for one in reports for node in one["nodes"].values())
    late = sum(node["late_pdos"] for one in reports for node in one["nodes"].values())
    overruns = sum(one["overruns"] for one in reports)
    bus = "simulated bus" if keys.simulated else f"{keys.interface} {keys.channel}"
    shown = f"{bus}, cycle {keys.cycle / 1e6:g} ms: {lost} PDOs lost, {late} late, {overruns} overruns"
    if len(jitter):
        jitter = np.abs(jitter)
        shown += f", jitter 99 % below {1e3 * np.quantile(jitter, 0.99):.3f} ms, at most {1e3 * jitter.max():.3f} ms"
    told = [shown]
    for session, one in zip([one for one in sessions if one.begun], reports, strict=True):
        if session.trace is not None:
            told.append(f"{session.trace}: {one['frames']} frames")
        if not keys.simulated:
            told += one["references"] + one["restorations"]
    return {
        "file": str(path),
        "simulated": keys.simulated,
        "interface": keys.interface,
        "cycle": keys.cycle / 1e9,
        "shown": told,
        "cases": reports,
        "nodes": keys.model_dump()["nodes"],
        "modules": keys.model_dump()["modules"],
    }


def pictures(keys: HardwareKeys, jitter: Jitter) -> list[dict[str, str]]:
    """The histogram of the jitter, where time was the wall clock's."""
    if not len(jitter):
        return []
    from twin.results import histogram

    note = f"periods between SYNCs minus {keys.cycle / 1e6:g} ms, {len(jitter)} of them"
    return [{"title": "Jitter of the cycle", "svg": histogram(1e3 * jitter, "period - cycle [ms]"), "note": note}]


def notes(sessions: Sequence[Session]) -> list[str]:
    """What the person who runs this has to know."""
    several = len(sessions) > 1
    return [f"{s.variant}: {note}" if several and s.variant else note for s in sessions for note in s.account.notes]
