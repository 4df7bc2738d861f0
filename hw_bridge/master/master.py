"""CANopen master: enables all drives, exchanges process data once per cycle, monitors, and stops all drives on any failure.

Call sequence: `begin` once, then `exchange` at every cycle with `wait` in between and `check` before the next; finally
`stop`, in every case.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from hw_bridge.bus import MILLISECOND, Frame, bit_count, never
from hw_bridge.dictionary import State, cia301
from hw_bridge.hardware import stall_bounds
from hw_bridge.master import fault_report, homing, restoration, run_checks, setup
from hw_bridge.master.activity import active_drives
from hw_bridge.master.age import PATTERN, SHIFT
from hw_bridge.master.block_signals import block_signals
from hw_bridge.master.foreign_master import ForeignMasterMonitor
from hw_bridge.master.module import ModuleNode
from hw_bridge.master.node import Node
from hw_bridge.master.sdo import SilentError
from hw_bridge.master.stop import ALONE, Stop
from hw_bridge.master.timing import Timing
from hw_bridge.profiles import device
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from collections.abc import Set as AbstractSet

    from hw_bridge.bus import Condition, Network
    from hw_bridge.hardware import HardwareKeys
    from hw_bridge.master.plan import WritePlan

ALIVE = 0x05  # NMT state in this program's heartbeat: Operational
BOOT = 500 * MILLISECOND  # longest time that a drive takes to answer after power-on [ns]
SECOND_ANSWER = 10 * MILLISECOND  # time for that of another node with the same ID
RAMP_UP = 2_000 * MILLISECOND  # longest time to Operation enabled
LEEWAY = (
    400_000  # at least, of the targets before SYNC by the wall clock: as long as waking up and orders may take [ns]
)
# from one SYNC to the next, of a cycle: estimate, a late one is caught up with at a third more than the speed
SHORTEST = 0.75
# In simulated time cycles begin here in those of the drives [ns], so that results do not depend on how long the set-up
# took. At 1 Mbit/s targets act 1.0 ms later; real drives have any phase.
CONTROL_CYCLE, PHASE = MILLISECOND, 990_000
RESET = "Find the cause, then reset it with `twin hil reset -f FILE`."


class Master:
    """All drives and modules of one bus. `forced`: names of the drives with target forces."""

    def __init__(self, keys: HardwareKeys, network: Network, forced: AbstractSet[str] = frozenset()) -> None:
        self.keys, self.network = keys, network
        self.cycle = keys.cycle
        self.nodes = {
            name: Node(name, node_keys, node_keys.drive, network, self.wait) for name, node_keys in keys.nodes.items()
        }
        for node in self.nodes.values():
            node.measure_age(self.cycle)
        for name in forced:
            self.nodes[name].has_target_force = True
            self.nodes[name].use_process_data()
        self.modules = {
            name: ModuleNode(name, module, device(module.profile), network, self.wait)
            for name, module in keys.modules.items()
        }
        self.stations: dict[str, Node | ModuleNode] = {**self.nodes, **self.modules}
        self._by_number = {station.number: station for station in self.stations.values()}
        self.timing = Timing(self.cycle)
        self.max_missed_cycles, self.oldest = stall_bounds.missed_cycles(keys), stall_bounds.value_age(keys)
        self.notes: list[str] = []
        self.restorations: list[str] = []  # results of restoring the written objects
        self.recovered: list[str] = []  # objects of an earlier run, restored before this one
        self.references: list[str] = []  # drives not homed because their reference is still valid
        self.closed_switches: list[str] = []  # limit switches that drives reported after the stop
        self.fault_texts: list[str] = []  # texts of drives in Fault after the stop
        self.announce: Callable[[Master], None] | None = None  # before anything is written
        self.armed = True  # outputs may switch
        self.running = False
        self._beating = False
        self._beat_due = self._beat_at = 0  # of this program's heartbeat: the next and the last one [ns]
        self._longest_gap = 0  # between two of them [ns]
        self._uneven = 0  # position in the pattern of uneven SYNCs
        self._exchanged = self._synced = 0  # when the last targets, and the last SYNC, went out [ns]
        self.shortest = int(SHORTEST * self.cycle)
        self.foreign_master = ForeignMasterMonitor(
            keys.master, {station.number: name for name, station in self.stations.items()}
        )
        bits = [bit_count(frame) for station in self.stations.values() for frame in station.frames()]
        # SYNC leaves after all targets are on the wire, and after the last one where this program was slower than the
        # wire: its identifier would win against theirs
        self.window = sum(bits) * 1_000_000_000 // keys.bit_rate + 100_000
        self._tail = max(bits, default=0) * 1_000_000_000 // keys.bit_rate
        self.lead = self.window  # of the plan before SYNC
        if network.wall_clock:  # as long for what delays targets before SYNC as for what delays the answers after it
            self.lead = max(self.window + LEEWAY, self.cycle // 2)
        network.hear = self._hear

    # ------------------------------------------------------------------------------------------------------- frames

    def _hear(self, frame: Frame) -> None:
        self.foreign_master.hear(frame)
        node = self._by_number.get(frame.id & 0x7F)
        if node is not None and frame.id > 0x7F and not frame.remote:
            node.process_frame(frame, self.network.now)
            if isinstance(node, Node):
                for answer in node.acknowledge():
                    self.network.send(answer)

    def wait(self, duration: int, done: Condition = never) -> None:
        """Let time pass, receive frames and send this program's heartbeat."""
        self.wait_until(self.network.now + duration, done)

    def wait_until(self, until: int, done: Condition = never) -> None:
        """Wait until a time [ns], or until a condition holds."""
        network = self.network
        while True:
            if self._beating and network.now >= self._beat_due:
                self._longest_gap, self._beat_at = self._heartbeat_gap(), network.now
                network.send(Frame(cia301.ERROR_CONTROL + self.keys.master, bytes([ALIVE])))
                self._beat_due = network.now + min(station.keys.heartbeat.every for station in self.stations.values())
            network.advance(min(until, self._beat_due) if self._beating else until, done)
            if network.now >= until or (done is not never and done()):
                return

    def nmt(self, command: int, number: int) -> None:
        """Send an NMT command to one node: others on the bus may belong to another program."""
        self.network.send(Frame(cia301.NMT, bytes([command, number])))

    def _heartbeat_gap(self) -> int:
        """Longest time without this program's heartbeat until now [ns]."""
        return max(self._longest_gap, self.network.now - self._beat_at)

    def _check_own_heartbeat(self) -> None:
        """Raise SimulationError if drives missed this program's heartbeat: a controlword could enable one that stopped."""
        longest = min(station.keys.heartbeat.lost_after for station in self.stations.values())
        if self._beating and (gap := self._heartbeat_gap()) > longest:
            raise SimulationError(
                f"this program stood for {gap / 1e6:.0f} ms, longer than heartbeat.lost_after: the drives stop by themselves. "
                f"Begin anew."
            )

    def end_heartbeat(self) -> None:
        """Stop sending the heartbeat: each drive then stops by itself, as its 1016h and 6007h say."""
        self._beating = False

    def exchange(self, planned: int | None = None) -> int:
        """Send the targets of all drives, then SYNC; return its time [ns]. `planned`: planned begin of the cycle.

        SYNC keeps to the plan, on the wall clock a little after the targets, so that their small delays do not move it.
        After a late SYNC the next periods are shorter: two SYNCs at once would give a drive without interpolation twice
        the distance in one step.
        """
        if self.running:  # not during a stop, whose controlwords enable nothing
            self._check_own_heartbeat()
        elapsed, self._exchanged = self.network.now - self._exchanged, self.network.now
        for station in self.stations.values():
            station.update_age(self.network.now)
        due = self._exchanged + self.window
        if planned is not None:
            due = max(due, planned + self.lead, self._synced + self.shortest)
        for node in self.nodes.values():
            node.limit_acceleration(self.cycle, self._synced)
            node.follow(self.cycle, elapsed)
        for station in self.stations.values():
            station.count_answers()
            if self.has_mapping(station):
                for frame in station.frames():
                    self.network.send(frame)
        if any(station.in_doubt for station in self.stations.values()):
            self._uneven = (self._uneven + 1) % len(PATTERN)
            due += PATTERN[self._uneven] * round(SHIFT * self.cycle)
        self._synced = self.network.send_at(Frame(cia301.SYNC), max(due, self.network.now + self._tail))
        for station in self.stations.values():
            station.synced(self._synced)
        return self._synced

    def has_mapping(self, station: Node | ModuleNode) -> bool:
        """Whether a node still has this program's PDO mapping, as far as known: else a target could act as a controlword."""
        return station.started and not station.boots and not self.foreign_master.has_reset(station.number)

    def run_cycle(self) -> None:
        """Run one cycle outside of a run: while drives are brought up or stopped."""
        self.exchange()
        self.wait(self.cycle)

    # ----------------------------------------------------------------------------------------------------- begin

    def identify(self) -> list[str]:
        """Return every difference between the bus and the hardware file."""
        self.wait(BOOT, self._all_booted)
        return [problem for station in self.stations.values() for problem in self.compare(station)]

    def compare(self, station: Node | ModuleNode) -> list[str]:
        """Return every difference between an answering node and the hardware file."""
        with self.asking(station):
            differences = setup.identify(station) if isinstance(station, Node) else station.identify()
        self.wait(SECOND_ANSWER)
        return [station.doubled] if station.doubled else differences

    @contextmanager
    def asking(self, station: Node | ModuleNode) -> Iterator[None]:
        """Add the node's name to a timeout, and that it sends heartbeats if it does."""
        try:
            yield
        except SilentError as error:
            hint = " It tells that it lives, but takes no SDO: switch it off and on." if station.alive else ""
            raise SilentError(f"{station.name}: {error}{hint}") from None

    def _all_booted(self) -> bool:
        return all(station.boots for station in self.stations.values())

    def prepare(self) -> None:
        """From any state to process data in both directions; no power."""
        if problems := self.identify():
            raise SimulationError(" ".join(problems))
        if problems := self.faults():
            raise SimulationError(f"{' '.join(problems)} {RESET}")
        if problems := active_drives(self.nodes.values(), self.wait):
            raise SimulationError(" ".join(problems))
        if self.foreign_master.text:
            raise SimulationError(self.foreign_master.text)
        self.network.lock()
        restoration.begin(self)
        if self.announce is not None:
            self.announce(self)
        self.running = True
        for station in self.stations.values():
            self.nmt(cia301.PRE_OPERATIONAL, station.number)
            with self.asking(station):
                if isinstance(station, Node):
                    setup.configure(station, self._target_period(station), self.keys.master)
                else:
                    station.configure(self.keys.master)
        self._beating, self._beat_due, self._beat_at = True, self.network.now, self.network.now
        for station in self.stations.values():
            self.nmt(cia301.START, station.number)
            station.started, station.last_heartbeat_at = True, self.network.now
            station.boots = 0  # one from now on is a restart, or a second node
        started_at = self.network.now
        for _ in range(3):
            self.run_cycle()
        # a position that was never received is 0, and would move origin and limits of a drive
        self.run_until(
            lambda: all(node.answered_at > started_at for node in self.nodes.values()),
            RAMP_UP,
            lambda: ", ".join(
                f"{node.name}: no position" for node in self.nodes.values() if node.answered_at <= started_at
            ),
        )

    def plan(self, station: Node | ModuleNode) -> WritePlan:
        """Plan all writes of a run to a node; only reads."""
        if isinstance(station, ModuleNode):
            return station.plan(self.keys.master)
        return setup.plan_drive(station, self._target_period(station), self.keys.master)

    def _target_period(self, node: Node) -> int:
        """Return the interpolation period for a drive [ns]; 0: none, so that it does not watch for late targets."""
        watched = self.keys.late_cycle.rpdo_timeout or not node.profile.rpdo_timeout
        return self.cycle if watched else 0

    def begin(self, starts: Mapping[str, float]) -> None:
        """From any state to Operation enabled at standstill at the scenario's start positions `starts`."""
        if problems := [text for node in self.nodes.values() if (text := homing.problem(node, starts[node.name]))]:
            raise SimulationError(" ".join(problems))
        self.prepare()
        for node in self.nodes.values():
            if node.keys.homing is None:
                node.zero(starts[node.name])
            else:
                homing.find_reference(self, node)
            setup.limit_positions(node)
        for node in self.nodes.values():
            node.goal, node.target_velocity = State.ENABLED, 0.0
            node.target_position = node.position
        self.run_until(
            lambda: all(node.state is State.ENABLED for node in self.nodes.values()),
            RAMP_UP,
            lambda: ", ".join(
                f"{drive.name}: {drive.state}" for drive in self.nodes.values() if drive.state is not State.ENABLED
            ),
        )
        for station in self.stations.values():
            station.forget()
        for node in self.nodes.values():
            if node.keys.homing is not None:
                homing.approach(self, node, starts[node.name])
        for module in self.modules.values():
            module.resting = False
        if not self.network.wall_clock:
            self.wait((PHASE - self.network.now) % CONTROL_CYCLE)

    def faults(self) -> list[str]:
        """Error texts of the drives in Fault; only an operator resets them."""
        texts = []
        for node in self.nodes.values():
            with self.asking(node):
                texts.append(setup.faults(node))
        return [text for text in texts if text]

    def run_until(
        self, done: Callable[[], bool], limit: int, what: Callable[[], str], watch: Callable[[], None] | None = None
    ) -> None:
        """Run monitored cycles until a condition holds; SimulationError after `limit` [ns]."""
        end = self.network.now + limit
        while not done():
            if self.network.now > end:
                raise SimulationError(f"not enabled after {limit / 1e9:g} s: {what()}.{self.emergencies()}")
            if any(node.state is State.FAULT for node in self.nodes.values()):
                raise SimulationError(f"{' '.join(self.faults())}{self.emergencies()} {RESET}")
            if self.foreign_master.text:
                raise SimulationError(self.foreign_master.text)
            self.run_cycle()
            for station in self.stations.values():
                if station.boots:
                    raise SimulationError(
                        f"{station.name}: started anew by itself while it was brought up. Check its supply."
                    )
                if self.lost(station) or station.silent > 4 * stall_bounds.SILENT_CYCLES:
                    missing = "heartbeat" if self.lost(station) else "process data"
                    raise SimulationError(
                        f"{station.name}: no {missing} while it was brought up.{self.emergencies()} Check its power and the bus."
                    )
            if watch is not None:  # what a node sends that has restarted is not in the run's mapping
                watch()

    def emergencies(self) -> str:
        """EMCY messages received, as a sentence with a leading space."""
        return f" {fault_report.format_emergencies(self.stations.values())}".rstrip()

    # ------------------------------------------------------------------------------------------------------ watch

    def check(self) -> str:
        """Return the first problem of any drive or module, or an empty string."""
        drives = [run_checks.drive_problem(self, node) for node in self.nodes.values()]
        modules = [run_checks.station_problem(self, module) for module in self.modules.values()]
        return next(filter(None, [self.foreign_master.text, *drives, *modules]), "")

    # ------------------------------------------------------------------------------------------------------- stop

    def stop(self) -> None:
        """Quick stop, then disable, on every path; what cannot be confirmed is added to the notes. Never raises."""
        if not self.running:
            restoration.finish(self)
            self.network.close()
            return
        with block_signals():
            self.running = False
            try:
                Stop(self).carry_out()
            except Exception as error:
                self.notes.append(f"stop: {error} {ALONE}")
            finally:
                self.end_heartbeat()
                restoration.finish(self)
                self.network.close()
                self.notes += self.network.observer_errors

    def describe_failure(self, text: str) -> str:
        """After the stop: a failure with the drives' own error texts."""
        second = " ".join(
            station.doubled for station in self.stations.values() if station.doubled and station.doubled not in text
        )
        report = fault_report.describe_failure(
            f"{text} {second}".rstrip(), self.foreign_master.text, self.fault_texts, self.stations.values()
        )
        return " ".join([report, *self.closed_switches])

    def next_step(self) -> str:
        """After a stop on a failure: what the operator does to continue."""
        return fault_report.next_step(self.nodes.values(), bool(self.foreign_master.action))

    def lost(self, node: Node | ModuleNode) -> bool:
        """Whether a node's heartbeat is missing."""
        return self.network.now - node.last_heartbeat_at > node.keys.heartbeat.lost_after

    def report(self) -> dict[str, Any]:
        """Statistics of the run."""
        nodes = {
            name: {
                **({"limited_targets": node.acceleration.count} if isinstance(node, Node) else {}),
                "oldest_actual_value": node.oldest / 1e9,
                "late_pdos": node.late,
                "lost_pdos": node.lost,
                "emergencies": [f"{emergency.code:04X}" for emergency in node.emergencies],
                "emergency_messages": [
                    f"{emergency.time / 1e9:.3f} s: {fault_report.format_emergency(node, emergency)}"
                    for emergency in node.emergencies
                ],
            }
            for name, node in self.stations.items()
        }
        totals = {"restorations": [*self.recovered, *self.restorations], "references": self.references}
        return {**self.timing.summary(), "nodes": nodes, **totals}
