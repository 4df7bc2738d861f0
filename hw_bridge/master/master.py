"""The master: brings all drives up, exchanges process data once per cycle, watches, and stops them on every failure.

Call sequence: `begin` once, then `exchange` at every cycle with `wait` in between and `check` before the next, at last
`stop`, whatever happened.
"""

from __future__ import annotations

from contextlib import contextmanager
from math import copysign
from typing import TYPE_CHECKING, Any

from hw_bridge.bus import MILLISECOND, Frame, bit_count, never
from hw_bridge.dictionary import Mode, State, cia301, cia402
from hw_bridge.master import restoration, setup, words
from hw_bridge.master.module import ModuleNode
from hw_bridge.master.node import AT_REST, Node
from hw_bridge.master.rival import Rival
from hw_bridge.master.sdo import SilentError
from hw_bridge.master.stop import ALONE, SILENT_CYCLES, Stop
from hw_bridge.master.timing import Timing
from hw_bridge.master.undisturbed import undisturbed
from hw_bridge.profiles import device, profile
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from collections.abc import Set as AbstractSet

    from hw_bridge.bus import Condition, Network
    from hw_bridge.hardware import HardwareKeys
    from hw_bridge.master.plan import WritePlan

ALIVE = 0x05  # the state that this program's heartbeat tells: Operational
BOOT = 500 * MILLISECOND  # longest time that a drive takes to answer after power-on [ns]
RAMP_UP = 2_000 * MILLISECOND  # longest time to Operation enabled
SETTLE = 200 * MILLISECOND  # after an approach
LEEWAY = (
    400_000  # at least, of the targets before SYNC by the wall clock: as long as waking up and orders may take [ns]
)
# from one SYNC to the next, of a cycle: estimate, a late one is caught up with at a third more than the speed
SHORTEST = 0.75
# In simulated time cycles begin here in those of the drives [ns], so that results do not depend on how long the set-up
# took. At 1 Mbit/s targets act 1.0 ms later; real drives have any phase.
CONTROL_CYCLE, PHASE = MILLISECOND, 990_000
RESET = "Find the cause, then reset it with `twin hil reset FILE`."


class Master:
    """All drives of one bus. `forced`: names of those that are told a force."""

    def __init__(self, keys: HardwareKeys, network: Network, forced: AbstractSet[str] = frozenset()) -> None:
        self.keys, self.network = keys, network
        self.cycle = keys.cycle
        self.nodes = {
            name: Node(name, one, profile(one.profile), network, self.wait) for name, one in keys.nodes.items()
        }
        for name in forced:
            self.nodes[name].told_force = True
        self.modules = {
            name: ModuleNode(name, one, device(one.profile), network, self.wait) for name, one in keys.modules.items()
        }
        self.stations: dict[str, Node | ModuleNode] = {**self.nodes, **self.modules}
        self._by_number = {station.number: station for station in self.stations.values()}
        self.timing = Timing(self.cycle)
        # so many cycles without process data end a run: a drive, or what carries its frames, may be as late as this program
        self.patience = max(SILENT_CYCLES, (keys.late_cycle.at_most or 0) // self.cycle)
        self.notes: list[str] = []
        self.restorations: list[str] = []  # what became of the objects that were written
        self.recovered: list[str] = []  # what an earlier run had left and was restored before this one
        self.said: list[str] = []  # by drives that were in Fault after the stop
        self.announce: Callable[[Master], None] | None = None  # before anything is written
        self.running = False
        self._beating = False
        self._beat_due = 0
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

    def wait(self, duration: int, done: Condition = never) -> None:
        """Let time pass, hear frames and tell that this program lives."""
        self.wait_until(self.network.now + duration, done)

    def wait_until(self, until: int, done: Condition = never) -> None:
        """The same, until a time [ns]."""
        network = self.network
        while True:
            if self._beating and network.now >= self._beat_due:
                network.send(Frame(cia301.ERROR_CONTROL + self.keys.master, bytes([ALIVE])))
                self._beat_due = network.now + min(one.keys.heartbeat.every for one in self.stations.values())
            network.advance(min(until, self._beat_due) if self._beating else until, done)
            if network.now >= until or (done is not never and done()):
                return

    def nmt(self, command: int, number: int = 0) -> None:
        """An NMT command, to all nodes if none is named."""
        self.network.send(Frame(0, bytes([command, number])))

    def exchange(self, planned: int | None = None) -> int:
        """Targets of all drives, then SYNC: when it left [ns]. `planned`: when the cycle was to begin.

        SYNC keeps to the plan, by the wall clock a little after the targets: what delays them a little does not move it.
        One that was late is caught up with by shorter periods: two at once would tell a drive without interpolation twice
        the way in one step.
        """
        elapsed, self._exchanged = self.network.now - self._exchanged, self.network.now
        due = self._exchanged + self.window
        if planned is not None:
            due = max(due, planned + self.lead, self._synced + self.shortest)
        for node in self.nodes.values():
            node.follow(self.cycle, elapsed)
        for station in self.stations.values():
            station.account()
            for frame in station.frames():
                self.network.send(frame)
        self._synced = self.network.send_at(Frame(cia301.SYNC), max(due, self.network.now + self._tail))
        return self._synced

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
            return setup.identify(station) if isinstance(station, Node) else station.identify()

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
        if self.rival.text:
            raise SimulationError(self.rival.text)
        self.network.lock()
        restoration.begin(self)
        if self.announce is not None:
            self.announce(self)
        self.running = True
        for node in self.nodes.values():
            self.nmt(cia301.PRE_OPERATIONAL, node.number)
            with self.asking(node):
                watched = self.keys.late_cycle.rpdo_timeout or not node.profile.rpdo_timeout
                setup.configure(node, self.cycle if watched else 0, self.keys.master)
        for module in self.modules.values():
            self.nmt(cia301.PRE_OPERATIONAL, module.number)
            with self.asking(module):
                module.configure(self.keys.master)
        self._beating, self._beat_due = True, self.network.now
        for station in self.stations.values():
            self.nmt(cia301.START, station.number)
            station.heard_at = self.network.now
        for _ in range(3):
            self.run_cycle()

    def plan(self, station: Node | ModuleNode) -> WritePlan:
        """All that a run would write into a node; it is only read."""
        if isinstance(station, ModuleNode):
            return station.plan(self.keys.master)
        watched = self.keys.late_cycle.rpdo_timeout or not station.profile.rpdo_timeout
        return setup.plan_drive(station, self.cycle if watched else 0, self.keys.master)

    def begin(self, starts: Mapping[str, float]) -> None:
        """From whatever state to Operation enabled at a standstill, where the scenario begins: `starts`, positions."""
        self.prepare()
        for node in self.nodes.values():
            if node.keys.homing is not None:
                self._home(node)
            else:
                node.zero(starts[node.name])
            setup.limit_positions(node)
        for node in self.nodes.values():
            node.goal, node.target_velocity = State.ENABLED, 0.0
            node.target_position = node.position
        self._until(
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
                self._approach(node, starts[node.name])
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

    def _until(self, done: Callable[[], bool], limit: int, what: Callable[[], str]) -> None:
        """Cycles until a condition holds; SimulationError if it takes too long."""
        end = self.network.now + limit
        while not done():
            if self.network.now > end:
                raise SimulationError(f"not enabled after {limit / 1e9:g} s: {what()}.{self._emergencies()}")
            if any(node.state is State.FAULT for node in self.nodes.values()):
                raise SimulationError(f"{' '.join(self.faults())}{self._emergencies()} {RESET}")
            if self.rival.text:
                raise SimulationError(self.rival.text)
            self.run_cycle()
            for one in self.stations.values():
                if self.lost(one) or one.silent > 4 * SILENT_CYCLES:
                    missing = "heartbeat" if self.lost(one) else "process data"
                    raise SimulationError(
                        f"{one.name}: no {missing} while it was brought up.{self._emergencies()} Check its power and the bus."
                    )

    def _emergencies(self) -> str:
        """What the drives said in EMCY messages."""
        return f" {words.emergencies(self.stations.values())}".rstrip()

    def _home(self, node: Node) -> None:
        """Find the reference with the drive's own method."""
        keys = node.keys.homing
        assert keys is not None
        setup.write(node, 0x6098, 0, keys.method)
        speed = round(keys.speed / (node.keys.scale * node.units.velocity))
        setup.put(node, 0x6099, 1, max(speed, 1))
        setup.put(node, 0x6099, 2, max(speed // 2, 1))
        node.homing, node.goal = True, State.ENABLED
        attained = cia402.BIT_12 | cia402.TARGET_REACHED
        what = f"{node.name}: homing by method {keys.method}"
        self._until(lambda: node.state is State.ENABLED, RAMP_UP, lambda: f"{what}: {node.state}")
        for _ in range(4):
            self.run_cycle()

        def done() -> bool:
            if node.state is not State.ENABLED:
                raise SimulationError(f"{what} was left: {node.state}.{self._emergencies()}")
            if node.word & cia402.BIT_13:
                raise SimulationError(f"{what} ended with an error.{self._emergencies()}")
            return node.word & attained == attained

        self._until(done, keys.timeout, lambda: f"{what} did not end")
        node.homing, node.goal = False, State.DISABLED
        self._until(lambda: node.state in AT_REST, RAMP_UP, lambda: node.name)
        node.origin = -keys.at
        node.entered_from = keys.at

    def _approach(self, node: Node, position: float) -> None:
        """Go to where the scenario begins, at the speed of homing."""
        assert node.keys.homing is not None
        step = node.keys.homing.speed * self.cycle / 1e9
        node.mode = Mode.CSP
        while (left := position - node.target_position) != 0.0:
            node.target_position = position if abs(left) <= step else node.target_position + copysign(step, left)
            self.run_cycle()
            if problem := self.check():
                raise SimulationError(problem)
        for _ in range(SETTLE // self.cycle):
            self.run_cycle()
        node.entered_from = None

    # ------------------------------------------------------------------------------------------------------ watch

    def check(self) -> str:
        """What is wrong with any drive or module, or nothing."""
        wrong = [self.rival.text, *map(self._wrong, self.nodes.values()), *map(self._unwell, self.modules.values())]
        return next(filter(None, wrong), "")

    def _unwell(self, node: Node | ModuleNode) -> str:
        now = self.network.now
        for _, code in node.emergencies:
            fault = node.profile.faults.get(code)
            if code and code >> 8 != 0:
                return f"{node.name}: EMCY {code:04X}h{f', {fault.meaning}' if fault else ''}."
        if now - node.heard_at > node.keys.heartbeat.lost_after:
            return f"{node.name}: no heartbeat for {(now - node.heard_at) / 1e6:.0f} ms. Check its power and the bus."
        if node.silent >= self.patience:
            return f"{node.name}: no process data for {node.silent} cycles. Check the bus."
        return f"{node.name}: started anew by itself. Check its supply." if node.boots else ""

    def _wrong(self, node: Node) -> str:
        limits = node.keys.limits
        if text := self._unwell(node):
            return text
        if node.state is not State.ENABLED:
            return f"{node.name}: left Operation enabled: {node.state}."
        low, high = node.position_limits
        if not low <= node.position <= high:
            return f"{node.name}: position {node.way(node.position)} is outside {node.way(low)} to {node.way(high)}."
        if abs(node.velocity) > limits.velocity:
            return f"{node.name}: velocity {node.way(node.velocity)}/s is above {node.way(limits.velocity)}/s."
        if abs(node.force) > limits.force:
            newton = "N m" if node.rotary else "N"
            return f"{node.name}: force {node.force:.2f} {newton} is above {limits.force:g} {newton}."
        if abs(node.following_error) > limits.following_error:
            error, limit = node.way(node.following_error), node.way(limits.following_error)
            return f"{node.name}: following error {error} is above {limit}."
        return ""

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
                self._beating = False  # a drive that goes on is to miss it
                restoration.finish(self)
                self.network.close()

    def in_full(self, text: str) -> str:
        """After the stop: a failure with the drives' own words."""
        return words.in_full(text, self.rival.text, self.said, self.stations.values())

    def lost(self, node: Node | ModuleNode) -> bool:
        """Whether its heartbeat is missing."""
        return self.network.now - node.heard_at > node.keys.heartbeat.lost_after

    def report(self) -> dict[str, Any]:
        """Statistics of the run."""
        nodes = {
            name: {
                "late_pdos": node.late,
                "lost_pdos": node.lost,
                "emergencies": [f"{c:04X}" for _, c in node.emergencies],
            }
            for name, node in self.stations.items()
        }
        return {**self.timing.summary(), "nodes": nodes, "restorations": [*self.recovered, *self.restorations]}
