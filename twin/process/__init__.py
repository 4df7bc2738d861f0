"""Processes of a run: a supervised worker and the supervisor that saves its recording. Imports no large packages."""

from twin.process.crash_report import CrashReport
from twin.process.process_identity import (
    PREFIX,
    alive,
    cores,
    memory_is_limited,
    process_identity,
    temporary_folder_for,
)
from twin.process.stop import SIGNALS, Stop, handle_signals, is_interrupted
from twin.process.supervisor import command_line, end, supervise
from twin.process.supervisor_channel import LogLines, SupervisorChannel

__all__ = [
    "PREFIX",
    "SIGNALS",
    "CrashReport",
    "LogLines",
    "Stop",
    "SupervisorChannel",
    "alive",
    "command_line",
    "cores",
    "end",
    "handle_signals",
    "is_interrupted",
    "memory_is_limited",
    "process_identity",
    "supervise",
    "temporary_folder_for",
]
