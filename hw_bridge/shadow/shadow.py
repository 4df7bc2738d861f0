"""Shadow: a simulated drive that receives the real drive's frames; residuals indicate a faulty part.

The twin of a drive receives the same frames at the same times, and the load known to the scenario. Residuals are the
drive's values minus its twin's, in the member's direction and scale, sampled at the same SYNC.
"""

from __future__ import annotations

from collections import deque
from math import copysign
from typing import TYPE_CHECKING, Any

from hw_bridge.bus import unconnected
from hw_bridge.dictionary import cia301
from hw_bridge.plant import Plant, start_position
from hw_bridge.profiles import member_load
from hw_bridge.shadow.symptoms import SYMPTOMS, Figures, Sample, Symptom, figures_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from hw_bridge.bus import Frame, Network
    from hw_bridge.device import Drive
    from hw_bridge.hardware import HardwareKeys, NodeKeys, ShadowKeys
    from hw_bridge.master import Node
    from twin.component import Component


class Shadow:
    """One drive and its twin. `look` is called once per cycle; a lasting symptom is reported once."""

    def __init__(
        self,
        axis: Component,
        keys: NodeKeys,
        bands: ShadowKeys,
        node: Node,
        network: Network,
        position: float,
        master: int,
        cycle: int,
        build: Path,
    ) -> None:
        self.axis, self.node, self.bands, self.cycle, self.network = axis, node, bands, cycle / 1e9, network
        self.plant = Plant(axis, keys, position, build)
        self.plant.drive.connect(unconnected)
        number = keys.node
        self.mine = {cia301.NMT, cia301.SYNC, cia301.SDO_REQUEST + number, cia301.ERROR_CONTROL + master} | {
            base + number for base in range(0x200, 0x600, 0x100)
        }
        self.raw = (0, 0, 0)  # position, velocity, current of the twin at the last SYNC [device units]
        self.samples: deque[Sample] = deque(maxlen=max(2, round(bands.window / cycle)))
        self.warnings: list[str] = []
        self.largest = {"position": 0.0, "velocity": 0.0, "current": 0.0}
        self._reported: dict[str, int] = {}  # reported parts, and when they were last detected [ns]
        self._symptom: Symptom | None = None  # current symptom, and its begin [ns]
        self._since = 0
        self._zero: float | None = None
        self._missed = self._gap = False
        network.observe(self.hear)

    def hear(self, time: int, frame: Frame | None) -> None:
        """Pass frames for the drive to its twin."""
        if frame is None or frame.id not in self.mine:
            return
        drive = self._advance(time)
        if frame.id == cia301.SYNC:
            word, get = self.node.process_data.current, drive.dictionary.get
            self.raw = (get(0x6064), get(0x606C), get(word >> 16, word >> 8 & 0xFF))
        drive.receive(frame)

    def _advance(self, time: int) -> Drive:
        """Advance the twin to a time [ns]."""
        drive = self.plant.drive
        drive.advance(max(time, drive.port.event_queue.now))
        return drive

    def update_load(self) -> None:
        """Apply the load known to the scenario to the twin from now on."""
        self._advance(self.network.now)
        self.plant.update_load()

    def look(self, t: int) -> None:
        """Compare the process data since the last SYNC with the twin's; t [ns] is the scenario's."""
        node, (position, velocity, current) = self.node, self.raw
        stale, self._missed = self._missed and node.answered < 2, node.answered == 0
        if self._missed or stale:  # process data that came late belong to an earlier SYNC
            self._gap = True
            return
        direction = copysign(1.0, node.sign)
        difference = node.sign * node.units.position * (node.raw_position - position)
        if self._zero is None:  # both may have begun anywhere
            self._zero = difference
        load = member_load(self.axis.views) or 0.0
        sample = Sample(
            difference - self._zero,
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
        """Report a symptom that has lasted for a window: other ones appear during the transition."""
        figures = figures_of(list(self.samples), self.bands, self.cycle)
        symptom = next((candidate for candidate in SYMPTOMS if candidate.shows(figures)), None)
        if symptom is not self._symptom:
            self._symptom, self._since = symptom, t
        if symptom is None:
            return
        last_report = self._reported.get(symptom.part)
        if last_report is not None and t - last_report <= self.bands.window:
            self._reported[symptom.part] = t
        elif symptom.at_once or t - self._since >= self.bands.window:
            self._reported[symptom.part] = t
            self.warnings.append(
                f"{self.node.name}: at {t / 1e9:.3f} s {symptom.text} ({self._shown(figures)}). Look at {symptom.part}."
            )

    @staticmethod
    def _shown(figures: Figures) -> str:
        named = {name: value for name, value in figures._asdict().items() if abs(value) > 1}
        return ", ".join(f"{name} {value:.1f}" for name, value in named.items()) + " of the band"

    def report(self) -> dict[str, Any]:
        """Residuals in SI: of the last SYNC that could be compared, their bands, the largest; and warnings."""
        last = self.samples[-1] if self.samples else None
        return {
            "now": {name: getattr(last, name, None) for name in self.largest},
            "bands": {name: getattr(self.bands, name) for name in self.largest},
            "largest": self.largest,
            "warnings": self.warnings,
        }


def shadows(
    keys: HardwareKeys, network: Network, axes: Mapping[str, Component], nodes: Mapping[str, Node], build: Path
) -> dict[str, Shadow]:
    """Shadows of a hardware file, by drive."""
    return {
        name: Shadow(
            axes[name],
            node,
            node.shadow,
            nodes[name],
            network,
            start_position(axes[name]),
            keys.master,
            keys.cycle,
            build,
        )
        for name, node in keys.nodes.items()
        if node.shadow is not None
    }
