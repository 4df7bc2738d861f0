"""Dry run: the bus as in a run but without power (with --arm up to Switched on), then the scenario on simulated drives.

The simulated drives receive what the real ones would have received; `--trace` records it. Their only load is that of the
scenario; how a real drive follows only a run shows.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Any

from hw_bridge.bridge import announcement
from hw_bridge.bridge.hardware import Hardware
from hw_bridge.commission import SdoSession, axis, limits
from hw_bridge.dictionary import Mode, State
from hw_bridge.hardware import stall_bounds
from hw_bridge.master import Master
from hw_bridge.plant import bench_network
from hw_bridge.profiles import acting
from hw_bridge.session import Observers
from hw_bridge.trace import Watch
from twin.errors import ScenarioError, SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from hw_bridge.bus import Network, Observer
    from hw_bridge.hardware import HardwareKeys, NodeKeys
    from hw_bridge.master import Node
    from twin.component import Component
    from twin.scenario import ScenarioSpec

CYCLES = 200  # without power: a second at 5 ms
TARGET_OF_MODE = {Mode.CSP: "target_position", Mode.CSV: "target_velocity", Mode.CST: "target_force"}
ON = 2_000_000_000  # longest time to Switched on [ns]


def rehearse(
    keys: HardwareKeys,
    network: Network,
    rotary: Mapping[str, bool],
    armed: bool = True,
    writes: list[str] | None = None,
) -> list[str]:
    """Everything but power: identity, limits, parameters, process data both ways; armed, Switched on; then down again.

    Returns the results. `rotary`: which members turn. `writes`: receives a line for each written object, and whether all
    were restored.
    """
    writes = [] if writes is None else writes
    line = SdoSession(network, keys.nodes)
    master = Master(keys, network)
    master.armed = armed
    try:
        results = without_power(line, master, rotary, armed, writes)
    except SimulationError as error:
        master.stop()
        raise SimulationError([master.describe_failure(str(error)), *master.notes]) from error
    finally:
        master.stop()
    writes += [*master.recovered, *master.restorations]
    return [*results, *master.notes]


def without_power(
    line: SdoSession, master: Master, rotary: Mapping[str, bool], armed: bool, writes: list[str]
) -> list[str]:
    """Bring the drives up to Switched on if armed, else with the power stage off; return the results."""
    keys, network = master.keys, master.network
    if problems := master.identify():
        raise SimulationError(problems)
    wide, mirrors = [], {}
    for name in keys.nodes:
        drive = line.drive(name)
        drive.rotary, mirrors[name] = rotary[name], drive.mirror
        wide += list(limits.wider(drive, limits.compare(drive)))
    if absurd := [text for text, is_absurd in wide if is_absurd]:
        raise SimulationError(absurd)
    writes += announcement.lines(master)
    master.prepare()
    goal = State.SWITCHED_ON if armed else State.DISABLED
    for node in master.nodes.values():
        node.goal = goal
    end = network.now + ON
    while network.now < end and any(drive.state is not goal for drive in master.nodes.values()):
        master.run_cycle()
    states = {name: f"{node.state}, no power" for name, node in master.nodes.items()}
    for station in master.stations.values():
        station.forget()
    for _ in range(CYCLES):
        synced = master.exchange()
        master.timing.synced(synced, synced)
        master.wait(keys.cycle)
    if problems := [*master.faults(), *filter(None, [master.foreign_master.text])]:
        raise SimulationError(problems)
    results = [
        f"{name}: {states.get(name, 'outputs safe')}; {item.lost} of {CYCLES} process data lost"
        for name, item in master.stations.items()
    ]
    return [*results, *(text for text, _ in wide), *stall_bounds.bounds(keys, rotary, mirrors)]


@dataclass
class Extremes:
    """Extreme targets and actual values of one drive, relative to its limits. Read-only."""

    node: Node
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    modes: set[str] = field(default_factory=set)
    warnings: list[str] = field(default_factory=list)

    def update_load(self) -> None:
        """No-op: no load is applied."""

    def look(self, _t: int) -> None:
        """Record targets and actual values of this cycle."""
        node = self.node
        self.modes.add(node.own_mode.name.lower())
        values = {
            "position": node.position,
            "velocity": node.velocity,
            "force": node.force,
            "following_error": node.following_error,
        }
        target = TARGET_OF_MODE[node.mode]
        values[target] = getattr(node, target)
        for name, value in values.items():
            low, high = self.ranges.get(name, (inf, -inf))
            self.ranges[name] = min(low, value), max(high, value)
        self.warnings[:] = [self.line()]

    def line(self) -> str:
        """Format everything relative to its limit: `velocity 50.00 of 300.00 mm/s (17 %)`."""
        limits, to_text = self.node.keys.limits, self.node.format_length
        low, high = self.ranges["position"]
        newton = "N m" if self.node.rotary else "N"
        parts = [
            f"{name} {_amount(name, least, to_text, newton)} to {_amount(name, most, to_text, newton)}"
            for name, (least, most) in self.ranges.items()
            if name.startswith("target")
        ]
        parts.append(
            f"position {to_text(low)} to {to_text(high)} of {to_text(limits.position[0])} to {to_text(limits.position[1])}"
        )
        for name, limit, suffix in (
            ("velocity", limits.velocity, "/s"),
            ("following_error", limits.following_error, ""),
        ):
            most = max(map(abs, self.ranges[name]))
            parts.append(f"{name} {to_text(most)}{suffix} of {to_text(limit)}{suffix} ({100 * most / limit:.0f} %)")
        most = max(map(abs, self.ranges["force"]))
        parts.append(f"force {most:.2f} of {limits.force:g} {newton} ({100 * most / limits.force:.0f} %)")
        return f"{self.node.name} in {', '.join(sorted(self.modes))}: {', '.join(parts)}."

    def report(self) -> dict[str, Any]:
        """Smallest and largest values, in SI."""
        return {name: list(ends) for name, ends in self.ranges.items()}


def _amount(name: str, value: float, to_text: Callable[[float], str], newton: str) -> str:
    """Format a target with its unit."""
    return f"{value:.2f} {newton}" if name == "target_force" else to_text(value) + "/s" * (name == "target_velocity")


def switching(keys: HardwareKeys) -> list[str]:
    """Drives and modules whose outputs are written by a set-up, also by objects of the vendor that no profile has."""
    nodes = [name for name, node in keys.nodes.items() if node.safe_outputs is not None or _unknown_objects(node)]
    return [*nodes, *keys.modules]


def _unknown_objects(node: NodeKeys) -> list[tuple[int, int]]:
    return [(index, sub) for index, sub in node.objects if acting.switches(node.drive, index, sub)]


def extremes(
    _keys: HardwareKeys, _network: Network, _axes: Mapping[str, Component], nodes: Mapping[str, Node], _build: Path
) -> Mapping[str, Observer]:
    """Create an observer for each drive."""
    return {name: Extremes(node) for name, node in nodes.items()}


class DryHardware(Hardware):
    """The drives of a hardware file without power, and simulated ones that receive their targets."""

    observer_factories = Observers(Watch, extremes)

    def __init__(self, path: Path, keys: HardwareKeys, build: Path, trace: Path | None, arm: bool = False) -> None:
        super().__init__(path, keys.model_copy(update={"simulated": True}), False, build, trace)
        self.real = keys
        self.armed = arm or keys.is_software()
        self.rehearsal_results: list[str] = []
        self.writes: list[str] = []

    def apply(self, scenario: ScenarioSpec) -> ScenarioSpec:
        """Return the scenario on simulated drives, if the bus could be brought up without power."""
        if not self.armed and (names := switching(self.real)):
            raise ScenarioError(
                f"{self.path}: a dry run sets the outputs of {', '.join(names)} to their safe levels, or writes objects that no profile "
                f"has: valves and brakes may switch. Add --arm if nobody is in their way."
            )
        applied = super().apply(scenario)
        self.rehearsal_results = rehearse(
            self.real,
            bench_network(self.real, self.build),
            {name: axis(self.path, self.real, name).rotary for name in self.real.nodes},
            armed=self.armed,
            writes=self.writes,
        )
        return applied

    def report(self) -> dict[str, Any]:
        """Data of a run for its summary, which say that no drive has moved."""
        return {**super().report(), "dry_run": True}

    def notes(self) -> list[str]:
        """Results without power, then what would have been sent."""
        bus = "simulated bus" if self.real.simulated else f"{self.real.interface} {self.real.channel}"
        return [
            *(f"dry run on {bus}, power never on: {line.rstrip('.')}." for line in self.rehearsal_results),
            *(f"would have been sent: {note}" for note in super().notes()),
            *(f"dry run, {write.strip().rstrip('.:')}." for write in self.writes),
        ]
