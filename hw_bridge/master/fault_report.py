"""Failure texts: EMCY, 603Fh, 1003h, and another master as possible cause."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.dictionary import State, cia301

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from hw_bridge.master.node import Node
    from hw_bridge.master.station import EmergencyMessage, Station

LAST = 4  # EMCY messages shown


def format_error_code(station: Station, code: int, separator: str = " ") -> str:
    """Format an error code with its meaning, where the profile has it."""
    fault = station.profile.faults.get(code)
    return f"{code:04X}h" + (f"{separator}{fault.meaning}" if fault else "")


def format_emergency(station: Station, emergency: EmergencyMessage, separator: str = " ") -> str:
    """Format an EMCY message: code with its meaning, and details."""
    return f"{format_error_code(station, emergency.code, separator)}{format_emergency_details(station, emergency)}"


def format_emergency_details(station: Station, emergency: EmergencyMessage) -> str:
    """Format 1001h, the vendor's bytes of an EMCY message, and their meanings in the profile."""
    register, vendor = emergency.register, emergency.vendor
    text = f"1001h {register:02X}h {cia301.error_register(register)}"
    if any(vendor):
        word = int.from_bytes(vendor[:2], "little")
        meanings = {fault.vendor: fault.meaning for fault in station.profile.faults.values() if fault.vendor}
        names = ", ".join(dict.fromkeys(meaning for bit, meaning in meanings.items() if word & bit))
        text += f"; vendor's bytes {vendor.hex(' ').upper()}{f', 2320h {names}' if names else ''}"
    return f" ({text})"


def format_emergencies(stations: Iterable[Station]) -> str:
    """Format the EMCY messages received; 0000h is the end of an error. Empty without any."""
    texts = [
        f"{station.name} {format_emergency(station, emergency)}"
        for station in stations
        for emergency in station.emergencies
        if emergency.code
    ]
    return f"EMCY: {', '.join(texts[-LAST:])}." if texts else ""


def describe_failure(text: str, foreign_master: str, fault_texts: Sequence[str], stations: Iterable[Station]) -> str:
    """Complete a failure text. `fault_texts`: of drives in Fault; EMCY messages are added where no drive could be read."""
    emergency_text = "" if fault_texts or "EMCY" in text else format_emergencies(stations)
    return " ".join(
        [text, *(part for part in (foreign_master, *fault_texts, emergency_text) if part and part not in text)]
    )


def next_step(nodes: Iterable[Node], has_foreign_master: bool) -> str:
    """What the operator does after a stop on a failure. `has_foreign_master`: another master sent something."""
    steps = ["switch the other program off"] if has_foreign_master else []
    steps.append("remove the cause")
    if any(node.state in (State.FAULT, State.REACTION) for node in nodes):
        steps.append("reset with `twin hil reset -f FILE`")
    homing = [node for node in nodes if node.keys.homing is not None and node.started]
    lost = ", ".join(node.name for node in homing if not node.has_reference)
    homed = ", ".join(node.name for node in homing if node.has_reference)
    parts = [f"homed again: {lost}"] if lost else []
    parts += [f"not homed again: {homed}"] if homed else []
    references = f" ({'; '.join(parts)})" if parts else ""
    return f"next: {', '.join(steps)}, run again{references}."
