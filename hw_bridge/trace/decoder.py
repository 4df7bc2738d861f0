"""Decoder of frames in the order of the bus."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

from hw_bridge.dictionary import cia301, state_of
from hw_bridge.profiles import profile, profile_for
from hw_bridge.trace import names
from hw_bridge.trace.traced_node import Route, TracedNode
from hw_bridge.trace.transfer import Transfer

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from hw_bridge.bus import Frame
    from hw_bridge.dictionary import Entry
    from hw_bridge.hardware import HardwareKeys

IDENTITY = ((0x1018, 1), (0x1018, 2))


@dataclass(frozen=True, slots=True)
class DecodedFrame:
    """One decoded frame. `node` 0: of no single node. `notable`: more than cyclic traffic."""

    time: int  # [ns]
    frame: Frame | None  # none: an error frame, or nothing that CANopen uses
    node: int
    service: str
    text: str
    values: dict[str, float | str] = field(default_factory=dict)
    notable: bool = False


class Decoder:
    """Stateful decoder of a bus. Nodes of `parties` are known; others are identified once their identity object is read.

    `brief` omits values of process data that change no state.
    """

    def __init__(self, parties: Iterable[TracedNode] = (), brief: bool = False) -> None:
        self.brief = brief
        self.parties = {party.node: party for party in parties}
        self.transfers: dict[int, Transfer] = {}
        self.words: dict[int, int] = {}  # the last statusword of each node
        self.resetting: dict[int, bool] = {}  # nodes that were told to begin anew: also the application?

    @classmethod
    def of_bench(
        cls, keys: HardwareKeys, brief: bool = False, objects: Mapping[int, tuple[Entry, ...]] = MappingProxyType({})
    ) -> Decoder:
        """Create a decoder for the drives and modules of a hardware file. `objects`: of EDS files, by node-ID."""
        made = [
            TracedNode(node.node, node.drive, node, name, objects.get(node.node, ()))
            for name, node in keys.nodes.items()
        ]
        modules = (
            TracedNode(module.node, name=name, objects=objects.get(module.node, ()))
            for name, module in keys.modules.items()
        )
        return cls([*made, *modules], brief)

    def party(self, node: int) -> TracedNode:
        """The node with this ID."""
        if node not in self.parties:
            self.parties[node] = TracedNode(node)
        return self.parties[node]

    def error(self, time: int, text: str = "error frame") -> DecodedFrame:
        """Line for something on the bus that is no frame of CANopen."""
        return DecodedFrame(time, None, 0, "ERROR" if text == "error frame" else "OTHER", text, {}, notable=True)

    def decode(self, time: int, frame: Frame) -> DecodedFrame:
        """Decode the next frame."""
        identifier, data = frame.id, frame.data
        node = identifier & 0x7F
        if identifier == 0:
            return self._command(time, frame)
        if identifier == cia301.SYNC:
            return DecodedFrame(time, frame, 0, "SYNC", f"counter {data[0]}" if data else "")
        if identifier == cia301.TIME:
            return DecodedFrame(time, frame, 0, "TIME", "time stamp")
        for party in self.parties.values():
            if (route := party.routes.get(identifier)) is not None:
                return self._process(time, frame, party, route)
        if cia301.EMCY < identifier < cia301.EMCY + 0x80:
            return self._emergency(time, frame, self.party(node))
        if cia301.SDO_RESPONSE < identifier < cia301.SDO_RESPONSE + 0x80:
            return self._answer(time, frame, node)
        if cia301.SDO_REQUEST < identifier < cia301.SDO_REQUEST + 0x80:
            return DecodedFrame(
                time, frame, node, "SDO", f"{self.party(node).name}: {self._transfer(node).request(data)}"
            )
        if cia301.ERROR_CONTROL < identifier < cia301.ERROR_CONTROL + 0x80:
            return self._alive(time, frame, self.party(node))
        if 0x180 <= identifier < cia301.SDO_RESPONSE and node:
            title = f"TPDO{identifier - 0x80 >> 8}" if identifier & 0x80 else f"RPDO{identifier - 0x100 >> 8}"
            return DecodedFrame(time, frame, node, "PDO", f"{self.party(node).name} {title}: mapping not in the trace")
        return DecodedFrame(time, frame, 0, "OTHER", "no identifier of CANopen's predefined connection set")

    def _transfer(self, node: int) -> Transfer:
        return self.transfers.setdefault(node, Transfer(self.party(node)))

    def _command(self, time: int, frame: Frame) -> DecodedFrame:
        if len(frame.data) != 2:
            return DecodedFrame(
                time, frame, 0, "NMT", f"command of {len(frame.data)} bytes, 2 expected", {}, notable=True
            )
        command, node = frame.data
        named = names.COMMANDS.get(command, f"unknown command {command:02X}h")
        if command in (cia301.RESET_NODE, cia301.RESET_COMMUNICATION):
            for reset_node in [node] if node else list(self.parties):
                self.resetting[reset_node] = command == cia301.RESET_NODE
        receiver = self.party(node).name if node else "all nodes"
        return DecodedFrame(time, frame, node, "NMT", f"{receiver}: {named}", {}, notable=True)

    def _emergency(self, time: int, frame: Frame, party: TracedNode) -> DecodedFrame:
        if len(frame.data) != 8:
            text = f"{party.name}: {len(frame.data)} bytes, 8 expected"
            return DecodedFrame(time, frame, party.node, "EMCY", text, {}, notable=True)
        code, register = struct.unpack_from("<HB", frame.data)
        fault = party.profile.faults.get(code) if party.profile is not None else None
        meaning = fault.meaning if fault is not None else f"{names.emergency(code)} (class of CiA 301)"
        text = f"{party.name}: {code:04X}h {'no error' if not code else meaning}; register {cia301.error_register(register)}"
        if any(frame.data[3:]):
            text += f"; vendor {frame.data[3:].hex(' ').upper()}"
        return DecodedFrame(time, frame, party.node, "EMCY", text, {"code": code, "register": register}, notable=True)

    def _alive(self, time: int, frame: Frame, party: TracedNode) -> DecodedFrame:
        if frame.remote or not frame.data:
            return DecodedFrame(time, frame, party.node, "GUARD", f"{party.name}: state requested")
        state = frame.data[0] & 0x7F
        if frame.data[0] == 0:
            party.reset(self.resetting.pop(party.node, True))
        text = f"{party.name}: {names.nmt_state(state)}"
        return DecodedFrame(time, frame, party.node, "HEARTBEAT", text, {"state": state}, notable=frame.data[0] == 0)

    def _answer(self, time: int, frame: Frame, node: int) -> DecodedFrame:
        party = self.party(node)
        text = self._transfer(node).response(frame.data)
        self._recognize(party)
        return DecodedFrame(time, frame, node, "SDO", f"{party.name}: {text}", {}, notable=Transfer.aborts(frame.data))

    @staticmethod
    def _recognize(party: TracedNode) -> None:
        """Adopt the profile of a node whose identity was read."""
        if party.profile is not None or not party.learned.issuperset(IDENTITY):
            return
        identity = tuple(party.dictionary.get(*address) for address in IDENTITY)
        if name := profile_for(*identity):
            party.adopt(profile(name))

    def _process(self, time: int, frame: Frame, party: TracedNode, route: Route) -> DecodedFrame:
        title = f"{party.name} {route.title}: "
        if frame.remote:
            return DecodedFrame(time, frame, party.node, "PDO", f"{title}requested")
        if len(frame.data) != route.size:
            text = f"{title}{len(frame.data)} bytes, the mapping has {route.size}"
            return DecodedFrame(time, frame, party.node, "PDO", text, {}, notable=True)
        changed = False
        if (word := route.statusword(frame.data)) is not None:
            before = self.words.get(party.node)
            changed = before is not None and state_of(before) is not state_of(word)
            self.words[party.node] = word
        if self.brief and not changed:
            return DecodedFrame(time, frame, party.node, "PDO", title)
        offset, parts, values = 0, [], {}
        for entry, bits in route.mapped:
            decoded = party.decode_value(entry, frame.data[offset : offset + bits // 8])
            offset += bits // 8
            parts.append(decoded.text)
            values[decoded.name] = decoded.value
        return DecodedFrame(time, frame, party.node, "PDO", title + "; ".join(parts), values, notable=changed)
