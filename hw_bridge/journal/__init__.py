"""Journal of the objects that a run changes in a drive: in memory, and on disk before the drive is written."""

from hw_bridge.journal.changes import Journal, ObjectChange
from hw_bridge.journal.file import DriveIdentity, JournalFile, journal_path
from hw_bridge.journal.folder import bus_folder, state_folder

__all__ = [
    "DriveIdentity",
    "Journal",
    "JournalFile",
    "ObjectChange",
    "bus_folder",
    "journal_path",
    "state_folder",
]
