"""SDO session with a bus: SDO to any node. Without process data and heartbeat, so that it moves nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND, Frame, never
from hw_bridge.commission.object_texts import read_faults
from hw_bridge.dictionary import NmtState, State, cia301, state_of
from hw_bridge.hardware import ModuleKeys, NodeKeys
from hw_bridge.master import Node, SdoClient, Station, restoration
from hw_bridge.profiles import DEVICES, DRIVE_PROFILES, GENERIC, Device, Rules, device, profile
from twin.errors import SimulationError, nearest

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hw_bridge.bus import Condition, Network

BOOT = 500 * MILLISECOND  # a drive that is switched on together with the bus answers after that [ns]
COMMUNICATION = 0x10  # bit of the error register 1001h
ALIVE = {int(state) for state in NmtState}  # states in a heartbeat
MOVING = (State.ENABLED, State.QUICK_STOP, State.REACTION)
UNKNOWN = Device("unknown", "a device without a profile", (), {}, Rules(0, 0))  # type: ignore[arg-type]


class SdoSession:
    """SDO access to the nodes of a bus. `keys`: nodes of a hardware file by name, none without one."""

    def __init__(self, network: Network, keys: Mapping[str, NodeKeys | ModuleKeys] | None = None) -> None:
        self.network, self.keys = network, dict(keys or {})
        self.clients: dict[int, SdoClient] = {}
        self.states: dict[int, NmtState] = {}  # of nodes with heartbeats
        self.answers: list[tuple[int, bytes]] = []  # to SDO, of any node
        network.hear = lambda _frame: None
        network.observe(self._on_frame)

    def _on_frame(self, _time: int, frame: Frame | None) -> None:
        """A frame on the bus."""
        if frame is None or frame.remote or not frame.data:
            return
        number = frame.id & 0x7F
        if frame.id == cia301.SDO_RESPONSE + number:
            self.answers.append((number, frame.data))
            if number in self.clients:
                self.clients[number].process_frame(frame.data)
        elif frame.id == cia301.ERROR_CONTROL + number and frame.data[0] & 0x7F in ALIVE:
            state = NmtState(frame.data[0] & 0x7F)  # after boot-up it is Pre-operational by itself
            self.states[number] = NmtState.PRE_OPERATIONAL if state is NmtState.INITIALIZING else state

    def wait(self, duration: int, done: Condition = never) -> None:
        """Let time pass and receive frames, at most `duration` [ns]."""
        self.network.advance(self.network.now + duration, done)

    def client(self, number: int) -> SdoClient:
        """SDO client of a node."""
        return self.clients.setdefault(number, SdoClient(number, self.network.send, self.wait))

    def nmt(self, command: int, number: int) -> None:
        """Send an NMT command to one node."""
        self.network.send(Frame(cia301.NMT, bytes([command, number])))

    def number(self, word: str) -> tuple[int, str]:
        """Node-ID and name of a node, given its ID or its name in the hardware file."""
        return node_number(word, self.keys)

    def node(self, word: str, named: str = "") -> Node | Station:
        """A node with the objects of its profile: `named`, that of the hardware file, or by its identity (1018h)."""
        from hw_bridge.commission.bus_scan import profile_name_of

        number, name = self.number(word)
        keys = self.keys.get(name)
        chosen = named or (keys.profile if keys is not None else "")
        if not chosen:
            client = self.client(number)
            chosen = profile_name_of(client.number(0x1018, 1), client.number(0x1018, 2), client.number(0x1000))
        if chosen in DRIVE_PROFILES or (keys is not None and chosen == keys.profile and chosen in GENERIC):
            own = keys if isinstance(keys, NodeKeys) else NodeKeys.model_validate({"node": 1, "profile": chosen})
            own = own.model_copy(update={"node": number})  # also 127, which no hardware file may name
            described = own.drive if own.profile == chosen else profile(chosen)
            made: Node | Station = Node(name, own, described, self.network, self.wait)
        else:
            other = device(chosen) if chosen in DEVICES else UNKNOWN
            made = Station(name, ModuleKeys.model_construct(node=number), other, self.network, self.wait)
        self.clients[number] = made.sdo
        return made

    def drive(self, word: str, named: str = "") -> Node:
        """A node that has to be a drive with a profile."""
        node = self.node(word, named)
        if not isinstance(node, Node):
            raise SimulationError(
                f"{node.name}: no profile fits it. Name the one that is like it with --profile: {', '.join(DRIVE_PROFILES)}."
            )
        return node


def node_number(word: str, keys: Mapping[str, NodeKeys | ModuleKeys]) -> tuple[int, str]:
    """Node-ID and name of a node, given its ID or its name in the hardware file."""
    if word.isdecimal() and 1 <= int(word) <= 127:
        return int(word), next((name for name, key in keys.items() if key.node == int(word)), f"node {word}")
    if word not in keys:
        advice = f" {nearest(word, list(keys))}" if keys else " Name it with --hardware FILE."
        raise SimulationError(f"{word}: neither a node-ID from 1 to 127 nor a node of the hardware file.{advice}")
    return keys[word].node, word


def identity_text(node: Station) -> str:
    """Node-ID, name, profile and serial number (1018h.4) of a node, in one line."""
    name = "" if node.name == f"node {node.number}" else f" ({node.name})"
    return f"node {node.number}{name}: {node.profile.title}, serial {restoration.identity_of(node).serial:X}h"


def assert_not_driven(node: Station) -> None:
    """Raise SimulationError for a drive that is enabled by another program."""
    if isinstance(node, Node) and (state := state_of(node.sdo.number(0x6041) & 0xFFFF)) in MOVING:
        raise SimulationError(
            f"{node.name}: is in {state}: somebody drives it. End that program, or `twin hil disable {node.number}`."
        )


def pending_error(node: Node) -> str:
    """Problem text if a drive still reports a communication error without Fault (an earlier missing heartbeat), else empty."""
    if not (register := node.sdo.number(0x1001)) & COMMUNICATION:
        return ""
    texts = read_faults(node.sdo, node.profile.faults)
    return f"{node.name}: reports an earlier error (1001h is {register:02X}h){f': {texts[0]}' if texts else '.'}"
