"""The bus as a master uses it: frames out, frames in, and time that passes, simulated or not."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hw_bridge.bus.agenda import MILLISECOND, NEVER
from hw_bridge.bus.station import unconnected
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.bus.bus import Bus
    from hw_bridge.bus.frame import Frame

Condition = Callable[[], bool]
Hearing = Callable[[int, "Frame | None"], None]  # time [ns]; no frame: an error frame
LOOK = MILLISECOND // 4  # how often a condition is looked at in simulated time [ns]


def never() -> bool:
    """A condition that does not come true: wait for the time alone."""
    return False


@dataclass
class Spent:
    """Where the time of a master's program went [ns]; the rest of it is that of the loop, which is not the network's."""

    wait: int = 0
    send: int = 0
    receive: int = 0  # from the interface until there are frames
    decode: int = 0  # what the master, traces and shadows make of them

    def since(self, before: Spent, elapsed: int, cycles: int) -> dict[str, float]:
        """Of each cycle in a time [ns]: seconds for each of these, and for the loop."""
        parts = {name: value - getattr(before, name) for name, value in vars(self).items()}
        parts["loop"] = elapsed - sum(parts.values())
        return {name: value / 1e9 / max(cycles, 1) for name, value in parts.items()}


class Network(ABC):
    """What a master stands on. `now` [ns] counts from when the network was opened; `hear` gets every frame."""

    wall_clock: bool  # whether time passes by itself
    real_time = False  # whether this process goes before ordinary ones

    def __init__(self) -> None:
        self.hear: Callable[[Frame], None] = unconnected
        self.observers: list[Hearing] = []
        self.observer_errors: list[str] = []  # of observers that failed and hear nothing any more
        self.spent = Spent()

    def observe(self, observer: Hearing) -> None:
        """Tell an observer all frames, those that this program sends too; never while one is being sent."""
        self.observers.append(observer)

    def tell(self, time: int, frame: Frame | None) -> None:
        """Tell all observers a frame and its time [ns]. One that fails is left out from then on: it drives nothing."""
        for observer in tuple(self.observers):
            try:
                observer(time, frame)
            except Exception as error:
                self.observers.remove(observer)
                owner = type(getattr(observer, "__self__", observer)).__name__
                self.observer_errors.append(f"{owner}: {f'{error}'.rstrip('.')}. It observes the bus no longer.")

    def lock(self) -> bool:
        """Keep this program's memory where it is while it drives something on the bus; whether the system allows it."""
        return False

    @property
    @abstractmethod
    def now(self) -> int:
        """Time reached [ns]."""

    @abstractmethod
    def send(self, frame: Frame) -> None:
        """Hand a frame to the bus; SimulationError if it does not take any more."""

    @abstractmethod
    def advance(self, until: int, done: Condition = never) -> None:
        """Hear frames until a time [ns], or until a condition holds."""

    def send_at(self, frame: Frame, time: int) -> int:
        """Hear frames until a time, then hand a frame to the bus. When that was [ns]."""
        self.advance(time)
        now = self.now
        self.send(frame)
        return now

    @abstractmethod
    def close(self) -> None:
        """Leave the bus."""


class Terminal:
    """A master's station on the bus in simulated time."""

    def __init__(self) -> None:
        self.hear: Callable[[Frame], None] = unconnected
        self.send: Callable[[Frame], None] = unconnected
        self.disconnected = False

    def connect(self, send: Callable[[Frame], None]) -> None:
        """Frames go to `send` from now on."""
        self.send = send

    def next_time(self) -> int:
        """It wants nothing by itself."""
        return NEVER

    def advance(self, time: int) -> None:
        """Nothing is due."""

    def receive(self, frame: Frame) -> None:
        """A frame arrived."""
        self.hear(frame)

    def error_passive(self) -> None:
        """Many frames were destroyed; bus-off is what counts."""

    def bus_off(self) -> None:
        """The bus has disconnected this master."""
        self.disconnected = True

    def bus_on(self) -> None:
        """A master that was in bus-off has lost its drives: it stays away."""


class SimulatedNetwork(Network):
    """A place on the bus in simulated time, which goes on only when this master waits."""

    wall_clock = False

    def __init__(self, bus: Bus) -> None:
        super().__init__()
        self.bus = bus
        self.terminal = Terminal()
        self.terminal.hear = self._heard
        bus.attach(self.terminal)

    def observe(self, observer: Hearing) -> None:
        """The bus sees more than its stations: also what is lost or destroyed."""
        if not self.observers and not self.observer_errors:
            self.bus.observers.append(self.tell)
            self.bus.error_observers.append(lambda time: self.tell(time, None))
        super().observe(observer)

    def _heard(self, frame: Frame) -> None:
        self.hear(frame)

    @property
    def now(self) -> int:
        """Time of the bus."""
        return self.bus.now

    def send(self, frame: Frame) -> None:
        """Hand a frame to the bus."""
        if self.terminal.disconnected:
            raise SimulationError("bus: this program's node is in bus-off. Check bit rate, wiring and termination.")
        self.terminal.send(frame)

    def advance(self, until: int, done: Condition = never) -> None:
        """Let the bus go on."""
        if done is never:
            self.bus.advance(until)
            return
        while self.now < until and not done():
            self.bus.advance(min(self.now + LOOK, until))

    def close(self) -> None:
        """Pull the plug."""
        self.bus.detach(self.terminal)
