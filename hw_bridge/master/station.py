"""What a master knows of any node: what it holds, when it was heard, what it told."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from hw_bridge.dictionary import Dictionary
from hw_bridge.journal import Journal
from hw_bridge.master.sdo import SdoClient

if TYPE_CHECKING:
    from typing import Protocol

    from hw_bridge.bus import Condition, Frame, Network
    from hw_bridge.hardware import ModuleKeys, NodeKeys
    from hw_bridge.profiles import Device, Profile

    class Waiting(Protocol):
        """Lets time pass, and frames come, until a condition holds."""

        def __call__(self, duration: int, done: Condition = ...) -> None:
            """Wait at most `duration` [ns]."""


class Station:
    """A node with its services: SDO, heartbeat, EMCY, and process data that should come once in a cycle."""

    keys: NodeKeys | ModuleKeys
    profile: Profile | Device

    def __init__(
        self, name: str, keys: NodeKeys | ModuleKeys, profile: Profile | Device, network: Network, wait: Waiting
    ) -> None:
        self.name, self.keys, self.profile = name, keys, profile
        self.number = keys.node
        self.mirror = Dictionary(profile.objects, keys.node)  # what the node is known to hold
        self.sizes: dict[tuple[int, int], int] = {}  # bytes of its numbers as the node has them, not as the profile
        self.journal = Journal()  # of its objects that were written
        self.sdo = SdoClient(keys.node, network.send, wait)
        self.heard_at = 0  # last heartbeat [ns]
        self.alive = False  # whether it was heard beside answers to SDO
        self.emergencies: list[tuple[int, int]] = []  # time [ns], code
        self.boots = 0  # boot-up messages heard
        self.answered = 0  # process data since the last SYNC
        self.missing = self.late = self.silent = 0  # of process data: cycles without, too late, the same in a row

    def heard(self, frame: Frame, now: int) -> None:
        """A frame of this node arrived."""
        base = frame.id - self.number
        self.alive |= base != 0x580
        if base == 0x580:
            self.sdo.heard(frame.data)
        elif base == 0x80 and len(frame.data) >= 2:
            self.emergencies.append((now, struct.unpack_from("<H", frame.data)[0]))
        elif base == 0x700 and frame.data:
            self.heard_at = now
            self.boots += frame.data[0] == 0

    def account(self) -> None:
        """Before a SYNC: whether the last one was answered."""
        self.missing += self.answered == 0
        self.late += max(self.answered - 1, 0)
        self.silent = self.silent + 1 if self.answered == 0 else 0
        self.answered = 0

    def forget(self) -> None:
        """A run begins: what happened before does not count."""
        self.missing = self.late = self.silent = self.boots = 0
        self.emergencies.clear()

    @property
    def lost(self) -> int:
        """Process data that never came."""
        return max(self.missing - self.late, 0)
