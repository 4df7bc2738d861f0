"""The one way to a standstill: quick stop, then disabled, then safe. What fails for one drive is no end for the others."""

from __future__ import annotations

import struct
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND, Frame
from hw_bridge.dictionary import Command, State, cia301, cia402
from hw_bridge.master import setup
from hw_bridge.master.node import AT_REST
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.master.master import Master
    from hw_bridge.master.node import Node

STANDSTILL = 2_000 * MILLISECOND  # longest time of a quick stop
SILENT_CYCLES = 5  # so many cycles without process data are the end of a drive
TRIES = 3  # of a frame that the interface does not take: its queue may be full for a moment
GONE = 5  # so many cycles in a row that could not be sent are the end of the interface
ALONE = "The drives stop by themselves when this program's heartbeat is missing."


class Stop:
    """Of all drives and modules of a master. Never raises what the bus met: that goes to the master's notes, once."""

    def __init__(self, master: Master) -> None:
        self.master, self.network = master, master.network
        self.failed = 0  # cycles in a row
        self.told = False

    def carry_out(self) -> None:
        """Every step is tried for each drive, whatever became of the others."""
        master = self.master
        for node in master.nodes.values():
            node.homing = False
            if node.silent >= SILENT_CYCLES:  # perhaps it is Stopped, where it takes no SDO either
                self.attempt(partial(master.nmt, cia301.PRE_OPERATIONAL, node.number))
        self._order(State.QUICK_STOP)
        self._cycles_until(lambda node: node.state in (*AT_REST, State.QUICK_STOP) and self._stands(node))
        self._order(State.DISABLED)
        for module in master.modules.values():  # not before the drives stand
            module.resting = True
        self._cycles_until(lambda node: node.state in AT_REST)
        if not self.told or self.attempt(master.run_cycle):  # else nobody could answer
            for node in master.nodes.values():
                self._release(node)
            master.notes += [text for module in master.modules.values() if (text := module.release())]
        self.attempt(partial(master.nmt, cia301.PRE_OPERATIONAL))
        self.attempt(partial(master.wait, master.cycle))
        if master.rival.act:
            master.notes.append(f"{master.rival.text} It can enable the drives again.")

    def attempt(self, action: Callable[[], None]) -> bool:
        """Try it some times; whether it was taken. The reason is told once."""
        note = ""
        for _ in range(TRIES):
            try:
                action()
            except SimulationError as error:
                note = f"stop: {error} {ALONE}"
                with suppress(SimulationError):  # time passes, and the interface can empty its queue
                    self.network.advance(self.network.now + MILLISECOND)
            else:
                return True
        if not self.told:  # the first failure is the cause, the others follow from it
            self.told = True
            self.master.notes.append(note)
        return False

    def _order(self, goal: State) -> None:
        """A goal for all nodes, at once and by SDO too: process data may wait for a SYNC that does not come."""
        word = 0 if goal is State.DISABLED else cia402.TYPICAL[Command.QUICK_STOP]
        for node in self.master.nodes.values():
            node.goal = goal
            frame = Frame(cia301.SDO_REQUEST + node.number, struct.pack("<BHBHxx", 0x2B, 0x6040, 0, word))
            self.attempt(partial(self.network.send, frame))

    def _stands(self, node: Node) -> bool:
        return abs(node.velocity) < 0.01 * node.keys.limits.velocity

    def _cycles_until(self, done: Callable[[Node], bool]) -> None:
        """Cycles until it holds for every node that still lives, or too long, or there is nobody to tell it."""
        master, network = self.master, self.network
        end = network.now + STANDSTILL
        while (
            network.now < end
            and self.failed < GONE
            and not all(done(node) or master.lost(node) for node in master.nodes.values())
        ):
            self.failed = 0 if self.attempt(master.run_cycle) else self.failed + 1
            for node in master.nodes.values():
                if node.silent >= SILENT_CYCLES and not master.lost(node):
                    self._ask(node)

    def _ask(self, node: Node) -> None:
        """State and speed by SDO, of a drive whose process data stays away."""
        with suppress(SimulationError):
            node.word = setup.read(node, 0x6041)
            node.raw_velocity = setup.read(node, 0x606C)

    def _release(self, node: Node) -> None:
        """Disabled, with safe outputs and no heartbeat expected; told where it does not confirm that."""
        state, why = node.state, ""
        try:
            setup.make_safe(node)
            state = setup.release(node)
            if state in (State.FAULT, State.REACTION):
                self.master.said.append(setup.faults(node))
        except SimulationError as error:
            why = f" {error}"
        if why or state not in AT_REST:
            self.master.notes.append(
                f"{node.name}: did not confirm that it is disabled (last state: {state}).{why} "
                f"Check it before you touch it."
            )
