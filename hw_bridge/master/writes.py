"""The one way by which objects of a node are written: read first, noted in the journal, written, read back.

Commands go another way, since they are no configuration: 6040h, NMT, and the signatures of 1010h and 1011h.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.journal import ObjectChange
from hw_bridge.master.sdo import SdoError
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.dictionary import Entry
    from hw_bridge.master.station import Station

LONGEST = 4  # bytes of a number
PDOS = range(0x1400, 0x1C00)
MAPPINGS = (range(0x1600, 0x1800), range(0x1A00, 0x1C00))


def ask(node: Station, index: int, sub: int = 0) -> bytes:
    """A number as the node has it: how many bytes there are is for the node to say, not for the profile."""
    data = node.sdo.read(index, sub)
    entry = node.mirror.objects.get(index, {}).get(sub)
    if not node.sdo.sized and entry is not None:
        data = data[: entry.type.size or LONGEST]
    node.sizes[index, sub] = len(data)
    return data


def is_signed(node: Station, index: int, sub: int, value: int = 0) -> bool:
    """Whether a number is signed, by the profile; what the profile has not, by its value."""
    entry = node.mirror.objects.get(index, {}).get(sub)
    return value < 0 if entry is None else entry.type.signed


def number(node: Station, index: int, sub: int, data: bytes) -> int:
    """The number of these bytes, with the sign that the profile has for it."""
    return int.from_bytes(data, "little", signed=is_signed(node, index, sub))


def read(node: Station, index: int, sub: int = 0) -> int:
    """Read a number, with the sign that the profile has for it, and remember it."""
    node.mirror.entry(index, sub)
    value = node.mirror.values[index, sub] = number(node, index, sub, ask(node, index, sub))
    return value


def before_of(node: Station, index: int, sub: int) -> bytes:
    """What an object holds before it is written. A mapping entry beyond the count may not be readable: nothing then."""
    try:
        return ask(node, index, sub)
    except SdoError:
        if sub and any(index in mapping for mapping in MAPPINGS):
            return b""
        raise


def encoded(node: Station, index: int, sub: int, value: int) -> bytes:
    """A number in as many bytes as the node has for it; SimulationError where it does not fit."""
    signed = is_signed(node, index, sub, value)
    size = node.sizes.get((index, sub)) or len(before_of(node, index, sub)) or LONGEST
    try:
        if size > LONGEST:
            raise OverflowError  # noqa: TRY301
        return value.to_bytes(size, "little", signed=signed)
    except OverflowError:
        raise SimulationError(
            f"{node.name}: {index:04X}h.{sub} cannot hold {value}: it has {size} bytes, "
            f"{'signed' if signed else 'unsigned'}. Check the value and the profile."
        ) from None


def write(node: Station, index: int, sub: int, value: int, reason: str = "", lasting: bool = False) -> None:
    """Write a number in as many bytes as the node has for it, and read it back.

    What it held before is noted in the node's journal first, on the disk where it has a file, so that it can be restored.
    `lasting`: a person asked for this value to stay; it is not noted.
    """
    try:
        before = b"" if lasting or (index, sub) in node.journal.changes else before_of(node, index, sub)
        data = encoded(node, index, sub, value)
        if not lasting:
            node.journal.record([ObjectChange(index, sub, before, [data], reason)])
        read_back = download(node, index, sub, data)
    except SdoError as error:
        raise SdoError(f"{node.name}: {error} It was to become {value}.", error.code) from None
    if sub in node.mirror.objects.get(index, {}):
        node.mirror.values[index, sub] = int.from_bytes(read_back, "little", signed=is_signed(node, index, sub))
    if read_back != data:
        value_read = int.from_bytes(read_back, "little", signed=is_signed(node, index, sub, value))
        raise SimulationError(f"{node.name}: {index:04X}h.{sub} reads {value_read} after {value} was written.")


def download(node: Station, index: int, sub: int, data: bytes) -> bytes:
    """Write bytes, without a journal, and return what the node holds then."""
    node.sdo.write(index, sub, data)
    return ask(node, index, sub)


def limited(entry: Entry, value: int) -> int:
    """A value inside the entry's range."""
    low = entry.low if entry.low is not None else value
    high = entry.high if entry.high is not None else value
    return min(max(value, low), high)


def put(node: Station, index: int, sub: int, value: int, reason: str = "") -> None:
    """Write where the node has such an object, at most what it takes."""
    entry = node.mirror.objects.get(index, {}).get(sub)
    if entry is not None and entry.writable:
        write(node, index, sub, limited(entry, value), reason)
