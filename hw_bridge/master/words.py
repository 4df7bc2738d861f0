"""What a failure is told with: the drives' own words (EMCY, 603Fh, 1003h), and another master that may be its cause."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.dictionary import State, cia301

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from hw_bridge.master.node import Node
    from hw_bridge.master.station import EmergencyMessage, Station

LAST = 4  # so many EMCY messages are told


def coded(station: Station, code: int, separator: str = " ") -> str:
    """An error code with its meaning, where the profile knows it."""
    fault = station.profile.faults.get(code)
    return f"{code:04X}h" + (f"{separator}{fault.meaning}" if fault else "")


def message(station: Station, emergency: EmergencyMessage, separator: str = " ") -> str:
    """An EMCY message in full: code with its meaning, and what else it tells."""
    return f"{coded(station, emergency.code, separator)}{details(station, emergency)}"


def details(station: Station, emergency: EmergencyMessage) -> str:
    """What an EMCY message tells beside its code: bits of 1001h, the vendor's bytes, and what the profile knows of them."""
    register, vendor = emergency.register, emergency.vendor
    text = f"1001h {register:02X}h {cia301.error_register(register)}"
    if any(vendor):
        word = int.from_bytes(vendor[:2], "little")
        known = {fault.vendor: fault.meaning for fault in station.profile.faults.values() if fault.vendor}
        found = ", ".join(dict.fromkeys(meaning for bit, meaning in known.items() if word & bit))
        text += f"; vendor's bytes {vendor.hex(' ').upper()}{f', 2320h {found}' if found else ''}"
    return f" ({text})"


def emergencies(stations: Iterable[Station]) -> str:
    """The EMCY messages that came, or nothing; 0000h tells the end of an error."""
    found = [
        f"{station.name} {message(station, said)}" for station in stations for said in station.emergencies if said.code
    ]
    return f"EMCY: {', '.join(found[-LAST:])}." if found else ""


def in_full(text: str, rival: str, said: Sequence[str], stations: Iterable[Station]) -> str:
    """A failure with what it does not tell yet. `said`: by drives in Fault; EMCY counts where none of them could be asked."""
    told = "" if said or "EMCY" in text else emergencies(stations)
    return " ".join([text, *(one for one in (rival, *said, told) if one and one not in text)])


def next_step(nodes: Iterable[Node], is_rivaled: bool) -> str:
    """What a person does after a stop on a failure. `is_rivaled`: another master sent something."""
    steps = ["switch the other program off"] if is_rivaled else []
    steps.append("remove the cause")
    if any(node.state in (State.FAULT, State.REACTION) for node in nodes):
        steps.append("reset with `twin hil reset FILE`")
    homing = [node for node in nodes if node.keys.homing is not None and node.started]
    again = ", ".join(node.name for node in homing if not node.has_reference)
    kept = ", ".join(node.name for node in homing if node.has_reference)
    told = [f"homed again: {again}"] if again else []
    told += [f"not homed again: {kept}"] if kept else []
    references = f" ({'; '.join(told)})" if told else ""
    return f"next: {', '.join(steps)}, run again{references}."
