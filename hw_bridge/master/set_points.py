"""Targets of profile position (pp): each is a set-point that the drive acknowledges before the next one is given."""

from __future__ import annotations

from hw_bridge.dictionary import cia402


class SetPoints:
    """The handshake of CiA 402: bit 4 of the controlword rises with a new target, bit 12 of the statusword acknowledges it.

    `raised`: whether bit 4 stands. `unacknowledged`: cycles in a row without an acknowledge.
    """

    def __init__(self) -> None:
        self.raised = False
        self.unacknowledged = 0

    def reset(self) -> None:
        """No set-point is under way: the drive is in another mode, or not enabled."""
        self.raised, self.unacknowledged = False, 0

    def control_bits(self, statusword: int) -> int:
        """Bits of the controlword in this cycle: bit 4 rises, or stands, as long as bit 12 is low."""
        self.raised = not statusword & cia402.BIT_12
        self.unacknowledged += 1
        return cia402.CHANGE_IMMEDIATELY | (cia402.NEW_SET_POINT if self.raised else 0)

    def acknowledge(self, statusword: int) -> bool:
        """Whether this statusword acknowledges the set-point, so that bit 4 has to fall."""
        if not (self.raised and statusword & cia402.BIT_12):
            return False
        self.reset()
        return True
