"""The bus on a master's side: frames out, frames in, and time that passes, simulated or not."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hw_bridge.bus.event_queue import MILLISECOND
from hw_bridge.bus.station import PassiveStation, unconnected
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.bus.bus import Bus
    from hw_bridge.bus.frame import Frame

Condition = Callable[[], bool]
Hearing = Callable[[int, "Frame | None"], None]  # time [ns]; no frame: an error frame
LOOK = MILLISECOND // 4  # how often a condition is looked at in simulated time [ns]


def never() -> bool:
    """Condition that never becomes true: wait for the time alone."""
    return False


@dataclass
class CycleTimeBudget:
    """Time budget of a master's program [ns]; the rest is the loop's, outside of the network."""

    wait: int = 0
    send: int = 0
    receive: int = 0  # from the interface until there are frames
    decode: int = 0  # what the master, traces and shadows make of them

    def since(self, before: CycleTimeBudget, elapsed: int, cycles: int) -> dict[str, float]:
        """Mean time per cycle since `before` [s], for each part and the loop; `elapsed` [ns]."""
        parts = {name: value - getattr(before, name) for name, value in vars(self).items()}
        parts["loop"] = elapsed - sum(parts.values())
        return {name: value / 1e9 / max(cycles, 1) for name, value in parts.items()}


class Network(ABC):
    """A master's access to a bus. `now` [ns] counts from when the network was opened; `hear` receives every frame."""

    wall_clock: bool  # whether time passes by itself
    real_time = False  # whether this process goes before ordinary ones

    def __init__(self) -> None:
        self.hear: Callable[[Frame], None] = unconnected
        self.observers: list[Hearing] = []
        self.observer_errors: list[str] = []  # of observers that failed and were removed
        self.time_budget = CycleTimeBudget()

    def observe(self, observer: Hearing) -> None:
        """Add an observer of all frames, those of this program too; never called while one is being sent."""
        self.observers.append(observer)

    def notify(self, time: int, frame: Frame | None) -> None:
        """Notify all observers of a frame and its time [ns]. One that fails is removed: it drives nothing."""
        for observer in tuple(self.observers):
            try:
                observer(time, frame)
            except Exception as error:
                self.observers.remove(observer)
                owner = type(getattr(observer, "__self__", observer)).__name__
                self.observer_errors.append(f"{owner}: {f'{error}'.rstrip('.')}. It observes the bus no longer.")

    def lock(self) -> bool:
        """Lock this program's memory while it drives something on the bus; return whether the system allows it."""
        return False

    @property
    @abstractmethod
    def now(self) -> int:
        """Time reached [ns]."""

    @abstractmethod
    def send(self, frame: Frame) -> None:
        """Send a frame; SimulationError if the bus takes no more."""

    @abstractmethod
    def advance(self, until: int, done: Condition = never) -> None:
        """Receive frames until a time [ns], or until a condition holds."""

    def send_at(self, frame: Frame, time: int) -> int:
        """Receive frames until a time, then send a frame; return the time of sending [ns]."""
        self.advance(time)
        now = self.now
        self.send(frame)
        return now

    @abstractmethod
    def close(self) -> None:
        """Leave the bus."""


class MasterPort(PassiveStation):
    """A master's station on the bus in simulated time. One that was in bus-off has lost its drives, and stays disconnected."""

    def __init__(self) -> None:
        super().__init__()
        self.hear: Callable[[Frame], None] = unconnected
        self.disconnected = False

    def receive(self, frame: Frame) -> None:
        """Receive a frame."""
        self.hear(frame)

    def bus_off(self) -> None:
        """Disconnect this master."""
        self.disconnected = True


class SimulatedNetwork(Network):
    """Access to a bus in simulated time, which advances only while this master waits."""

    wall_clock = False

    def __init__(self, bus: Bus) -> None:
        super().__init__()
        self.bus = bus
        self.port = MasterPort()
        self.port.hear = self._on_frame
        bus.attach(self.port)

    def observe(self, observer: Hearing) -> None:
        """Observe the bus itself: also lost and destroyed frames."""
        if not self.observers and not self.observer_errors:
            self.bus.observers.append(self.notify)
            self.bus.error_observers.append(lambda time: self.notify(time, None))
        super().observe(observer)

    def _on_frame(self, frame: Frame) -> None:
        self.hear(frame)

    @property
    def now(self) -> int:
        """Time of the bus."""
        return self.bus.now

    def send(self, frame: Frame) -> None:
        """Hand a frame to the bus."""
        if self.port.disconnected:
            raise SimulationError("bus: this program's node is in bus-off. Check bit rate, wiring and termination.")
        self.port.send(frame)

    def advance(self, until: int, done: Condition = never) -> None:
        """Advance the bus."""
        if done is never:
            self.bus.advance(until)
            return
        while self.now < until and not done():
            self.bus.advance(min(self.now + LOOK, until))

    def close(self) -> None:
        """Detach from the bus."""
        self.bus.detach(self.port)
