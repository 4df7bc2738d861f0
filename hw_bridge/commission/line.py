"""A bus on which a person asks: SDO to any node. No process data, no heartbeat, so that nothing moves by it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND, Frame, never
from hw_bridge.commission.words import told_fault
from hw_bridge.dictionary import NmtState, State, cia301, state_of
from hw_bridge.hardware import ModuleKeys, NodeKeys
from hw_bridge.master import Node, SdoClient, Station
from hw_bridge.profiles import DEVICES, GENERIC, MODULES, Device, Rules, device, profile
from twin.errors import SimulationError, nearest

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hw_bridge.bus import Condition, Network

BOOT = 500 * MILLISECOND  # a drive that is switched on together with the bus answers after that [ns]
COMMUNICATION = 0x10  # bit of the error register 1001h
ALIVE = {int(one) for one in NmtState}  # what a heartbeat may tell
MOVING = (State.ENABLED, State.QUICK_STOP, State.REACTION)
UNKNOWN = Device("unknown", "a device without a profile", (), {}, Rules(0, 0))  # type: ignore[arg-type]


class Line:
    """The bus of a person. `keys`: nodes of a hardware file by name, none without one."""

    def __init__(self, network: Network, keys: Mapping[str, NodeKeys | ModuleKeys] | None = None) -> None:
        self.network, self.keys = network, dict(keys or {})
        self.clients: dict[int, SdoClient] = {}
        self.states: dict[int, NmtState] = {}  # of those that tell that they live
        self.answers: list[tuple[int, bytes]] = []  # to SDO, of any node
        network.hear = lambda _frame: None
        network.observe(self._seen)

    def _seen(self, _time: int, frame: Frame | None) -> None:
        """A frame on the bus."""
        if frame is None or frame.remote or not frame.data:
            return
        number = frame.id & 0x7F
        if frame.id == cia301.SDO_RESPONSE + number:
            self.answers.append((number, frame.data))
            if number in self.clients:
                self.clients[number].process_frame(frame.data)
        elif frame.id == cia301.ERROR_CONTROL + number and frame.data[0] & 0x7F in ALIVE:
            told = NmtState(frame.data[0] & 0x7F)  # after boot-up it is Pre-operational by itself
            self.states[number] = NmtState.PRE_OPERATIONAL if told is NmtState.INITIALIZING else told

    def wait(self, duration: int, done: Condition = never) -> None:
        """Let time pass and hear frames, at most `duration` [ns]."""
        self.network.advance(self.network.now + duration, done)

    def client(self, number: int) -> SdoClient:
        """Who asks a node."""
        return self.clients.setdefault(number, SdoClient(number, self.network.send, self.wait))

    def nmt(self, command: int, number: int) -> None:
        """An NMT command to one node."""
        self.network.send(Frame(cia301.NMT, bytes([command, number])))

    def number(self, word: str) -> tuple[int, str]:
        """Node-ID and name of the node that a person means by its ID or its name in the hardware file."""
        if word.isdecimal() and 1 <= int(word) <= 127:
            return int(word), next((name for name, key in self.keys.items() if key.node == int(word)), f"node {word}")
        if word not in self.keys:
            known = f" {nearest(word, list(self.keys))}" if self.keys else " Name it with --hardware FILE."
            raise SimulationError(f"{word}: neither a node-ID from 1 to 127 nor a node of the hardware file.{known}")
        return self.keys[word].node, word

    def node(self, word: str, named: str = "") -> Node | Station:
        """A node with the objects of its profile: `named`, that of the hardware file, or by what it is (1018h)."""
        from hw_bridge.commission.survey import recognized

        number, name = self.number(word)
        keys = self.keys.get(name)
        chosen = named or (keys.profile if keys is not None else "")
        if not chosen:
            client = self.client(number)
            chosen = recognized(client.number(0x1018, 1), client.number(0x1018, 2), client.number(0x1000))
        if chosen in MODULES or (keys is not None and chosen == keys.profile and chosen in GENERIC):
            own = keys if isinstance(keys, NodeKeys) else NodeKeys.model_validate({"node": number, "profile": chosen})
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
                f"{node.name}: no profile fits it. Name the one that is like it with --profile: {', '.join(MODULES)}."
            )
        return node


def refuse_moving(node: Station) -> None:
    """Nobody changes objects of a drive that somebody drives."""
    if isinstance(node, Node) and (state := state_of(node.sdo.number(0x6041) & 0xFFFF)) in MOVING:
        raise SimulationError(
            f"{node.name}: is in {state}: somebody drives it. End that program, or `twin hil disable {node.number}`."
        )


def unfinished(node: Node) -> str:
    """That a drive still tells an error of communication, though it is in no Fault: a heartbeat lost before; or nothing."""
    if not (register := node.sdo.number(0x1001)) & COMMUNICATION:
        return ""
    told = told_fault(node.sdo, node.profile.faults)
    return f"{node.name}: still tells an error (1001h is {register:02X}h){f': {told[0]}' if told else '.'}"
