"""The master: brings all drives up, exchanges process data once per cycle, watches, and stops them on every failure.

Call sequence: `begin` once, then `exchange` at every cycle with `wait` in between and `check` before the next, at last
`stop`, whatever happened.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from hw_bridge.bus import MILLISECOND, Frame, bit_count, never
from hw_bridge.dictionary import State, cia301
from hw_bridge.master import homing, restoration, run_checks, setup, words
from hw_bridge.master.activity import active_drives
from hw_bridge.master.age import PATTERN, SHIFT
from hw_bridge.master.module import ModuleNode
from hw_bridge.master.node import Node
from hw_bridge.master.rival import Rival
from hw_bridge.master.sdo import SilentError
from hw_bridge.master.stop import ALONE, SILENT_CYCLES, Stop
from hw_bridge.master.timing import Timing
from hw_bridge.master.undisturbed import undisturbed
from hw_bridge.profiles import device
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from collections.abc import Set as AbstractSet

    from hw_bridge.bus import Condition, Network
    from hw_bridge.hardware import HardwareKeys
    from hw_bridge.master.plan import WritePlan

ALIVE = 0x05  # the state that this program's heartbeat tells: Operational
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
# cycles that actual values may be old when the next targets follow from them; one is the least, and 5 without any end a run
OLDEST = 4.25
RESET = "Find the cause, then reset it with `twin hil reset FILE`."


class Master:
    """All drives of one bus. `forced`: names of those that are told a force."""

    def __init__(self, keys: HardwareKeys, network: Network, forced: AbstractSet[str] = frozenset()) -> None:
        self.keys, self.network = keys, network
        self.cycle = keys.cycle
        self.nodes = {name: Node(name, one, one.drive, network, self.wait) for name, one in keys.nodes.items()}
        for node in self.nodes.values():
            node.measure_age(self.cycle)
        for name in forced:
            self.nodes[name].told_force = True
            self.nodes[name].use_process_data()
        self.modules = {
            name: ModuleNode(name, module, device(module.profile), network, self.wait)
            for name, module in keys.modules.items()
        }
        self.stations: dict[str, Node | ModuleNode] = {**self.nodes, **self.modules}
        self._by_number = {station.number: station for station in self.stations.values()}
        self.timing = Timing(self.cycle)
        # so many cycles without process data end a run: a drive, or what carries its frames, may be as late as this program
        self.patience = max(SILENT_CYCLES, (keys.late_cycle.at_most or 0) // self.cycle)
        self.oldest = max(round(OLDEST * self.cycle), keys.late_cycle.at_most or 0)  # age of actual values [ns]
        self.notes: list[str] = []
        self.restorations: list[str] = []  # what became of the objects that were written
        self.recovered: list[str] = []  # what an earlier run had left and was restored before this one
        self.references: list[str] = []  # drives that were not homed, since they count from their reference still
        self.closed_switches: list[str] = []  # limit switches that drives told after the stop
        self.said: list[str] = []  # by drives that were in Fault after the stop
        self.announce: Callable[[Master], None] | None = None  # before anything is written
        self.running = False
        self._beating = False
        self._beat_due = 0
        self._uneven = 0  # place in the pattern of SYNCs that tell how late answers are
        self._exchanged = self._synced = 0  # when the last targets, and the last SYNC, went out [ns]
        self.shortest = int(SHORTEST * self.cycle)
        self.rival = Rival(keys.master, {one.number: name for name, one in self.stations.items()})
        bits = [bit_count(frame) for one in self.stations.values() for frame in one.frames()]
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
        self.rival.hear(frame)
        node = self._by_number.get(frame.id & 0x7F)
        if node is not None and frame.id > 0x7F and not frame.remote:
            node.heard(frame, self.network.now)
            if isinstance(node, Node):
                for answer in node.acknowledge():
                    self.network.send(answer)

    def wait(self, duration: int, done: Condition = never) -> None:
        """Let time pass, hear frames and tell that this program lives."""
        self.wait_until(self.network.now + duration, done)

    def wait_until(self, until: int, done: Condition = never) -> None:
        """The same, until a time [ns]."""
        network = self.network
        while True:
            if self._beating and network.now >= self._beat_due:
                network.send(Frame(cia301.ERROR_CONTROL + self.keys.master, bytes([ALIVE])))
                self._beat_due = network.now + min(station.keys.heartbeat.every for station in self.stations.values())
            network.advance(min(until, self._beat_due) if self._beating else until, done)
            if network.now >= until or (done is not never and done()):
                return

    def nmt(self, command: int, number: int) -> None:
        """Send an NMT command to one node: others on the bus may belong to another program."""
        self.network.send(Frame(cia301.NMT, bytes([command, number])))

    def end_heartbeat(self) -> None:
        """Send no heartbeat any more: each drive stops by itself, as its 1016h and 6007h say."""
        self._beating = False

    def exchange(self, planned: int | None = None) -> int:
        """Targets of all drives, then SYNC: when it left [ns]. `planned`: when the cycle was to begin.

        SYNC keeps to the plan, by the wall clock a little after the targets: what delays them a little does not move it.
        One that was late is caught up with by shorter periods: two at once would tell a drive without interpolation twice
        the way in one step.
        """
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
            station.account()
            if self.running or self.has_mapping(station):
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
        """Whether a node still has the PDO mapping of this program, for all that is known: a target is no controlword."""
        return station.started and not station.boots and not self.rival.has_reset(station.number)

    def run_cycle(self) -> None:
        """One cycle outside of a run: while drives are brought up or stopped."""
        self.exchange()
        self.wait(self.cycle)

    # ----------------------------------------------------------------------------------------------------- begin

    def identify(self) -> list[str]:
        """Every difference between the bus and the hardware file."""
        self.wait(BOOT, self._all_booted)
        return [problem for station in self.stations.values() for problem in self.compare(station)]

    def compare(self, station: Node | ModuleNode) -> list[str]:
        """Every difference between a node that answers and the one that the hardware file expects."""
        with self.asking(station):
            found = setup.identify(station) if isinstance(station, Node) else station.identify()
        self.wait(SECOND_ANSWER)
        return [station.doubled] if station.doubled else found

    @contextmanager
    def asking(self, station: Node | ModuleNode) -> Iterator[None]:
        """Name the one that does not answer, and that it lives, if it told that."""
        try:
            yield
        except SilentError as error:
            told = " It tells that it lives, but takes no SDO: switch it off and on." if station.alive else ""
            raise SilentError(f"{station.name}: {error}{told}") from None

    def _all_booted(self) -> bool:
        return all(station.boots for station in self.stations.values())

    def prepare(self) -> None:
        """From whatever state to process data both ways; no power."""
        if problems := self.identify():
            raise SimulationError(" ".join(problems))
        if problems := self.faults():
            raise SimulationError(f"{' '.join(problems)} {RESET}")
        if problems := active_drives(self.nodes.values(), self.wait):
            raise SimulationError(" ".join(problems))
        if self.rival.text:
            raise SimulationError(self.rival.text)
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
        self._beating, self._beat_due = True, self.network.now
        for station in self.stations.values():
            self.nmt(cia301.START, station.number)
            station.started, station.heard_at = True, self.network.now
        for _ in range(3):
            self.run_cycle()

    def plan(self, station: Node | ModuleNode) -> WritePlan:
        """All that a run would write into a node; it is only read."""
        if isinstance(station, ModuleNode):
            return station.plan(self.keys.master)
        return setup.plan_drive(station, self._target_period(station), self.keys.master)

    def _target_period(self, node: Node) -> int:
        """Return the interpolation period for a drive [ns]; 0: none, so that it does not watch for late targets."""
        watched = self.keys.late_cycle.rpdo_timeout or not node.profile.rpdo_timeout
        return self.cycle if watched else 0

    def begin(self, starts: Mapping[str, float]) -> None:
        """From whatever state to Operation enabled at a standstill, where the scenario begins: `starts`, positions."""
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
                f"{one.name}: {one.state}" for one in self.nodes.values() if one.state is not State.ENABLED
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
        """What drives in Fault say; nobody but a person resets them."""
        found = []
        for node in self.nodes.values():
            with self.asking(node):
                found.append(setup.faults(node))
        return [text for text in found if text]

    def run_until(
        self, done: Callable[[], bool], limit: int, what: Callable[[], str], watch: Callable[[], None] | None = None
    ) -> None:
        """Cycles until a condition holds, each watched; SimulationError if it takes longer than `limit` [ns]."""
        end = self.network.now + limit
        while not done():
            if self.network.now > end:
                raise SimulationError(f"not enabled after {limit / 1e9:g} s: {what()}.{self.emergencies()}")
            if any(node.state is State.FAULT for node in self.nodes.values()):
                raise SimulationError(f"{' '.join(self.faults())}{self.emergencies()} {RESET}")
            if self.rival.text:
                raise SimulationError(self.rival.text)
            self.run_cycle()
            if watch is not None:
                watch()
            for station in self.stations.values():
                if self.lost(station) or station.silent > 4 * SILENT_CYCLES:
                    missing = "heartbeat" if self.lost(station) else "process data"
                    raise SimulationError(
                        f"{station.name}: no {missing} while it was brought up.{self.emergencies()} Check its power and the bus."
                    )

    def emergencies(self) -> str:
        """What the drives said in EMCY messages."""
        return f" {words.emergencies(self.stations.values())}".rstrip()

    # ------------------------------------------------------------------------------------------------------ watch

    def check(self) -> str:
        """What is wrong with any drive or module, or nothing."""
        drives = [run_checks.drive_problem(self, node) for node in self.nodes.values()]
        modules = [run_checks.station_problem(self, module) for module in self.modules.values()]
        return next(filter(None, [self.rival.text, *drives, *modules]), "")

    # ------------------------------------------------------------------------------------------------------- stop

    def stop(self) -> None:
        """The one way to the end: quick stop, then disabled; what cannot be confirmed is told. Never raises."""
        if not self.running:
            restoration.finish(self)
            self.network.close()
            return
        self.running = False
        with undisturbed():
            try:
                Stop(self).carry_out()
            except Exception as error:
                self.notes.append(f"stop: {error} {ALONE}")
            finally:
                self.end_heartbeat()
                restoration.finish(self)
                self.network.close()
                self.notes += self.network.observer_errors

    def in_full(self, text: str) -> str:
        """After the stop: a failure with the drives' own words."""
        second = " ".join(
            station.doubled for station in self.stations.values() if station.doubled and station.doubled not in text
        )
        told = words.in_full(f"{text} {second}".rstrip(), self.rival.text, self.said, self.stations.values())
        return " ".join([told, *self.closed_switches])

    def next_step(self) -> str:
        """After a stop on a failure: what a person does to go on."""
        return words.next_step(self.nodes.values(), bool(self.rival.act))

    def lost(self, node: Node | ModuleNode) -> bool:
        """Whether its heartbeat is missing."""
        return self.network.now - node.heard_at > node.keys.heartbeat.lost_after

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
                    f"{emergency.time / 1e9:.3f} s: {words.message(node, emergency)}" for emergency in node.emergencies
                ],
            }
            for name, node in self.stations.items()
        }
        told = {"restorations": [*self.recovered, *self.restorations], "references": self.references}
        return {**self.timing.summary(), "nodes": nodes, **told}
