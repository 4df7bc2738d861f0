"""Session with one drive: enabled by the master, moved by an operator's set-points, stopped by the master's stop path.

While it is enabled this program sends SYNC and heartbeat: if it hangs or is killed, the missing heartbeat stops the drive.
"""

from __future__ import annotations

import signal
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

from hw_bridge.commission.ramp import Ramp
from hw_bridge.dictionary import Mode, cia402
from hw_bridge.master import LateCyclePolicy, Master, setup
from twin.errors import SimulationError
from twin.process import once

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from hw_bridge.bus import Network
    from hw_bridge.hardware import HardwareKeys, NodeKeys

SETTLE = 200_000_000  # after a move, until the place is read [ns]
IN_DRIVE = "in the drive"  # of positions before they count from start or reference
SLOWEST_STOP = 0.06  # longest ramp from the speed of a jog to rest [s]; with the key's 0.12 s it stands within 0.2 s


class Sample(NamedTuple):
    """One cycle: time [s], target and actual position [m or rad], current [A]."""

    time: float
    target: float
    position: float
    current: float


def restrict_to_node(keys: HardwareKeys, name: str, homes: bool = False) -> HardwareKeys:
    """Restrict the hardware file to this drive; it homes only if `homes`."""
    node = keys.nodes[name]
    node = node if homes else node.model_copy(update={"homing": None})
    return keys.model_copy(update={"nodes": {name: node}, "modules": {}, "faults": []})


class Operator(Master):
    """A master that calls `attend` in every cycle, also while it homes, to check that an operator is present.

    `before_power` is called once, when the drive has process data and nothing refuses the motion any more.
    """

    attend: Callable[[], None] | None = None
    before_power: Callable[[], None] | None = None

    def prepare(self) -> None:
        """From any state to process data in both directions; no power."""
        super().prepare()
        if self.before_power is not None:
            self.before_power()

    def run_cycle(self) -> None:
        """One cycle while the drive is brought up or stopped."""
        super().run_cycle()
        if self.attend is not None and self.running:
            self.attend()


class SingleAxisSession:
    """One drive in Operation enabled. Positions count from its start, or from its reference if it is `homed`."""

    def __init__(
        self, keys: HardwareKeys, name: str, network: Network, rotary: bool = False, forced: bool = False
    ) -> None:
        self.master = Operator(keys, network, frozenset((name,) if forced else ()))
        self.network, self.node = network, self.master.nodes[name]
        self.node.rotary = rotary
        self.cycle = keys.cycle
        self.late_cycle_policy = LateCyclePolicy(keys)
        self.h = keys.cycle / 1e9
        self.samples: list[Sample] = []
        self.due = 0
        self.paced = False  # whether a bus in simulated time keeps to the wall clock, for a person's keys
        self.ramp = Ramp(0.0, 1.0, 1.0)
        self.next_line = 0  # when live values are shown again [ns]
        self._origin = IN_DRIVE
        self._has_searched = False
        self._before: tuple[int, float, float] | None = None  # time, position and origin of the last mean velocity
        self.note = ""  # what the operator must know now, such as a limit; shown behind the live values

    @property
    def keys(self) -> NodeKeys:
        """Keys of the drive in the hardware file."""
        return self.node.keys

    @property
    def origin(self) -> str:
        """What positions count from: start or reference, once it is enabled or homed."""
        return "from reference" if self.keys.homing is not None and self.node.has_reference else self._origin

    def counts_anew(self) -> bool:
        """Whether a drive that homes has set its position to 0, and this program does not count from there yet."""
        node = self.node
        self._has_searched |= node.homing
        has_attained = not node.homing or bool(node.word & cia402.BIT_12)
        return self._has_searched and not node.has_reference and has_attained

    @contextmanager
    def enabled(self, start: float = 0.0, homed: NodeKeys | None = None) -> Iterator[SingleAxisSession]:
        """Enable the drive; the master stops it at the end in every case."""
        has_failed = False
        with hangup_as_interrupt():
            try:
                self.master.begin({self.node.name: start})
                is_referenced = homed is not None or self.keys.homing is not None
                self._origin = "from reference" if is_referenced else "from start"
                if homed is not None:
                    self._count_from_reference(homed)
                limits = self.keys.limits
                self.ramp = Ramp(self.node.position, limits.acceleration, limits.acceleration)
                self.due = self.network.now
                yield self
            except SimulationError as error:
                has_failed = True
                self.master.stop()
                raise SimulationError(self.master.describe_failure(str(error))) from error
            finally:
                self.master.stop()
                if not has_failed:  # else the failure names them
                    self.master.notes += self.master.fault_texts

    def _count_from_reference(self, keys: NodeKeys) -> None:
        """Use the reference of a drive that was homed before."""
        node = self.node
        node.origin = -keys.homing.at if keys.homing is not None else 0.0
        node.target_position = node.position
        node.entered_from = node.position  # it may come back from outside of the limits
        low, high = node.keys.limits.position
        if low <= node.position <= high:  # else the drive's own software limits would pull it in with a jump
            setup.limit_positions(node)

    def mean_velocity(self) -> float:
        """Mean velocity since the last call [m/s or rad/s]: positions resolve slow motion that 606Ch rounds.

        606Ch at the first call, and where homing has moved the origin.
        """
        node, now = self.node, self.network.now
        before, self._before = self._before, (now, node.position, node.origin)
        if before is None or now <= before[0] or node.origin != before[2]:
            return node.velocity
        return 1e9 * (node.position - before[1]) / (now - before[0])

    def go(self, position: float) -> None:
        """Run one cycle with this target position."""
        self.node.mode = Mode.CSP
        self.node.set_target(position, self.cycle)
        self._pass()

    def push(self, force: float) -> None:
        """Run one cycle with this target force."""
        self.node.mode, self.node.target_force = Mode.CST, force
        self.node.clear_target()
        self._pass()

    def _pass(self) -> None:
        """Check, exchange, and wait for the next cycle. A late cycle is not caught up with; `late_cycle` may end it."""
        node = self.node
        self.late_cycle_policy.check(self.network.now - self.due, self.network.now)
        if problem := self.master.check():
            raise SimulationError(f"{problem} It stops.")
        if self.master.attend is not None:
            self.master.attend()
        self.master.exchange()
        self.due = max(self.due + self.cycle, self.network.now)
        if not self.network.wall_clock and self.paced:
            time.sleep(self.h)
        self.master.wait_until(self.due)
        self.samples.append(Sample(self.network.now / 1e9, node.target_position, node.position, node.current))

    def move(self, goal: float, speed: float, acceleration: float) -> float:
        """Move with a ramp and rest; return the final position."""
        self.ramp = Ramp(self.node.target_position, acceleration, acceleration)
        while self.ramp.position != goal:
            self.go(self.ramp.approach(goal, speed, self.h))
        self.rest(SETTLE)
        return self.node.position

    def rest(self, duration: int) -> None:
        """Hold the target position."""
        end = self.network.now + duration
        while self.network.now < end:
            self.go(self.node.target_position)


@contextmanager
def hangup_as_interrupt() -> Iterator[None]:
    """Treat SIGHUP as Ctrl-C, so that a closed terminal stops the drive. A terminal and its shell send several: only the first
    one interrupts, because another one would interrupt the stop.
    """
    if not hasattr(signal, "SIGHUP") or threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGHUP, once)
    try:
        yield
    finally:
        if signal.getsignal(signal.SIGHUP) is once:  # else it has come, and further ones stay ignored
            signal.signal(signal.SIGHUP, before)


def check_bounded(value: float, limit: float, what: str, source: str, to_text: Callable[[float], str]) -> float:
    """Check a quantity against a limit of the hardware file, `source`; SimulationError with both numbers."""
    if not 0.0 < value <= limit:
        raise SimulationError(
            f"{what} {to_text(value)}: must be above 0 and at most {to_text(limit)}, {source} of the hardware file."
        )
    return value
