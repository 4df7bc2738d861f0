"""Shadow: a simulated drive hears all that the real one is told, and what they do differently points at a part.

The twin of a drive gets the same frames at the same times, and the load that the scenario knows. Residuals are the
drive's values minus its twin's, in the member's direction and scale, sampled at the same SYNC.
"""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from math import copysign
from typing import TYPE_CHECKING, Any, NamedTuple

from hw_bridge.plant import Plant
from hw_bridge.slave.port import unconnected

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from hw_bridge.drive.drive import Drive
    from hw_bridge.frame import Frame
    from hw_bridge.keys import NodeKeys, ShadowKeys
    from hw_bridge.master.network import Network
    from hw_bridge.master.node import Node
    from twin.component import Component

SYNC, ERROR_CONTROL = 0x080, 0x700
FEW = 0.1  # share of a window that has to be in one direction to say anything about it


class Sample(NamedTuple):
    """Residuals of one cycle, with the twin's speed and the load on it."""

    position: float  # [m or rad]
    velocity: float  # [m/s or rad/s]
    current: float  # [A]
    speed: float
    load: float  # [N or N*m]
    gap: bool  # whether samples before it are missing


class Figures(NamedTuple):
    """Of a window of samples, over its band each: 1 is the limit."""

    jump: float  # largest step of the position residual that the speed does not explain
    way: float  # position residual now minus that at its beginning
    lag: float  # mean of the velocity residual, positive: slower than the twin
    ahead: float  # mean current residual while moving to positive positions
    back: float  # the same to negative positions
    both: bool  # whether it moved both ways
    relieved: float  # mean current residual in the direction of the load, positive: as if it were gone
    by_load: bool  # whether the load explains the current residual better than the direction of motion


class Symptom(NamedTuple):
    """A row of the table: what is seen, and which part it speaks for. The first that fits counts."""

    shows: Callable[[Figures], bool]
    seen: str
    part: str
    at_once: bool = False  # without waiting for a window in which nothing else is seen


SYMPTOMS = (
    Symptom(lambda f: f.jump > 1, "position jumps, velocity does not",
            "the encoder, its scale or its mounting", at_once=True),
    Symptom(lambda f: f.lag > 1 and max(f.ahead, -f.back) > 1, "slower than its twin, with more current",
            "something holds it: a collision, a jam, a guide"),
    Symptom(lambda f: f.lag > 1, "slower than its twin, without more current",
            "the drive: gains, current or speed limit, supply"),
    Symptom(lambda f: f.relieved > 1 and f.by_load, "current as if the load were gone",
            "the grip: sleeve slipping, or air low"),
    Symptom(lambda f: f.both and f.ahead > 1 and f.back < -1, "more current, with the sign of the velocity",
            "friction: guide rail, bearings, sleeve bearing"),
    Symptom(lambda f: f.both and f.ahead < -1 and f.back > 1, "less current, against the sign of the velocity",
            "friction has fallen: a guide or seal is worn or loose"),
    Symptom(lambda f: max(abs(f.ahead), abs(f.back)) > 1, "more current to one side",
            "the load: a force that the twin does not know, or friction"),
    Symptom(lambda f: abs(f.way) > 1, "goes another way than its twin",
            "scaling, or steps that are lost"),
)  # fmt: skip


class Shadow:
    """One drive and its twin. `look` once per cycle; a symptom that stays is told once."""

    def __init__(
        self, axis: Component, keys: NodeKeys, bands: ShadowKeys, node: Node, network: Network, position: float,
        master: int, cycle: int, build: Path,
    ) -> None:  # fmt: skip
        self.axis, self.node, self.bands, self.cycle, self.network = axis, node, bands, cycle / 1e9, network
        self.plant = Plant(axis, keys, position, build)
        self.plant.drive.connect(unconnected)
        number = keys.node
        self.mine = {0, SYNC, 0x600 + number, ERROR_CONTROL + master} | {
            base + number for base in range(0x200, 0x600, 0x100)
        }
        self.raw = (0, 0, 0)  # position, velocity, current of the twin at the last SYNC [device units]
        self.samples: deque[Sample] = deque(maxlen=max(2, round(bands.window / cycle)))
        self.warnings: list[str] = []
        self.largest = {"position": 0.0, "velocity": 0.0, "current": 0.0}
        self._told: dict[str, int] = {}  # parts that were told, and when they were last seen [ns]
        self._symptom: Symptom | None = None  # what is seen, and since when [ns]
        self._since = 0
        self._zero: float | None = None
        self._missed = self._gap = False
        network.observe(self.hear)

    def hear(self, time: int, frame: Frame | None) -> None:
        """A frame of the bus; those to the drive are for its twin too."""
        if frame is None or frame.id not in self.mine:
            return
        drive = self._advance(time)
        if frame.id == SYNC:
            word, get = self.node.vendor.current, drive.dictionary.get
            self.raw = (get(0x6064), get(0x606C), get(word >> 16, word >> 8 & 0xFF))
        drive.receive(frame)

    def _advance(self, time: int) -> Drive:
        """The twin at a time [ns]."""
        drive = self.plant.drive
        drive.advance(max(time, drive.port.agenda.now))
        return drive

    def feel(self) -> None:
        """The twin feels what the scenario knows of the load, from now on."""
        self._advance(self.network.now)
        self.plant.feel()

    def look(self, t: int) -> None:
        """Compare what the drive said since the last SYNC; t [ns] is the scenario's."""
        node, (position, velocity, current) = self.node, self.raw
        stale, self._missed = self._missed and node.answered < 2, node.answered == 0
        if self._missed or stale:  # process data that came late belong to an earlier SYNC
            self._gap = True
            return
        direction = copysign(1.0, node.sign)
        way = node.sign * node.units.position * (node.raw_position - position)
        if self._zero is None:  # both may have begun anywhere
            self._zero = way
        views = self.axis.views
        load = next((float(views[name]) for name in ("load_force", "load_torque") if name in views), 0.0)
        sample = Sample(
            way - self._zero,
            node.sign * node.units.velocity * (node.raw_velocity - velocity),
            direction * node.ampere * (node.raw_current - current),
            node.sign * node.units.velocity * velocity,
            load,
            self._gap,
        )
        self._gap = False
        self.samples.append(sample)
        for name in self.largest:
            self.largest[name] = max(self.largest[name], abs(getattr(sample, name)))
        if len(self.samples) == self.samples.maxlen:
            self._judge(t)

    def _judge(self, t: int) -> None:
        """A symptom counts once it has lasted for a window: on the way there others are seen."""
        figures = self.figures()
        symptom = next((one for one in SYMPTOMS if one.shows(figures)), None)
        if symptom is not self._symptom:
            self._symptom, self._since = symptom, t
        if symptom is None:
            return
        known = self._told.get(symptom.part)
        if known is not None and t - known <= self.bands.window:
            self._told[symptom.part] = t
        elif symptom.at_once or t - self._since >= self.bands.window:
            self._told[symptom.part] = t
            self.warnings.append(
                f"{self.node.name}: at {t / 1e9:.3f} s {symptom.seen} ({self._shown(figures)}). Look at {symptom.part}."
            )

    def figures(self) -> Figures:
        """What the window shows."""
        kept, bands = list(self.samples), self.bands
        jump = max(abs(b.position - a.position - b.velocity * self.cycle) for a, b in pairwise(kept))
        moving = [one for one in kept if abs(one.speed) > bands.moving]
        ahead = [one.current for one in moving if one.speed > 0.0]
        back = [one.current for one in moving if one.speed < 0.0]
        enough = FEW * len(kept)
        current = [one.current for one in kept]
        load = [one.load for one in kept]
        return Figures(
            jump / bands.position,
            (kept[-1].position - kept[0].position) / bands.position,
            -mean([one.velocity * copysign(1.0, one.speed) for one in moving]) / bands.velocity,
            (mean(ahead) if len(ahead) > enough else 0.0) / bands.current,
            (mean(back) if len(back) > enough else 0.0) / bands.current,
            min(len(ahead), len(back)) > enough,
            mean([one * copysign(1.0, force) for one, force in zip(current, load, strict=True) if force])
            / bands.current,
            explained(current, load) > explained(current, [self._direction(one.speed) for one in kept]),
        )

    def _direction(self, speed: float) -> float:
        return copysign(1.0, speed) if abs(speed) > self.bands.moving else 0.0

    @staticmethod
    def _shown(figures: Figures) -> str:
        named = {name: value for name, value in figures._asdict().items() if abs(value) > 1}
        return ", ".join(f"{name} {value:.1f}" for name, value in named.items()) + " of the band"

    def report(self) -> dict[str, Any]:
        """Largest residuals in SI, and warnings."""
        return {"largest": self.largest, "warnings": self.warnings}


def mean(values: list[float]) -> float:
    """The mean; 0 of nothing."""
    return sum(values) / len(values) if values else 0.0


def explained(values: list[float], cause: list[float]) -> float:
    """Share of the squares of `values` that a multiple of `cause` accounts for."""
    product = sum(one * other for one, other in zip(values, cause, strict=True))
    squares = sum(one * one for one in values) * sum(one * one for one in cause)
    return product * product / squares if squares else 0.0
