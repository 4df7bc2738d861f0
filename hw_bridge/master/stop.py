"""The single stop path: quick stop, then disable, then safe outputs. A failure of one drive does not affect the others."""

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
from hw_bridge.master.sdo import ATTEMPTS, TIMEOUT, SdoError, download_request
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
SENSOR_ERRORS = range(0x7300, 0x7400)  # EMCY codes of CiA 402: the sensors
TRIES = 3  # of a frame that the interface does not take: its queue may be full for a moment
GONE = 5  # so many cycles in a row that could not be sent are the end of the interface
ALONE = "The drives stop by themselves when this program's heartbeat is missing."
REACTED = (*AT_REST, State.QUICK_STOP, State.REACTION)  # states in which a drive brakes, or has no current


class Stop:
    """Stop of all drives and modules of a master. Never raises on bus failures: they go to the master's notes, once.

    A node in NMT Stopped takes neither PDO nor SDO, so that an NMT command comes first. If a drive does not confirm the
    quick stop within its `lost_after`, the heartbeat ends: then its own heartbeat consumer (1016h, 6007h) stops it.
    """

    def __init__(self, master: Master) -> None:
        self.master, self.network = master, master.network
        self.failed = 0  # cycles in a row
        self.is_failure_reported = False
        self.begin_time = master.network.now
        self.silenced = False  # whether the heartbeat has ended

    def carry_out(self) -> None:
        """Try every step for each drive, whatever the result of the others."""
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
        if not self.is_failure_reported or self.attempt(master.run_cycle):  # else nobody could answer
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
        if master.foreign_master.action:
            master.notes.append(f"{master.foreign_master.text} It can enable the drives again.")

    def attempt(self, action: Callable[[], None]) -> bool:
        """Try an action several times; return whether it succeeded. The reason of a failure is noted once."""
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
        if not self.is_failure_reported:  # the first failure is the cause, the others follow from it
            self.is_failure_reported = True
            self.master.notes.append(note)
        return False

    def _enable_communication(self, station: Node | ModuleNode) -> None:
        """Enable PDO and SDO of a node. One that has restarted has its own PDO mapping: SDO alone."""
        command = cia301.START if self.master.has_mapping(station) else cia301.PRE_OPERATIONAL
        self.attempt(partial(self.master.nmt, command, station.number))

    def _order(self, node: Node, goal: State) -> None:
        """Set a drive's goal, and command it by SDO too: process data may wait for a SYNC that never comes."""
        node.goal = goal
        self._command(node)

    def _command(self, node: Node) -> None:
        """Send the controlword of a node's goal by SDO, without waiting for the answer."""
        word = 0 if node.goal is State.DISABLED else cia402.TYPICAL[Command.QUICK_STOP]
        self._download(node, 0x6040, 0, struct.pack("<H", word))

    def _download(self, node: Node, index: int, sub: int, data: bytes) -> None:
        node.sdo.prompt = False  # its answer may be taken for one to a later request
        frame = Frame(cia301.SDO_REQUEST + node.number, download_request(index, sub, data))
        self.attempt(partial(self.network.send, frame))

    def _stands(self, node: Node) -> bool:
        """Whether it is slow enough; or without current and without a recent speed: another program may stop its answers."""
        unknown = node.state in AT_REST and self.network.now - max(self.begin_time, node.velocity_at) > BRAKING
        return unknown or abs(node.velocity) < 0.01 * node.keys.limits.velocity

    def _confirmed(self, node: Node) -> bool:
        """Whether it has reported since the stop began that it brakes or has no current."""
        return node.word_at > self.begin_time and node.state in REACTED

    def _has_timed_out(self, node: Node) -> bool:
        """Whether it reported nothing for as long as it may take to stop by itself, or to boot after another master's reset."""
        timeout = 2 * node.keys.heartbeat.lost_after + BRAKING
        if self.master.foreign_master.action:
            timeout = max(timeout, BOOT)
        return self.network.now - max(self.begin_time, node.word_at) > timeout

    def _cycle_until_standstill(self) -> None:
        """Run cycles until every responding drive has no current, each as soon as it stands; or until a timeout."""
        master, network = self.master, self.network
        end = network.now + STANDSTILL
        while (
            network.now < end
            and self.failed < GONE
            and not all(self._at_rest(node) or self._has_timed_out(node) for node in master.nodes.values())
        ):
            self.failed = 0 if self.attempt(master.run_cycle) else self.failed + 1
            for station in master.stations.values():
                if station.nmt_state is NmtState.STOPPED:
                    station.nmt_state = None  # until its next heartbeat
                    self._enable_communication(station)
            for node in master.nodes.values():
                if node.nmt_state is None:
                    self._command(node)
                if node.silent or not master.has_mapping(node):  # its process data may mean something else
                    self._poll_by_sdo(node)
                if node.goal is State.QUICK_STOP and self._confirmed(node) and self._stands(node):
                    self._order(node, State.DISABLED)
            self._end_heartbeat()

    def _at_rest(self, node: Node) -> bool:
        return node.goal is State.DISABLED and self._confirmed(node) and node.state in AT_REST

    def _poll_by_sdo(self, node: Node) -> None:
        """Read state and speed by SDO of a drive without process data of the run; repeat the command while it does not act."""
        node.sdo.attempts, node.sdo.timeout = 1, SDO_TIMEOUT
        with suppress(SimulationError):
            node.word = setup.read(node, 0x6041)
            node.word_at = self.network.now
            node.raw_velocity = setup.read(node, 0x606C)
            node.velocity_at = self.network.now
        if node.state is State.ENABLED:
            self._command(node)

    def _end_heartbeat(self) -> None:
        """End the heartbeat once a drive did not confirm in time; drives without current have their consumer cleared first."""
        unconfirmed = [
            node
            for node in self.master.nodes.values()
            if not self._confirmed(node) and self.network.now - self.begin_time > node.keys.heartbeat.lost_after
        ]
        if self.silenced or not unconfirmed:
            return
        self.silenced = True
        for node in self.master.nodes.values():
            consumer = 0x1016, node.consumer_entry
            if self._confirmed(node) and node.state in AT_REST and consumer in node.journal.changes:
                self._download(node, *consumer, bytes(4))
        self.master.end_heartbeat()
        names = ", ".join(node.name for node in unconfirmed)
        self.master.notes.append(
            f"{names}: did not confirm the quick stop: this program sends no heartbeat any more, so that it stops by itself."
        )

    def _report_limit_switches(self, node: Node) -> None:
        """Report closed limit switches: a drive that brakes at one reports no error, only a following error."""
        if cia402.INPUTS in node.mirror:
            with suppress(SdoError):
                if closed := cia402.closed_limit_switches(node.sdo.number(cia402.INPUTS)):
                    self.master.closed_switches.append(f"{node.name}: its {closed} is closed (60FDh).")

    def _save_reference(self, node: Node) -> None:
        """Save the reference for the next run, unless the count may be lost or the drive did not confirm."""
        is_lost = node.boots or any(emergency.code in SENSOR_ERRORS for emergency in node.emergencies)
        if (
            not node.has_reference
            or is_lost
            or not self._at_rest(node)
            or self.master.foreign_master.has_reset(node.number)
        ):
            node.has_reference = False
            return
        if node.keys.homing is None:  # a manual motion records it by itself
            return
        try:
            Reference(self.master.keys, node.name, node.rotary).save(node)
        except (OSError, TwinError) as error:
            node.has_reference = False
            self.master.notes.append(f"{node.name}: its reference is not recorded ({error}): it is homed again.")

    def _release(self, node: Node) -> None:
        """Disable with safe outputs and no expected heartbeat; note it where the drive does not confirm."""
        state, why = node.state, ""
        node.sdo.attempts, node.sdo.timeout = ATTEMPTS, TIMEOUT
        if self._has_timed_out(node):
            node.sdo.attempts, node.sdo.timeout = 1, SDO_TIMEOUT
        elif self.master.foreign_master.action:  # it may be stopped again at any time
            node.sdo.timeout = TIMEOUT // 3
        try:
            setup.make_safe(node)
        except SimulationError as error:  # it is disabled all the same
            why = f" {error}"
        try:
            state = setup.release(node)
            if state in (State.FAULT, State.REACTION):
                self.master.fault_texts.append(setup.faults(node))
            self._report_limit_switches(node)
        except SimulationError as error:
            why += f" {error}"
        if why or state not in AT_REST:
            self.master.notes.append(
                f"{node.name}: did not confirm that it is disabled (last state: {state}).{why} "
                f"Check it before you touch it."
            )
