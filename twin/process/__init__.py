"""The processes of a run: one works, another watches it and keeps what it recorded. Imports nothing heavy."""

from twin.process.death import Death
from twin.process.link import Lines, Link
from twin.process.owner import PREFIX, alive, memory_is_limited, owner, place_for, sweep
from twin.process.stop import SIGNALS, Stop, handle_signals, is_interrupted
from twin.process.supervisor import command_line, end, supervise

__all__ = [
    "PREFIX",
    "SIGNALS",
    "Death",
    "Lines",
    "Link",
    "Stop",
    "alive",
    "command_line",
    "end",
    "handle_signals",
    "is_interrupted",
    "memory_is_limited",
    "owner",
    "place_for",
    "supervise",
    "sweep",
]
