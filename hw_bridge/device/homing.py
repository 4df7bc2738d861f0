"""Homing mode: executes the moves of a method."""

from __future__ import annotations

from math import ceil, floor

from hw_bridge.device.modes import ModeOfOperation
from hw_bridge.device.trajectory import to_velocity
from hw_bridge.dictionary import REVERSING, HomingEvent, Move, cia402

STILL = 200  # a motor that stands for this time [ms] although it should move is blocked
STANDSTILL = 2e-3  # slower than this share of the homing speed counts as standing


class Homing(ModeOfOperation):
    """hm: bit 4 starts it and keeps it running; bits 10, 12, 13 are its state."""

    def begin(self) -> None:
        """Stand; the position is unchanged."""
        self.running = self.attained = self.failed = False
        self.moves: list[Move] = []
        self._ramp(0.0)

    def control(self, word: int) -> None:
        """Start at the rise of bit 4, stop when it falls or at a halt."""
        rising = word & ~self.word & cia402.NEW_SET_POINT
        super().control(word)
        if rising and not self.halted:
            self.running, self.attained, self.failed = True, False, False
            self.method = self.dictionary.get(0x6098)
            self.moves = list(self.axis.profile.homing[self.method])
            self._next()
        elif self.running and (not word & cia402.NEW_SET_POINT or self.halted):
            self.running = False
            self._ramp(0.0)

    def _ramp(self, speed: float) -> None:
        axis = self.axis
        rate = axis.rate(0x609A)
        present = axis.speed if axis.motor.powered else 0.0
        self.motion = to_velocity(axis.event_queue.now, 0.0, present, speed, rate, rate)

    def _next(self) -> None:
        """Begin the next move whose event has not occurred; after the last one homing is finished."""
        while self.moves and self._fulfilled(self.moves[0]):
            self.moves.pop(0)
        self.axis.windows.pop(HomingEvent.BLOCK, None)
        self.last = self.axis.motor.measured_position
        if not self.moves:
            self._finish(self.last)
            return
        move = self.moves[0]
        speed = self.dictionary.get(0x6099, 2 if move.slow else 1) * self.axis.units.velocity
        self._ramp(move.direction * speed)

    def _fulfilled(self, move: Move) -> bool:
        if move.until > HomingEvent.HOME:
            return False
        return self.axis.switches.closed(self.axis.motor.measured_position)[move.until] is move.closed

    def _finish(self, position: float) -> None:
        offset = self.dictionary.get(0x607C, missing=self.dictionary.get(0x30B0)) * self.axis.units.position
        self.axis.origin, self.axis.referenced = position - offset, True
        self.axis.measure()
        self.running, self.attained = False, True
        self._ramp(0.0)

    def cycle(self) -> None:
        """Advance the motion and check for the end of the move."""
        axis = self.axis
        blocking = bool(self.moves) and self.moves[0].until is HomingEvent.BLOCK
        limit = self.dictionary.get(0x30B2) / 1000.0 if blocking and 0x30B2 in self.dictionary else None
        axis.follow_velocity(self.motion.at(axis.event_queue.now)[1], limit)
        if not self.running:
            return
        move = self.moves[0]
        position = axis.motor.measured_position
        wanted = abs(self.motion.velocity_end)
        still = axis.lasting(HomingEvent.BLOCK, abs(axis.velocity) < STANDSTILL * wanted, STILL)
        if move.until is HomingEvent.INDEX:
            pitch = axis.motor.model.index
            mark = (floor if move.direction > 0 else ceil)(position / pitch) * pitch
            if (self.last - mark) * move.direction < 0.0:
                self.moves.clear()
                self._finish(mark)
                return
        elif self._fulfilled(move) or (still and move.until is HomingEvent.BLOCK):
            if move.until is HomingEvent.BLOCK:  # what the loops gathered against the stop would hold the motor there
                axis.motor.off()
            self.moves.pop(0)
            self._next()
            return
        elif self._turns(move):
            self.moves[0] = move._replace(direction=-move.direction)
            self._next()
            return
        if still or axis.limit_switch(move.direction) not in (None, move.until):
            self.running, self.failed = False, True
            self._ramp(0.0)
        self.last = position

    def _turns(self, move: Move) -> bool:
        """Whether a search for the home switch has met the limit switch ahead."""
        searches = self.method in REVERSING and move.until is HomingEvent.HOME and not move.slow
        return searches and self.axis.limit_switch(move.direction) is not None

    def bits(self) -> int:
        """In progress 0; attained 10 and 12; failed 13; interrupted or not begun 10."""
        standing = cia402.TARGET_REACHED if self.axis.event_queue.now >= self.motion.end and not self.running else 0
        return standing | (cia402.BIT_12 if self.attained else 0) | (cia402.BIT_13 if self.failed else 0)
