"""The processes of a run: one works, another watches it and keeps what it recorded. Imports nothing heavy."""

from twin.process.death import Death
from twin.process.link import Lines, Link
from twin.process.owner import alive, owner, sweep
from twin.process.stop import SIGNALS, Stop
from twin.process.supervisor import command_line, supervise

__all__ = ["SIGNALS", "Death", "Lines", "Link", "Stop", "alive", "command_line", "owner", "supervise", "sweep"]
