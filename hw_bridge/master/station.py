"""State of any node on the master's side: known values, time of the last frames, process data statistics."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, NamedTuple

from hw_bridge.dictionary import Dictionary, NmtState, cia301
from hw_bridge.journal import Journal
from hw_bridge.master.age import ValueAge
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


class EmergencyMessage(NamedTuple):
    """An EMCY message. `register`: 1001h, `vendor`: the five bytes after it, as they came."""

    time: int  # [ns]
    code: int
    register: int = 0
    vendor: bytes = b""


NMT_STATES = {int(state): state for state in NmtState}


class Station:
    """A node with its services: SDO, heartbeat, EMCY, and process data expected once per cycle."""

    keys: NodeKeys | ModuleKeys
    profile: Profile | Device

    def __init__(
        self, name: str, keys: NodeKeys | ModuleKeys, profile: Profile | Device, network: Network, wait: Waiting
    ) -> None:
        self.name, self.keys, self.profile = name, keys, profile
        self.number = keys.node
        self.mirror = Dictionary(profile.objects, keys.node)  # known values of the node
        self.sizes: dict[tuple[int, int], int] = {}  # bytes of its numbers as the node has them, not as the profile
        self.journal = Journal()  # of its objects that were written
        self.unrestored: dict[tuple[int, int], bytes] = {}  # for a check: values before a killed run, by its journal
        self.consumer_entry = 1  # subindex of 1016h with this program's heartbeat
        self.sdo = SdoClient(keys.node, network.send, wait)
        self.in_simulated_time = not network.wall_clock
        self.last_heartbeat_at = 0  # last heartbeat [ns]
        self.alive = False  # whether it sent anything besides SDO responses
        self.emergencies: list[EmergencyMessage] = []
        self.boots, self.booted_at = 0, 0  # number of boot-up messages, and time of the last [ns]
        self.started = False  # whether it was commanded Operational, with this program's mapping
        self.nmt_state: NmtState | None = None  # of its last heartbeat
        self.answered, self.answered_at = 0, 0  # process data since the last SYNC, and when the last came [ns]
        self.ages: dict[int, ValueAge] = {}  # of each PDO with actual values, by its identifier without the node-ID
        self.age = self.oldest = 0  # of the actual values when the last cycle began, and the largest of the run [ns]
        self.missing = self.late = self.silent = 0  # of process data: cycles without, too late, the same in a row

    def process_frame(self, frame: Frame, now: int) -> None:
        """Process a frame of this node."""
        base = frame.id - self.number
        self.alive |= base not in (0x580, cia301.SDO_REQUEST)
        if base == 0x580:
            self.sdo.process_frame(frame.data)
        elif base == cia301.SDO_REQUEST:
            self.sdo.process_foreign_request(frame.data)
        elif base == 0x80 and len(frame.data) >= 2:
            code, register = struct.unpack_from("<HB", frame.data.ljust(3, b"\0"))
            self.emergencies.append(EmergencyMessage(now, code, register, frame.data[3:]))
        elif base == 0x700 and frame.data:
            self.last_heartbeat_at = now
            if frame.data[0] == 0:
                self.boots, self.booted_at = self.boots + 1, now
            self.nmt_state = NMT_STATES.get(frame.data[0] & 0x7F)

    def synced(self, time: int) -> None:
        """Record a SYNC [ns]: actual values are sampled."""
        for age in self.ages.values():
            age.synced(time)

    def update_age(self, now: int) -> None:
        """Update the age of the actual values from which the targets of a cycle at `now` [ns] follow."""
        self.age = max((now - age.sampled_at for age in self.ages.values()), default=0)
        self.oldest = max(self.oldest, self.age)

    @property
    def sample_lag(self) -> int:
        """Time from the sampling of the actual values to the last SYNC [ns]; lateness of this program is not included."""
        return max((age.last - age.sampled_at for age in self.ages.values()), default=0)

    @property
    def in_doubt(self) -> bool:
        """Whether the SYNC that its process data answer is ambiguous."""
        return any(age.in_doubt for age in self.ages.values())

    def count_answers(self) -> None:
        """Before a SYNC: count whether the last one was answered."""
        self.missing += self.answered == 0
        self.late += max(self.answered - 1, 0)
        self.silent = self.silent + 1 if self.answered == 0 else 0
        self.answered = 0

    def forget(self) -> None:
        """Reset statistics at the start of a run; a restart since its set-up stays known, its PDO mapping is lost."""
        self.missing = self.late = self.silent = 0
        self.nmt_state, self.oldest = None, 0
        for age in self.ages.values():
            age.forget()
        self.emergencies.clear()

    @property
    def doubled(self) -> str:
        """Problem text if a second node has this ID, else empty: it answered too, or booted while this one continued."""
        if self.sdo.doubled or (self.boots and self.answered_at > self.booted_at):
            return f"{self.name}: two nodes have node-ID {self.number}. Take one off the bus, and give it another: twin hil lss."
        return ""

    @property
    def lost(self) -> int:
        """Number of process data that never arrived."""
        return max(self.missing - self.late, 0)
