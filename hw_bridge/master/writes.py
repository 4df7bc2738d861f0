"""The single path for writing objects of a node: read, record in the journal, write, read back.

Commands do not use it, since they are no configuration: 6040h, NMT, and the signatures of 1010h and 1011h.
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


def upload(node: Station, index: int, sub: int = 0) -> bytes:
    """Upload a number in the node's own size, which may differ from the profile's."""
    data = node.sdo.read(index, sub)
    entry = node.mirror.find(index, sub)
    if not node.sdo.sized and entry is not None:
        data = data[: entry.type.size or LONGEST]
    node.sizes[index, sub] = len(data)
    return data


def is_signed(node: Station, index: int, sub: int, value: int = 0) -> bool:
    """Whether a number is signed, by the profile; without an entry, by its value."""
    entry = node.mirror.find(index, sub)
    return value < 0 if entry is None else entry.type.signed


def decode_number(node: Station, index: int, sub: int, data: bytes) -> int:
    """Decode a number, with the sign of its profile entry."""
    return int.from_bytes(data, "little", signed=is_signed(node, index, sub))


def read(node: Station, index: int, sub: int = 0) -> int:
    """Upload a number, decode it, and store it in `node.mirror`."""
    node.mirror.entry(index, sub)
    value = node.mirror.values[index, sub] = decode_number(node, index, sub, upload(node, index, sub))
    return value


def upload_before_write(node: Station, index: int, sub: int) -> bytes:
    """Upload the value before a write. Mapping entries beyond the count may not be readable: empty then."""
    try:
        return upload(node, index, sub)
    except SdoError:
        if any(index in mapping for mapping in MAPPINGS) and sub > _mapped_count(node, index):
            return b""
        raise


def _mapped_count(node: Station, index: int) -> int:
    """Number of mapped objects before this program changed it."""
    change = node.journal.changes.get((index, 0))
    return int.from_bytes(change.before if change is not None else upload(node, index), "little")


def encode_number(node: Station, index: int, sub: int, value: int) -> bytes:
    """Encode a number in the node's own size; SimulationError where it does not fit."""
    signed = is_signed(node, index, sub, value)
    size = node.sizes.get((index, sub)) or len(upload_before_write(node, index, sub)) or LONGEST
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
    """Write a number in the node's own size, and read it back.

    The previous value is recorded in the node's journal first, on disk where it has a file, so that it can be restored.
    `lasting`: the operator wants this value to stay; it is not recorded.
    """
    try:
        before = b"" if lasting or (index, sub) in node.journal.changes else upload_before_write(node, index, sub)
        data = encode_number(node, index, sub, value)
        if not lasting:
            node.journal.record([ObjectChange(index, sub, before, [data], reason)])
        read_back = download(node, index, sub, data)
    except SdoError as error:
        raise SdoError(f"{node.name}: {error} It was to become {value}.", error.code) from None
    if node.mirror.find(index, sub):
        node.mirror.values[index, sub] = int.from_bytes(read_back, "little", signed=is_signed(node, index, sub))
    if read_back != data:
        value_read = int.from_bytes(read_back, "little", signed=is_signed(node, index, sub, value))
        raise SimulationError(f"{node.name}: {index:04X}h.{sub} reads {value_read} after {value} was written.")


def download(node: Station, index: int, sub: int, data: bytes) -> bytes:
    """Write bytes without a journal, and return the value afterwards."""
    node.sdo.write(index, sub, data)
    return upload(node, index, sub)


def clamp_to_range(entry: Entry, value: int) -> int:
    """Clamp a value to the entry's range."""
    low = entry.low if entry.low is not None else value
    high = entry.high if entry.high is not None else value
    return min(max(value, low), high)


def write_if_present(node: Station, index: int, sub: int, value: int, reason: str = "") -> None:
    """Write where the node has such an object, clamped to its range."""
    entry = node.mirror.find(index, sub)
    if entry is not None and entry.writable:
        write(node, index, sub, clamp_to_range(entry, value), reason)
