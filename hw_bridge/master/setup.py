"""Set up one drive until process data can begin: identity, parameters with read-back, mapping."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from hw_bridge.dictionary import State, cia402, state_of
from hw_bridge.journal import ObjectChange
from hw_bridge.master.fault_report import format_error_code
from hw_bridge.master.limits import software_limits
from hw_bridge.master.plan import WritePlan, plan_drive
from hw_bridge.master.scaling import learn_scaling
from hw_bridge.master.sdo import SdoError
from hw_bridge.master.writes import read, upload, write, write_if_present
from hw_bridge.profiles import profile_for, unsupported_product

if TYPE_CHECKING:
    from hw_bridge.master.node import Node
    from hw_bridge.master.station import Station

__all__ = [
    "WritePlan",
    "carry_out",
    "configure",
    "faults",
    "forget_heartbeats",
    "identify",
    "learn_scaling",
    "limit_positions",
    "make_safe",
    "plan_drive",
    "read",
    "release",
    "reset",
    "upload",
    "write",
    "write_if_present",
]

DRIVE = 402  # device profile: the lower half of 1000h
IDENTITY = {1: "vendor", 2: "product code", 3: "revision", 4: "serial number"}


def identify(node: Node) -> list[str]:
    """Return every difference between the answering drive and the hardware file."""
    keys, name = node.keys, node.name
    device = node.sdo.number(0x1000)
    if device & 0xFFFF != DRIVE:
        return [f"{name}: node {node.number} is no drive: 1000h is {device:08X}h. Check the node-ID."]
    identity = {sub: node.sdo.number(0x1018, sub) for sub in IDENTITY}
    node.identity = [identity[1], identity[2], identity[4]]
    if (unsupported := unsupported_product(identity[1], identity[2], device)) is not None:
        return [f"{name}: node {node.number} is a {unsupported.title}. No profile fits it. {unsupported.advice}"]
    vendor = node.mirror.get(0x1018, 1)
    expected = {1: vendor} if vendor else {}  # an EDS file may leave it open
    if keys.product is not None:
        expected[2] = keys.product
    elif profile_for(identity[1], identity[2]) not in ("", keys.profile):
        expected[2] = node.mirror.get(0x1018, 2)  # any product, but not that of another profile
    expected |= {4: keys.serial} if keys.serial is not None else {}
    return [
        f"{name}: node {node.number}: {IDENTITY[sub]} is {identity[sub]:X}h, expected {value:X}h "
        f"({node.profile.title}). Correct the hardware file or the wiring."
        for sub, value in expected.items()
        if identity[sub] != value
    ]


def faults(node: Node) -> str:
    """Error text of a drive in Fault, from 603Fh and 1003h; else empty. Only reads."""
    if state_of(node.sdo.number(0x6041) & 0xFFFF) not in (State.FAULT, State.REACTION):
        return ""
    present = _format_error_object(node, 0x603F)
    history = [_format_error_object(node, 0x1003, sub + 1) for sub in range(int(_read_if_present(node, 0x1003) or 0))]
    parts = [f"603Fh: {present}"] if present else []
    parts += [f"1003h: {', '.join(filter(None, history))}"] if any(history) else []
    return f"{node.name}: is in Fault, {'; '.join(parts) or 'and does not say why'}."


def _read_if_present(node: Node, index: int, sub: int = 0) -> int | None:
    """A number, if the drive has it."""
    with suppress(SdoError):
        return node.sdo.number(index, sub)
    return None


def _format_error_object(node: Node, index: int, sub: int = 0) -> str:
    """An error code with its meaning, where there is one."""
    code = (_read_if_present(node, index, sub) or 0) & 0xFFFF
    return format_error_code(node, code) if code else ""


def reset(node: Node) -> State:
    """Leave Fault by the edge of bit 7; return the drive's state afterwards. Its power stage stays off."""
    for word in (0, cia402.FAULT_RESET, 0):
        node.sdo.write(0x6040, 0, word.to_bytes(2, "little"))
    return state_of(node.sdo.number(0x6041) & 0xFFFF)


def configure(node: Node, period: int, master: int) -> None:
    """Write all parameters of a run. The node is in Pre-operational; its power stage is disabled before anything is written.

    New and previous values are in the node's journal before the first write. `period` as in `plan_drive`.
    """
    plan = plan_drive(node, period, master)
    plan.raise_problems()
    node.sdo.write(0x6040, 0, b"\0\0")
    carry_out(plan)


def carry_out(plan: WritePlan) -> None:
    """Make the writes of a plan; SimulationError before the first one if any problem is known."""
    node = plan.node
    plan.raise_problems()
    writes = plan.encode()
    node.journal.record(
        ObjectChange(
            planned.index,
            planned.sub,
            plan.before[planned.index, planned.sub],
            [] if planned.later else [data],
            planned.reason,
        )
        for planned, data in writes
    )
    for planned, _ in writes:
        if not planned.later:
            write(node, planned.index, planned.sub, planned.value, planned.reason)


def limit_positions(node: Node) -> None:
    """Write the software limits 607Dh, once the position reference is known."""
    for sub, end in enumerate(software_limits(node), 1):
        write_if_present(node, 0x607D, sub, end, "limits.position")


def make_safe(node: Node) -> None:
    """Set digital outputs to the hardware file's safe levels."""
    if node.keys.safe_outputs is not None:
        write(node, cia402.OUTPUTS, cia402.LEVELS, node.keys.safe_outputs, "safe_outputs, also after the run")


def forget_offsets(node: Node) -> None:
    """Clear 60B0h to 60B2h, which would be added to every target."""
    for index in cia402.OFFSETS:
        if index in node.mirror and _read_if_present(node, index):
            write(node, index, 0, 0, "would be added to every target")


def release(node: Node) -> State:
    """After an orderly end: disable by SDO too; return the drive's state.

    Only then is its heartbeat consumer cleared: a drive that continues must miss the heartbeat.
    """
    node.sdo.write(0x6040, 0, b"\0\0")
    if (state := state_of(node.sdo.number(0x6041) & 0xFFFF)) not in cia402.AT_REST:
        return state
    if node.keys.offset:
        forget_offsets(node)
    forget_heartbeats(node)
    return state


def forget_heartbeats(node: Station) -> None:
    """Clear the heartbeat consumer and producer times that this program wrote."""
    for index, sub in ((0x1016, node.consumer_entry), (0x1017, 0)):
        if (index, sub) in node.journal.changes:
            write(node, index, sub, 0, "heartbeat")
