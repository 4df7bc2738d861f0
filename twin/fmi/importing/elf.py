"""Shared libraries of Linux: target processor and minimum file size, from the header."""

from __future__ import annotations

import platform
import struct
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

HEAD = 1 << 16  # as much of a file as holds its tables [byte]

MACHINES = {  # e_machine: names of the processor
    0x03: ("i386", "i686"),
    0x28: ("armv7l", "armv6l"),
    0x3E: ("x86_64",),
    0xB7: ("aarch64",),
    0xF3: ("riscv64",),
}
ENTRY = 56  # size of a segment's entry [byte]
LOAD = 1  # type of a segment that is mapped into memory


def problem(path: Path) -> str:
    """Return why a library cannot be loaded here, if the loader does not report it itself; else an empty string."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    if head[:4] != b"\x7fELF" or len(head) < 64:
        return ""
    if head[5] == 2:
        return "is for a processor with another order of bytes. Export the FMU for this one."
    machine = struct.unpack_from("<H", head, 18)[0]
    names = MACHINES.get(machine, ())
    if names and platform.machine() not in names:
        return f"is for {names[0]}, this machine is {platform.machine()}. Export the FMU for this machine."
    if head[4] == 2 and ends(head) > path.stat().st_size:
        return "is cut off. Get or build the FMU once more."
    return ""


def ends(head: bytes) -> int:
    """Return the end of the last mapped segment [byte]; access beyond the end of the file raises SIGBUS."""
    table = struct.unpack_from("<Q", head, 32)[0]
    entry, count = struct.unpack_from("<HH", head, 54)
    last = int(table + entry * count)
    if last > len(head) or entry < ENTRY:
        return last
    for header_offset in range(table, last, entry):
        kind, _, offset, _, _, length = struct.unpack_from("<IIQQQQ", head, header_offset)
        if kind == LOAD:
            last = max(last, offset + length)
    return last
