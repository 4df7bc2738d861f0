"""Touch probes of CiA 402, 60B8h to 60BDh: the position at an edge of an input, or at an index pulse."""

from __future__ import annotations

from math import floor
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hw_bridge.device.axis import Axis

FUNCTION, STATUS = 0x60B8, 0x60B9
POSITIONS = ((0x60BA, 0x60BB), (0x60BC, 0x60BD))  # of the positive and the negative edge, by probe
ENABLE, CONTINUOUS = 0x01, 0x02  # bits of 60B8h; those of the second probe are 8 places higher
SOURCE, INPUT, INDEX = 0x0C, 0x00, 0x04
EDGES = (0x10, 0x20)  # positive, negative
ENABLED, STORED = 0x01, (0x02, 0x04)  # bits of 60B9h


class TouchProbes:
    """Both probes of an axis. The position of an edge is exact if the position crosses one edge in a control cycle."""

    def __init__(self, axis: Axis) -> None:
        self.axis = axis
        self.start()

    def start(self) -> None:
        """Initialize as after power-on."""
        self.last = self.axis.motor.measured_position
        self.stored = [0, 0]  # bits of 60B9h, by probe

    def cycle(self) -> None:
        """Store the positions of edges since the last control cycle, and compose 60B9h."""
        axis, dictionary = self.axis, self.axis.dictionary
        if not dictionary.get(FUNCTION) and not dictionary.get(STATUS):
            self.last = axis.motor.measured_position
            return
        before, self.last = self.last, axis.motor.measured_position
        status = 0
        for probe, positions in enumerate(POSITIONS):
            function = dictionary.get(FUNCTION) >> 8 * probe
            if not function & ENABLE:
                self.stored[probe] = 0
                continue
            for is_negative, position in self._edges(probe, function & SOURCE, before, self.last):
                is_taken = function & CONTINUOUS or not self.stored[probe] & STORED[is_negative]
                if function & EDGES[is_negative] and is_taken:
                    self.stored[probe] |= STORED[is_negative]
                    index = positions[is_negative]
                    value = (position - axis.origin) / axis.units.position
                    dictionary.put(index, dictionary.entry(index).type.saturated(value))
            status |= (ENABLED | self.stored[probe]) << 8 * probe
        dictionary.put(STATUS, status)

    def _edges(self, probe: int, source: int, before: float, now: float) -> Iterator[tuple[bool, float]]:
        """Edges on the way between two measured positions: whether it is a negative one, and where."""
        if source == INDEX:
            pitch = self.axis.motor.model.index
            pulse = floor(max(before, now) / pitch) * pitch
            if pulse > min(before, now):
                yield False, pulse
                yield True, pulse
        elif source == INPUT and (closed := self.axis.switches.probes[probe]) is not None:
            low, high = closed
            was, is_closed = low <= before <= high, low <= now <= high
            if was is not is_closed:
                yield was, low if min(before, now) < low else high
