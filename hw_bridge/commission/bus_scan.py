"""Scan of a bus: every responding node, its identity and state."""

from __future__ import annotations

import struct
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND, Frame
from hw_bridge.commission.object_texts import read_faults
from hw_bridge.commission.sdo_session import BOOT
from hw_bridge.dictionary import State, cia301, state_of
from hw_bridge.profiles import DEVICES, DRIVE_PROFILES, identity, profile, profile_for, unsupported_product
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from hw_bridge.commission.sdo_session import SdoSession

DUPLICATE_ID = "answers to one question: several nodes have this ID"
KINDS = {401: "I/O module (CiA 401)", 402: "drive of an unknown vendor"}  # lower half of 1000h
REQUEST_INTERVAL = 2 * MILLISECOND  # between requests to all nodes, so that slow adapters keep up [ns]
RESPONSE_TIME = 100 * MILLISECOND  # how long a node has to answer the first question [ns]
DRIVE = 402
MUTE = (
    "tells that it lives, but answers no SDO: another master, or it is Stopped. If it is a drive, switch it off and on."
)
SECOND_RESPONSE_TIME = 30 * MILLISECOND  # how long a second node may take that has the same ID [ns]


@dataclass(frozen=True)
class ScannedNode:
    """A responding node. `problem`: why no more is known of it."""

    node: int
    title: str = ""
    identity: tuple[int, int, int, int] = (0, 0, 0, 0)  # 1018h.1 to .4
    state: str = ""
    fault: str = ""
    problem: str = ""

    @property
    def description(self) -> str:
        """Description in one line."""
        if self.problem:
            return self.problem
        vendor, product, revision, serial = self.identity
        return f"{self.title}, vendor {vendor:X}h, product {product:X}h, revision {revision:X}h, serial {serial:X}h"


def scan(sdo_session: SdoSession, left_out: Collection[int] = ()) -> list[ScannedNode]:
    """Return every responding node. Only reads; `left_out`: node-IDs that are not read."""
    numbers = [number for number in range(1, 128) if number not in left_out]
    count = count_responses(sdo_session, numbers)
    if not count or sdo_session.states.keys() - count.keys():  # perhaps it was switched on just now
        sdo_session.wait(BOOT)
        count |= count_responses(sdo_session, [number for number in numbers if number not in count])
    nodes = [
        ScannedNode(number, problem=f"{count[number]} {DUPLICATE_ID}")
        if count[number] > 1
        else identify_node(sdo_session, number)
        for number in sorted(count)
    ]
    return nodes + [
        ScannedNode(number, problem=MUTE) for number in sorted(sdo_session.states.keys() - count.keys() - {*left_out})
    ]


def membership_problems(responding: Collection[int], expected: Mapping[int, str]) -> list[str]:
    """Problem text for each node of a hardware file that does not answer, and for each other node that does.

    `expected`: names of the file's nodes by node-ID.
    """
    absent = [
        f"{name}: node {number} does not answer. Check its power and node-ID."
        for number, name in expected.items()
        if number not in responding
    ]
    return absent + [
        f"node {number} is not in the hardware file. Add it, or take it off the bus."
        for number in responding
        if number not in expected
    ]


def count_responses(sdo_session: SdoSession, numbers: Collection[int]) -> Counter[int]:
    """Count the responses of each node-ID to a request of its device type."""
    sdo_session.answers.clear()
    for number in numbers:
        sdo_session.network.send(Frame(cia301.SDO_REQUEST + number, struct.pack("<BHB4x", 0x40, 0x1000, 0)))
        sdo_session.wait(REQUEST_INTERVAL)
    sdo_session.wait(RESPONSE_TIME)
    return Counter(number for number, data in sdo_session.answers if data[1:4] == b"\x00\x10\x00")


def identify_node(sdo_session: SdoSession, number: int) -> ScannedNode:
    """Identify one responding node."""
    client = sdo_session.client(number)
    try:
        device = client.number(0x1000)
        vendor, product, revision, serial = (client.number(0x1018, sub) for sub in (1, 2, 3, 4))
        sdo_session.answers.clear()
        client.number(0x1018, 1)
        sdo_session.wait(SECOND_RESPONSE_TIME)
        if len(sdo_session.answers) > 1:
            return ScannedNode(number, problem=f"{len(sdo_session.answers)} {DUPLICATE_ID}")
        title = profile_title_of(vendor, product, device) or KINDS.get(device & 0xFFFF, f"device type {device:08X}h")
        state = (
            str(sdo_session.states[number].name.capitalize().replace("_", "-")) if number in sdo_session.states else ""
        )
        fault = ""
        if device & 0xFFFF == DRIVE:
            power = state_of(client.number(0x6041) & 0xFFFF)
            state = f"{power}{f', {state}' if state else ''}"
            if power in (State.FAULT, State.REACTION):
                name = profile_name_of(vendor, product, device)
                faults = profile(name).faults if name in DRIVE_PROFILES else {}
                fault = "; ".join(read_faults(client, faults)) or "does not say why"
    except SimulationError as error:
        return ScannedNode(number, problem=f"answers, but not as a CANopen device should: {error}")
    return ScannedNode(number, title, (vendor, product, revision, serial), state, fault)


def profile_name_of(vendor: int, product: int, device_type: int) -> str:
    """Name of the profile for a node's identity, or empty. An unknown product gets its vendor's."""
    if unsupported_product(vendor, product, device_type) is not None:
        return ""
    own = {name: identity(name) for name in DRIVE_PROFILES}
    exact = [name] if (name := profile_for(vendor, product)) else []
    alike = [name for name, value in own.items() if value[1] == vendor] if device_type & 0xFFFF == DRIVE else []
    modules = [name for name in DEVICES if name == f"cia{device_type & 0xFFFF}"]
    return next(iter([*exact, *alike, *modules]), "")


def profile_title_of(vendor: int, product: int, device_type: int = 0) -> str:
    """Title of the profile for this identity; of the vendor's profiles if the product is unknown."""
    if (other := unsupported_product(vendor, product, device_type)) is not None:
        return f"{other.title}, which no profile fits. {other.advice}"
    if exact := profile_for(vendor, product):
        return profile(exact).title
    titles = [profile(name).title for name in DRIVE_PROFILES if identity(name)[1] == vendor]
    return f"perhaps {' or '.join(titles)}" if titles else ""
