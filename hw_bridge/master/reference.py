"""Whether a drive's homing reference is still valid: by its own status bit, and by a record on disk.

The record holds which drive was homed how, and 6064h when the drive was released. Few drives report whether they were
switched off since. For the others the reference is valid only while 6064h is unchanged and not 0, as it is after power-on:
an axis that was pushed in between is homed again.
"""

from __future__ import annotations

import json
import re
from math import copysign
from typing import TYPE_CHECKING, Any

from hw_bridge.journal import state_folder
from twin.files import write_atomically

if TYPE_CHECKING:
    from hw_bridge.hardware import HardwareKeys, NodeKeys
    from hw_bridge.master.node import Node

CLEARANCE, TURNED = 1e-3, 0.1  # so far from its reference a drive is left that was homed [m], [rad]
NEAR = 0.25  # of it, within which two positions are one


class Reference:
    """The record of one drive of a hardware file."""

    def __init__(self, keys: HardwareKeys, name: str, rotary: bool = False) -> None:
        self.keys, self.name, self.own = keys, name, keys.nodes[name]
        self.clearance = TURNED if rotary else CLEARANCE
        bus = f"{keys.interface}_{keys.channel}_{keys.options.get('port', '')}" if keys.is_software() else "real"
        self.path = state_folder() / "references" / f"{re.sub(r'[^A-Za-z0-9.-]+', '_', bus)}-node{self.own.node}.json"

    def resting_position(self) -> float:
        """Position after homing [m or rad]: within the limits, and away from the drive's zero."""
        assert self.own.homing is not None
        low, high = self.own.limits.position
        at = min(max(self.own.homing.at, low), high)
        if abs(at - self.own.homing.at) >= self.clearance:
            return at
        return min(max(at + copysign(self.clearance, 0.5 * (low + high) - at), low), high)

    def save(self, node: Node) -> None:
        """Record the reference of a drive that was homed or moved with it, and stands now."""
        if not self.keys.simulated:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            content = {"identity": node.identity, "homing": homing_of(self.own), "position": node.raw_position}
            write_atomically(self.path, json.dumps(content).encode())

    def forget(self) -> None:
        """Delete the record before homing or motion; the outcome is not known yet."""
        if not self.keys.simulated:
            self.path.unlink(missing_ok=True)

    @property
    def is_recorded(self) -> bool:
        """Whether a reference is recorded; `problem` tells whether it is still valid."""
        return not self.keys.simulated and self.path.is_file()

    def position(self, node: Node) -> float:
        """Position of a drive whose reference is valid, else from where 6064h is 0 [m or rad]. Only reads."""
        raw = int.from_bytes(node.sdo.read(0x6064), "little", signed=True)
        at = self.own.homing.at if self.own.homing is not None and not self.problem(node) else 0.0
        return node.sign * raw * node.units.position + at

    def problem(self, node: Node) -> str:
        """Return why the reference is not valid, or an empty string."""
        if self.own.homing is None:
            return "the hardware file has no `homing`."
        if self.keys.simulated:
            return "a simulated drive is switched on anew with each command."
        bit = node.profile.reference_bit
        if bit is not None and not node.sdo.number(0x6041) >> bit & 1:
            return f"the drive has no reference (6041h, bit {bit}): it was not homed since it was switched on."
        try:
            record: dict[str, Any] = json.loads(self.path.read_text())
            same = record["identity"] == identity_of(node), record["homing"] == homing_of(self.own)
            before = int(record["position"])
        except (OSError, ValueError, KeyError, TypeError):
            return "this program has not homed it, or a run was broken off since."
        if not same[0]:
            return "another drive was homed at this node-ID."
        if not same[1]:
            return "it was homed with another `homing`, `scale` or `inverted`."
        if bit is not None:
            return ""
        now = int.from_bytes(node.sdo.read(0x6064), "little", signed=True)
        near = NEAR * self.clearance / (self.own.scale * node.units.position)
        if abs(now - before) > near:
            return f"6064h is {now} and was {before} when it was left: it was switched off, or pushed."
        if abs(now) <= near:
            return f"6064h is {now}, as after power-on: whether it was switched off since is not known."
        return ""


def identity_of(node: Node) -> list[int]:
    """Vendor, product and serial number."""
    return [node.sdo.number(0x1018, sub) for sub in (1, 2, 4)]


def homing_of(keys: NodeKeys) -> dict[str, Any]:
    """The keys of the hardware file on which a reference depends."""
    assert keys.homing is not None
    return {"method": keys.homing.method, "at": keys.homing.at, "scale": keys.scale, "inverted": keys.inverted}
