"""Bringing one drive to where process data can begin: identity, parameters with read-back, mapping."""

from __future__ import annotations

from contextlib import suppress
from math import ceil
from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND
from hw_bridge.dictionary import Mode, State, cia301, cia402, state_of
from hw_bridge.master.sdo import SdoError
from hw_bridge.master.vendor import SPEED, TRANSMIT, receive
from hw_bridge.master.words import coded
from hw_bridge.profiles import MODULES, UNFIT, identity
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.dictionary import Entry
    from hw_bridge.master.node import Node
    from hw_bridge.master.station import Station

LONGEST = 4  # bytes of a number
DRIVE = 402  # device profile: the lower half of 1000h
IDENTITY = {1: "vendor", 2: "product code", 3: "revision", 4: "serial number"}
KNOWN = {(one[1], one[2]) for one in map(identity, MODULES)}  # vendor and product code of each profile
ACCELERATIONS, VELOCITIES, FOLLOWING_ERROR = (0x6083, 0x6084, 0x6085), (0x607F, 0x6080, 0x6081), 0x6065
RAMPS = (*ACCELERATIONS, *VELOCITIES, FOLLOWING_ERROR)
SCALING = (0x2350, 0x3001, 0x3010, 0x608F, 0x6075, 0x6091, 0x6092, 0x60A9)  # what units follow from


def ask(node: Station, index: int, sub: int = 0) -> bytes:
    """A number as the node has it: how many bytes there are is for the node to say, not for the profile."""
    data = node.sdo.read(index, sub)
    known = node.mirror.objects.get(index, {}).get(sub)
    if not node.sdo.sized and known is not None:
        data = data[: known.type.size or LONGEST]
    node.sizes[index, sub] = len(data)
    return data


def read(node: Station, index: int, sub: int = 0) -> int:
    """Read a number, with the sign that the profile has for it, and remember it."""
    signed = node.mirror.entry(index, sub).type.signed
    value = node.mirror.values[index, sub] = int.from_bytes(ask(node, index, sub), "little", signed=signed)
    return value


def write(node: Station, index: int, sub: int, value: int) -> None:
    """Write a number in as many bytes as the node has for it, and read it back."""
    known = node.mirror.objects.get(index, {}).get(sub)
    signed = value < 0 if known is None else known.type.signed
    try:
        size = node.sizes.get((index, sub)) or len(ask(node, index, sub))
        if size > LONGEST:
            raise OverflowError  # noqa: TRY301
        node.sdo.write(index, sub, value.to_bytes(size, "little", signed=signed))
        found = int.from_bytes(ask(node, index, sub), "little", signed=signed)
    except OverflowError:
        raise SimulationError(
            f"{node.name}: {index:04X}h.{sub} cannot hold {value}: it has {size} bytes, "
            f"{'signed' if signed else 'unsigned'}. Check the value and the profile."
        ) from None
    except SdoError as error:
        raise SdoError(f"{node.name}: {error} It was to become {value}.", error.code) from None
    if known is not None:
        node.mirror.values[index, sub] = found
    if found != value:
        raise SimulationError(f"{node.name}: {index:04X}h.{sub} reads {found} after {value} was written.")


def identify(node: Node) -> list[str]:
    """Every difference between the drive that answers and the one that the hardware file expects."""
    keys, name = node.keys, node.name
    device = node.sdo.number(0x1000)
    if device & 0xFFFF != DRIVE:
        return [f"{name}: node {node.number} is no drive: 1000h is {device:08X}h. Check the node-ID."]
    found = {sub: node.sdo.number(0x1018, sub) for sub in IDENTITY}
    node.identity = [found[1], found[2], found[4]]
    if (title := UNFIT.get((found[1], found[2]))) is not None:
        text = f"{name}: node {node.number} is a {title}, another device than {node.profile.title}, with another dictionary."
        return [f"{text} No profile fits it. Use another drive."]
    expected = {1: node.mirror.get(0x1018, 1)}
    if keys.product is not None:
        expected[2] = keys.product
    elif (found[1], found[2]) in KNOWN - {(expected[1], node.mirror.get(0x1018, 2))}:
        expected[2] = node.mirror.get(0x1018, 2)  # any product, but not that of another profile
    expected |= {4: keys.serial} if keys.serial is not None else {}
    return [
        f"{name}: node {node.number}: {IDENTITY[sub]} is {found[sub]:X}h, expected {value:X}h "
        f"({node.profile.title}). Correct the hardware file or the wiring."
        for sub, value in expected.items()
        if found[sub] != value
    ]


def faults(node: Node) -> str:
    """What a drive in Fault says about it, 603Fh and 1003h; or nothing. It is only read."""
    if state_of(node.sdo.number(0x6041) & 0xFFFF) not in (State.FAULT, State.REACTION):
        return ""
    present = _told(node, 0x603F)
    history = [_told(node, 0x1003, sub + 1) for sub in range(int(_asked(node, 0x1003) or 0))]
    told = [f"603Fh: {present}"] if present else []
    told += [f"1003h: {', '.join(filter(None, history))}"] if any(history) else []
    return f"{node.name}: is in Fault, {'; '.join(told) or 'and does not say why'}."


def _asked(node: Node, index: int, sub: int = 0) -> int | None:
    """A number, if the drive has it."""
    with suppress(SdoError):
        return node.sdo.number(index, sub)
    return None


def _told(node: Node, index: int, sub: int = 0) -> str:
    """An error code with its meaning, where there is one."""
    code = (_asked(node, index, sub) or 0) & 0xFFFF
    return coded(node, code) if code else ""


def reset(node: Node) -> State:
    """Leave Fault, by the edge of bit 7. The state that the drive tells afterwards; its power stage stays off."""
    for word in (0, cia402.FAULT_RESET, 0):
        node.sdo.write(0x6040, 0, word.to_bytes(2, "little"))
    return state_of(node.sdo.number(0x6041) & 0xFFFF)


def differing(node: Node) -> tuple[list[str], list[str]]:
    """Numbers that a run writes: sizes other than in the profile, and those that the drive refuses. Only read."""
    sizes, refused = [], []
    for index, sub in written(node):
        known = node.mirror.objects.get(index, {}).get(sub)
        try:
            size = len(ask(node, index, sub))
        except SdoError as error:
            refused.append(f"{node.name}: {error} A run writes it. Correct the hardware file or the profile.")
            continue
        if known is not None and size != known.type.size:
            sizes.append(f"{node.name}: {index:04X}h.{sub} has {size} bytes, in the profile {known.type.size}.")
    return sizes, refused


def written(node: Node) -> list[tuple[int, int]]:
    """Objects with parameters that a run writes, beside the standard ones for process data and heartbeats."""
    own = [(index, sub) for index, sub, _ in node.vendor.setup] + list(node.keys.objects)
    own += [(cia402.VELOCITY_OFFSET, 0)] if node.keys.offset else []
    entries = node.mirror.objects
    common = [(index, 0) for index in RAMPS] + [(0x607D, 1), (0x607D, 2), (0x60C2, 1)]
    return own + [one for one in common if one[1] in entries.get(one[0], {})]


def configure(node: Node, period: int, master: int) -> None:
    """All parameters of a run. The node is in Pre-operational; its power stage goes off first.

    `period` [ns]: of interpolation; 0: none, and no watch on late targets where a drive has one.
    """
    node.sdo.write(0x6040, 0, b"\0\0")
    offered = read(node, 0x6502)
    if node.told_force and not offered >> (Mode.CST - 1) & 1:
        raise SimulationError(
            f"{node.name}: is told a force, but has no cst: 6502h is {offered:X}h. Use another drive."
        )
    entries = node.mirror.objects
    for index, sub, value in node.vendor.setup:
        write(node, index, sub, value)
    for (index, sub), value in node.keys.objects.items():
        write(node, index, sub, value)
    for index in SCALING:
        for entry in entries.get(index, {}).values():
            if entry.readable and entry.sub:
                read(node, index, entry.sub)
        if 0 in entries.get(index, {}) and len(entries[index]) == 1:
            read(node, index)
    node.use_units()
    if 0x60C2 in entries:
        write(node, 0x60C2, 1, period // MILLISECOND)
        write(node, 0x60C2, 2, -3)
    forget_offsets(node)
    make_safe(node)
    unmask(node)
    ramps(node)
    heartbeat(node, master)
    mapping(node)


def ramps(node: Node) -> None:
    """Accelerations and the largest speed, in the drive's units."""
    limits, scale, units = node.keys.limits, node.keys.scale, node.units
    for index in ACCELERATIONS:
        put(node, index, 0, ceil(limits.acceleration / (scale * units.acceleration)))
    for index in VELOCITIES:
        put(node, index, 0, ceil(limits.velocity / (scale * units.velocity)))
    put(node, FOLLOWING_ERROR, 0, ceil(limits.following_error / (scale * units.position)))


def limit_positions(node: Node) -> None:
    """Software limits 607Dh, once it is known from where positions count. A tenth beyond those of the master.

    Not on this side of where the drive stands after homing: it would jump there as soon as it is enabled.
    """
    low, high = node.keys.limits.position
    margin = 0.1 * (high - low)
    low, high = min(low, node.position), max(high, node.position)
    ends = sorted(node.device_position(one) for one in (low - margin, high + margin))
    for sub, end in enumerate(ends, 1):
        put(node, 0x607D, sub, end)


def put(node: Node, index: int, sub: int, value: int) -> None:
    """Write where the drive has such an object, at most what it takes."""
    entry = node.mirror.objects.get(index, {}).get(sub)
    if entry is not None and entry.writable:
        write(node, index, sub, limited(entry, value))


def limited(entry: Entry, value: int) -> int:
    """A value inside the entry's range."""
    low = entry.low if entry.low is not None else value
    high = entry.high if entry.high is not None else value
    return min(max(value, low), high)


def heartbeat(node: Station, master: int) -> None:
    """Both directions: the drive tells that it lives, and stops when this program does not."""
    times = node.keys.heartbeat
    write(node, 0x1016, 1, 0)
    write(node, 0x1016, 1, master << 16 | times.lost_after // MILLISECOND)
    write(node, 0x1017, 0, times.every // MILLISECOND)


def mapping(node: Node) -> None:
    """The remap procedure for four PDOs each way: one controlword in all, everything at SYNC, the others off."""
    # a drive without interpolation gets several set-points in a cycle: they act when they come
    kind = 1 if 0x60C2 in node.mirror else 255
    received = receive(bool(node.keys.outputs), node.told_force, node.keys.offset)
    transmit: tuple[tuple[int, ...], ...] = (TRANSMIT, (SPEED, node.vendor.current), (), ())
    for number in range(4):
        map_pdo(node, 0x1400 + number, 0x200 + 0x100 * number + node.number, received[number], kind)
        map_pdo(node, 0x1800 + number, 0x180 + 0x100 * number + node.number, transmit[number], 1)


def map_pdo(node: Station, index: int, identifier: int, words: tuple[int, ...], kind: int) -> None:
    """Take a PDO out of use, map it anew, and use it again if it has anything to carry."""
    flags = read(node, index, 1) & 0x40000000
    write(node, index, 1, cia301.INVALID | flags | identifier)
    if not words:
        return
    write(node, index, 2, kind)
    write(node, index + 0x200, 0, 0)
    for place, word in enumerate(words, 1):
        write(node, index + 0x200, place, word)
    write(node, index + 0x200, 0, len(words))
    write(node, index, 1, flags | identifier)


def make_safe(node: Node) -> None:
    """Digital outputs as the hardware file wants them when nothing moves."""
    if node.keys.safe_outputs is not None:
        write(node, cia402.OUTPUTS, cia402.LEVELS, node.keys.safe_outputs)


def forget_offsets(node: Node) -> None:
    """What another program left in 60B0h to 60B2h would be added to every target."""
    for index in cia402.OFFSETS:
        if index in node.mirror and _asked(node, index):
            write(node, index, 0, 0)


def unmask(node: Node) -> None:
    """Let the bits act that follow signals, where the drive has a mask; only after they are safe."""
    if node.keys.outputs and cia402.MASK in node.mirror.objects[cia402.OUTPUTS]:
        write(
            node,
            cia402.OUTPUTS,
            cia402.MASK,
            read(node, cia402.OUTPUTS, cia402.MASK) | sum(1 << bit for bit in node.keys.outputs),
        )


def release(node: Node) -> State:
    """After an orderly end: disabled by SDO too. The state that it tells; no heartbeat is expected if it is at rest."""
    node.sdo.write(0x6040, 0, b"\0\0")
    if (state := state_of(node.sdo.number(0x6041) & 0xFFFF)) not in cia402.AT_REST:
        return state
    if node.keys.offset:
        forget_offsets(node)
    node.sdo.write(0x1016, 1, b"\0\0\0\0")
    node.sdo.write(0x1017, 0, b"\0\0")
    return state
