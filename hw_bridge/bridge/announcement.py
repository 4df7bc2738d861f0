"""The list of all objects that a run will write, printed before the first run with a hardware file."""

from __future__ import annotations

import hashlib
from contextlib import suppress
from typing import TYPE_CHECKING

from hw_bridge.commission import planned_rows, write_heading
from hw_bridge.journal import state_folder
from twin.cli import say

if TYPE_CHECKING:
    from pathlib import Path

    from hw_bridge.master import Master


def announce(master: Master) -> None:
    """Print the list to stderr, unless it was printed for these keys before. Simulated drives of this process have none."""
    marker = _marker(master)
    if master.keys.simulated or marker.exists():
        return
    for line in lines(master):
        say(line, err=True)
    with suppress(OSError):  # then it is printed again
        marker.parent.mkdir(parents=True, exist_ok=True)
        marker.touch()


def lines(master: Master) -> list[str]:
    """Format each object with its name, current value, new value and reason; a header before each node's."""
    text = []
    for station in master.stations.values():
        with master.asking(station):
            plan = master.plan(station)
            rows = planned_rows(plan)
        text.append(write_heading(plan, rows))
        text += [f"  {row.object} {row.name}: {row.before} -> {row.after} ({row.reason})" for row in rows]
    return text


def _marker(master: Master) -> Path:
    """A file that marks the list as printed for these keys."""
    text = master.keys.model_dump_json()
    return state_folder() / "announced" / hashlib.sha256(text.encode()).hexdigest()[:32]
