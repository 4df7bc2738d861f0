"""Who is on a bus: every node that answers, what it is, and in which state."""

from __future__ import annotations

import struct
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND, Frame
from hw_bridge.commission.line import BOOT
from hw_bridge.commission.words import told_fault
from hw_bridge.dictionary import State, cia301, state_of
from hw_bridge.profiles import DEVICES, MODULES, identity, profile, profile_for, unfit
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Collection

    from hw_bridge.commission.line import Line

TWICE = "answers to one question: several nodes have this ID"
KINDS = {401: "I/O module (CiA 401)", 402: "drive of an unknown vendor"}  # lower half of 1000h
APART = 2 * MILLISECOND  # between questions to all nodes, so that slow adapters keep up [ns]
QUESTION = 100 * MILLISECOND  # how long a node has to answer the first question [ns]
DRIVE = 402
MUTE = (
    "tells that it lives, but answers no SDO: another master, or it is Stopped. If it is a drive, switch it off and on."
)
PATIENCE = 30 * MILLISECOND  # how long a second node may take that has the same ID [ns]


@dataclass(frozen=True)
class Found:
    """A node that answers. `problem`: why no more is known of it."""

    node: int
    title: str = ""
    identity: tuple[int, int, int, int] = (0, 0, 0, 0)  # 1018h.1 to .4
    state: str = ""
    fault: str = ""
    problem: str = ""

    @property
    def told(self) -> str:
        """What it is, in one line."""
        if self.problem:
            return self.problem
        vendor, product, revision, serial = self.identity
        return f"{self.title}, vendor {vendor:X}h, product {product:X}h, revision {revision:X}h, serial {serial:X}h"


def scan(line: Line, left_out: Collection[int] = ()) -> list[Found]:
    """Every node that answers. Only reads; `left_out`: node-IDs that are not asked."""
    numbers = [number for number in range(1, 128) if number not in left_out]
    count = asked(line, numbers)
    if not count or line.states.keys() - count.keys():  # perhaps it was switched on just now
        line.wait(BOOT)
        count |= asked(line, [number for number in numbers if number not in count])
    found = [
        Found(number, problem=f"{count[number]} {TWICE}") if count[number] > 1 else looked_at(line, number)
        for number in sorted(count)
    ]
    return found + [Found(number, problem=MUTE) for number in sorted(line.states.keys() - count.keys() - {*left_out})]


def asked(line: Line, numbers: Collection[int]) -> Counter[int]:
    """How many answers came from each node-ID to the question for its device type."""
    line.answers.clear()
    for number in numbers:
        line.network.send(Frame(cia301.SDO_REQUEST + number, struct.pack("<BHB4x", 0x40, 0x1000, 0)))
        line.wait(APART)
    line.wait(QUESTION)
    return Counter(number for number, data in line.answers if data[1:4] == b"\x00\x10\x00")


def looked_at(line: Line, number: int) -> Found:
    """One node that answers."""
    client = line.client(number)
    try:
        device = client.number(0x1000)
        vendor, product, revision, serial = (client.number(0x1018, sub) for sub in (1, 2, 3, 4))
        line.answers.clear()
        client.number(0x1018, 1)
        line.wait(PATIENCE)
        if len(line.answers) > 1:
            return Found(number, problem=f"{len(line.answers)} {TWICE}")
        title = known(vendor, product, device) or KINDS.get(device & 0xFFFF, f"device type {device:08X}h")
        state = str(line.states[number].name.capitalize().replace("_", "-")) if number in line.states else ""
        fault = ""
        if device & 0xFFFF == DRIVE:
            power = state_of(client.number(0x6041) & 0xFFFF)
            state = f"{power}{f', {state}' if state else ''}"
            if power in (State.FAULT, State.REACTION):
                name = recognized(vendor, product, device)
                faults = profile(name).faults if name in MODULES else {}
                fault = "; ".join(told_fault(client, faults)) or "does not say why"
    except SimulationError as error:
        return Found(number, problem=f"answers, but not as a CANopen device should: {error}")
    return Found(number, title, (vendor, product, revision, serial), state, fault)


def recognized(vendor: int, product: int, device_type: int) -> str:
    """The name of the profile for what a node says of itself, or nothing. An unknown product gets its vendor's."""
    if unfit(vendor, product, device_type) is not None:
        return ""
    own = {name: identity(name) for name in MODULES}
    exact = [name] if (name := profile_for(vendor, product)) else []
    alike = [name for name, value in own.items() if value[1] == vendor] if device_type & 0xFFFF == DRIVE else []
    modules = [name for name in DEVICES if name == f"cia{device_type & 0xFFFF}"]
    return next(iter([*exact, *alike, *modules]), "")


def known(vendor: int, product: int, device_type: int = 0) -> str:
    """The title of the profile with this identity; the vendor alone if the product is another one."""
    if (other := unfit(vendor, product, device_type)) is not None:
        return f"{other.title}, which no profile fits. {other.advice}"
    if exact := profile_for(vendor, product):
        return profile(exact).title
    titles = [profile(name).title for name in MODULES if identity(name)[1] == vendor]
    return f"perhaps {' or '.join(titles)}" if titles else ""
