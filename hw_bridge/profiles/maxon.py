"""Communication objects that maxon's drives share (CiA 301), and flags of their COB-IDs."""

from __future__ import annotations

from hw_bridge.dictionary import U8, record, sub
from hw_bridge.profiles.rows import numbered

NO_RTR, DISABLED = 0x40000000, 0xC0000000
ERROR_HISTORY = record(
    0x1003, "Error history", sub(0, "Number of errors", U8, "rw"), *numbered("Error history {}", 5, "ro")
)
CONSUMERS = record(0x1016, "Consumer heartbeat time", *numbered("Consumer {} heartbeat time", 2))
