"""The one way to a standstill: quick stop, then disabled, then safe. What fails for one drive is no end for the others."""

from __future__ import annotations

import struct
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

from hw_bridge.bus import MILLISECOND, Frame
from hw_bridge.dictionary import Command, NmtState, State, cia301, cia402
from hw_bridge.master import setup
from hw_bridge.master.node import AT_REST
from hw_bridge.master.reference import Reference
from hw_bridge.master.sdo import ATTEMPTS, TIMEOUT, SdoError
from twin.errors import SimulationError, TwinError

if TYPE_CHECKING:
    from collections.abc import Callable

    from hw_bridge.master.master import Master
    from hw_bridge.master.module import ModuleNode
    from hw_bridge.master.node import Node

STANDSTILL = 2_000 * MILLISECOND  # longest time of a quick stop of a drive that confirms it
BOOT = 500 * MILLISECOND  # longest time that a drive takes to answer after a reset
BRAKING = 100 * MILLISECOND  # after its heartbeat time, for a drive that confirms nothing: reaction and ramp of its own
SDO_TIMEOUT = 30 * MILLISECOND  # of one request to a drive whose process data stays away
SILENT_CYCLES = 5  # so many cycles without process data are the end of a drive
SENSOR_ERRORS = range(0x7300, 0x7400)  # EMCY codes of CiA 402: the sensors
TRIES = 3  # of a frame that the interface does not take: its queue may be full for a moment
GONE = 5  # so many cycles in a row that could not be sent are the end of the interface
ALONE = "The drives stop by themselves when this program's heartbeat is missing."
REACTED = (*AT_REST, State.QUICK_STOP, State.REACTION)  # states in which a drive brakes, or has no current


class Stop:
    """Of all drives and modules of a master. Never raises what the bus met: that goes to the master's notes, once.

    A node in NMT Stopped takes neither PDO nor SDO, so that an NMT command comes first. A drive that does not confirm the
    quick stop within its `lost_after` gets no heartbeat any more: then its own watch (1016h, 6007h) stops it.
    """

    def __init__(self, master: Master) -> None:
        self.master, self.network = master, master.network
        self.failed = 0  # cycles in a row
        self.told = False
        self.began = master.network.now
        self.silenced = False  # whether the heartbeat has ended

    def carry_out(self) -> None:
        """Every step is tried for each drive, whatever became of the others."""
        master = self.master
        for node in master.nodes.values():
            node.homing = False
        for station in master.stations.values():
            self._enable_communication(station)
        for node in master.nodes.values():
            self._order(node, State.QUICK_STOP)
        self._cycle_until_standstill()
        for node in master.nodes.values():
            if node.goal is not State.DISABLED:
                self._order(node, State.DISABLED)
        for module in master.modules.values():  # not before the drives stand
            module.resting = True
        if not self.told or self.attempt(master.run_cycle):  # else nobody could answer
            for node in master.nodes.values():
                self._release(node)
            for module in master.modules.values():
                if module.silent:
                    module.sdo.attempts, module.sdo.timeout = 1, SDO_TIMEOUT
                master.notes += filter(None, [module.release()])
        for station in master.stations.values():
            self.attempt(partial(master.nmt, cia301.PRE_OPERATIONAL, station.number))
        self.attempt(partial(master.wait, master.cycle))
        for node in master.nodes.values():
            self._save_reference(node)
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

    def _enable_communication(self, station: Node | ModuleNode) -> None:
        """Let a node take PDOs and SDOs. One that has started anew has its own PDO mapping: SDOs alone."""
        command = cia301.START if self.master.has_mapping(station) else cia301.PRE_OPERATIONAL
        self.attempt(partial(self.master.nmt, command, station.number))

    def _order(self, node: Node, goal: State) -> None:
        """A goal for a drive, at once and by SDO too: process data may wait for a SYNC that does not come."""
        node.goal = goal
        self._command(node)

    def _command(self, node: Node) -> None:
        """The controlword of a node's goal by SDO, without waiting for the answer."""
        word = 0 if node.goal is State.DISABLED else cia402.TYPICAL[Command.QUICK_STOP]
        self._download(node, 0x6040, 0, struct.pack("<H", word))

    def _download(self, node: Node, index: int, sub: int, data: bytes) -> None:
        node.sdo.prompt = False  # its answer may be taken for one to a later request
        head = 0x23 | (4 - len(data)) << 2
        frame = Frame(cia301.SDO_REQUEST + node.number, struct.pack("<BHB", head, index, sub) + data.ljust(4, b"\0"))
        self.attempt(partial(self.network.send, frame))

    def _stands(self, node: Node) -> bool:
        """Slow enough; or without current and no speed was told for long: another program may stop its answers."""
        unknown = node.state in AT_REST and self.network.now - max(self.began, node.velocity_at) > BRAKING
        return unknown or abs(node.velocity) < 0.01 * node.keys.limits.velocity

    def _confirmed(self, node: Node) -> bool:
        """Whether it has told since the stop began that it brakes or has no current."""
        return node.word_at > self.began and node.state in REACTED

    def _given_up(self, node: Node) -> bool:
        """Whether it told nothing for as long as it may take to stop by itself, or to boot after another master's reset."""
        patience = 2 * node.keys.heartbeat.lost_after + BRAKING
        if self.master.rival.act:
            patience = max(patience, BOOT)
        return self.network.now - max(self.began, node.word_at) > patience

    def _cycle_until_standstill(self) -> None:
        """Cycles until every drive that answers has no current, each as soon as it stands; or too long."""
        master, network = self.master, self.network
        end = network.now + STANDSTILL
        while (
            network.now < end
            and self.failed < GONE
            and not all(self._at_rest(node) or self._given_up(node) for node in master.nodes.values())
        ):
            self.failed = 0 if self.attempt(master.run_cycle) else self.failed + 1
            for station in master.stations.values():
                if station.nmt_state is NmtState.STOPPED:
                    station.nmt_state = None  # until its next heartbeat
                    self._enable_communication(station)
            for node in master.nodes.values():
                if node.nmt_state is None:
                    self._command(node)
                if node.silent:
                    self._ask(node)
                if node.goal is State.QUICK_STOP and self._confirmed(node) and self._stands(node):
                    self._order(node, State.DISABLED)
            self._end_heartbeat()

    def _at_rest(self, node: Node) -> bool:
        return node.goal is State.DISABLED and self._confirmed(node) and node.state in AT_REST

    def _ask(self, node: Node) -> None:
        """State and speed by SDO, of a drive whose process data stays away; the order again while it does not act."""
        node.sdo.attempts, node.sdo.timeout = 1, SDO_TIMEOUT
        with suppress(SimulationError):
            node.word = setup.read(node, 0x6041)
            node.word_at = self.network.now
            node.raw_velocity = setup.read(node, 0x606C)
            node.velocity_at = self.network.now
        if node.state is State.ENABLED:
            self._command(node)

    def _end_heartbeat(self) -> None:
        """No heartbeat any more, once a drive did not confirm in time; those that have no current do not wait for it."""
        late = [
            node
            for node in self.master.nodes.values()
            if not self._confirmed(node) and self.network.now - self.began > node.keys.heartbeat.lost_after
        ]
        if self.silenced or not late:
            return
        self.silenced = True
        for node in self.master.nodes.values():
            if self._confirmed(node) and node.state in AT_REST:
                self._download(node, 0x1016, 1, bytes(4))
        self.master.end_heartbeat()
        names = ", ".join(node.name for node in late)
        self.master.notes.append(
            f"{names}: did not confirm the quick stop: this program sends no heartbeat any more, so that it stops by itself."
        )

    def _tell_limit_switches(self, node: Node) -> None:
        """A drive that brakes at a limit switch tells no error: what ends the run then is that it does not follow."""
        if cia402.INPUTS in node.mirror:
            with suppress(SdoError):
                if closed := cia402.closed_limit_switches(node.sdo.number(cia402.INPUTS)):
                    self.master.closed_switches.append(f"{node.name}: its {closed} is closed (60FDh).")

    def _save_reference(self, node: Node) -> None:
        """Let the next run count from the same reference; not where the count may be lost, or the drive did not confirm."""
        is_lost = node.boots or any(emergency.code in SENSOR_ERRORS for emergency in node.emergencies)
        if not node.has_reference or is_lost or not self._at_rest(node) or self.master.rival.has_reset(node.number):
            node.has_reference = False
            return
        try:
            Reference(self.master.keys, node.name, node.rotary).save(node)
        except (OSError, TwinError) as error:
            node.has_reference = False
            self.master.notes.append(f"{node.name}: its reference is not recorded ({error}): it is homed again.")

    def _release(self, node: Node) -> None:
        """Disabled, with safe outputs and no heartbeat expected; told where it does not confirm that."""
        state, why = node.state, ""
        node.sdo.attempts, node.sdo.timeout = ATTEMPTS, TIMEOUT
        if self._given_up(node):
            node.sdo.attempts, node.sdo.timeout = 1, SDO_TIMEOUT
        elif self.master.rival.act:  # it may be stopped again at any time
            node.sdo.timeout = TIMEOUT // 3
        try:
            setup.make_safe(node)
            state = setup.release(node)
            if state in (State.FAULT, State.REACTION):
                self.master.said.append(setup.faults(node))
            self._tell_limit_switches(node)
        except SimulationError as error:
            why = f" {error}"
        if why or state not in AT_REST:
            self.master.notes.append(
                f"{node.name}: did not confirm that it is disabled (last state: {state}).{why} "
                f"Check it before you touch it."
            )
