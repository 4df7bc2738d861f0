"""Journal of the objects that a run changes in a drive: in memory, and on disk before the drive is written."""

from hw_bridge.journal.changes import Journal as Journal
from hw_bridge.journal.changes import ObjectChange as ObjectChange
from hw_bridge.journal.file import DriveIdentity as DriveIdentity
from hw_bridge.journal.file import JournalFile as JournalFile
from hw_bridge.journal.file import journal_path as journal_path
from hw_bridge.journal.folder import bus_folder as bus_folder
from hw_bridge.journal.folder import state_folder as state_folder
