"""Processes of a run: a supervised worker and the supervisor that saves its recording. Imports no large packages."""

from twin.process.crash_report import CrashReport as CrashReport
from twin.process.process_identity import PREFIX as PREFIX
from twin.process.process_identity import alive as alive
from twin.process.process_identity import cores as cores
from twin.process.process_identity import memory_is_limited as memory_is_limited
from twin.process.process_identity import process_identity as process_identity
from twin.process.process_identity import temporary_folder_for as temporary_folder_for
from twin.process.stop import SIGNALS as SIGNALS
from twin.process.stop import Stop as Stop
from twin.process.stop import handle_signals as handle_signals
from twin.process.stop import is_interrupted as is_interrupted
from twin.process.stop import once as once
from twin.process.supervisor import command_line as command_line
from twin.process.supervisor import end as end
from twin.process.supervisor import supervise as supervise
from twin.process.supervisor_channel import LogLines as LogLines
from twin.process.supervisor_channel import SupervisorChannel as SupervisorChannel
