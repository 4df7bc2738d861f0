"""Summary of all cases of a run."""

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
    """Data of a run for its summary; `shown` is printed on the terminal."""
    reports = [session.report() for session in sessions if session.is_started]
    lost_pdos = sum(node["lost_pdos"] for case in reports for node in case["nodes"].values())
    delayed_pdos = sum(node["late_pdos"] for case in reports for node in case["nodes"].values())
    overruns = sum(case["overruns"] for case in reports)
    bus = "simulated bus" if keys.simulated else f"{keys.interface} {keys.channel}"
    shown = f"{bus}, cycle {keys.cycle / 1e6:g} ms: {lost_pdos} PDOs lost, {delayed_pdos} late, {overruns} overruns"
    if len(jitter):
        jitter = np.abs(jitter)
        shown += f", jitter 99 % below {1e3 * np.quantile(jitter, 0.99):.3f} ms, at most {1e3 * jitter.max():.3f} ms"
    lines = [shown]
    for session, case in zip([session for session in sessions if session.is_started], reports, strict=True):
        if session.trace is not None:
            lines.append(f"{session.trace}: {case['frames']} frames")
        if not keys.simulated:
            lines += case["references"] + case["restorations"]
    return {
        "file": str(path),
        "simulated": keys.simulated,
        "interface": keys.interface,
        "cycle": keys.cycle / 1e9,
        "shown": lines,
        "cases": reports,
        "nodes": keys.model_dump()["nodes"],
        "modules": keys.model_dump()["modules"],
    }


def pictures(keys: HardwareKeys, jitter: Jitter) -> list[dict[str, str]]:
    """Histogram of the jitter, for runs on the wall clock."""
    if not len(jitter):
        return []
    from twin.results import histogram

    note = f"periods between SYNCs minus {keys.cycle / 1e6:g} ms, {len(jitter)} of them"
    return [{"title": "Jitter of the cycle", "svg": histogram(1e3 * jitter, "period - cycle [ms]"), "note": note}]


def notes(sessions: Sequence[Session]) -> list[str]:
    """Notes for the operator."""
    several = len(sessions) > 1
    return [f"{s.variant}: {note}" if several and s.variant else note for s in sessions for note in s.outcome.notes]
