"""Bus of a run: simulated drives and modules with the scenario's loads in simulated time, or an interface to real ones."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from hw_bridge.bus import Bus, SimulatedNetwork
from hw_bridge.device import Drive, Module, Motor
from hw_bridge.plant.plant import Plant, start_position, store_motor_parameters
from hw_bridge.profiles import device, motor_parameters

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from hw_bridge.bus import Network, Override
    from hw_bridge.hardware import HardwareKeys
    from twin.component import Component

GLANCE = 10_000_000  # time over which motion is detected [ns]
AFTERMATH = 500_000_000  # how long a simulated bench is observed after a stop on a failure [ns]


def wire(keys: HardwareKeys) -> Network:
    """A python-can interface."""
    from hw_bridge.wire import WireNetwork

    return WireNetwork(keys.interface, keys.channel, keys.bit_rate, keys.options)


def bench_network(keys: HardwareKeys, build: Path) -> Network:
    """Open the bus of a bench without a scenario; simulated drives have no load."""
    if not keys.simulated:
        return wire(keys)
    bus = Bus(keys.bit_rate)
    for node in keys.nodes.values():
        vendor = node.drive
        motor = motor_parameters(vendor, node.motor)
        bus.attach(store_motor_parameters(Drive(vendor, node.node, Motor(motor.model, build=build)), motor))
    for module in keys.modules.values():
        bus.attach(Module(device(module.profile), module.node))
    return SimulatedNetwork(bus)


def set_up(keys: HardwareKeys, axes: Mapping[str, Component], build: Path) -> Bench:
    """Open the bench of a hardware file, whose drives replace these members."""
    return SimulatedBench(keys, axes, build) if keys.simulated else Bench(wire(keys))


class Bench:
    """The drives and modules of a case on a bus, as a master uses it: what is known of real ones, or of other processes."""

    def __init__(self, network: Network) -> None:
        self.network = network

    def update_load(self) -> None:
        """Apply the loads and parameters of the members from now on; real loads act by themselves."""

    def zero(self, positions: Mapping[str, float]) -> None:
        """Set the measured positions [m or rad], where true ones are known."""

    def plan(self, overrides: Sequence[Override], origin: int) -> None:
        """Schedule overrides at their times, where faults can be injected; `origin` [ns] is the scenario's zero."""

    def acted(self, overrides: Sequence[Override], origin: int) -> list[Override]:  # noqa: ARG002 - none was planned
        """Overrides whose time has come."""
        return []

    def shown(self, name: str) -> dict[str, Callable[[], float]]:  # noqa: ARG002 - the same for all
        """Values of a drive beyond its actual values, by names of outputs."""
        return {}

    def faults_at_rest(self, failed: bool, unconfirmed: Sequence[str]) -> list[str]:  # noqa: ARG002 - nothing more is known
        """Return what is not at rest after the stop. `unconfirmed`: what the master could not confirm."""
        return list(unconfirmed)

    def report(self) -> dict[str, Any]:
        """Figures of the bus, where it has any."""
        return {}


class SimulatedBench(Bench):
    """Drives, modules and their bus are part of the run, in simulated time."""

    def __init__(self, keys: HardwareKeys, axes: Mapping[str, Component], build: Path) -> None:
        self.keys = keys
        self.bus = Bus(keys.bit_rate)
        super().__init__(SimulatedNetwork(self.bus))
        self.plants: dict[str, Plant] = {}
        self.modules: dict[str, Module] = {}
        for name, axis in axes.items():
            self.plants[name] = Plant(axis, keys.nodes[name], start_position(axis), build)
            self.bus.attach(self.plants[name].drive)
        for name, module in keys.modules.items():
            self.modules[name] = Module(device(module.profile), module.node)
            self.bus.attach(self.modules[name])

    def update_load(self) -> None:
        """Apply the members' loads to the motors."""
        for plant in self.plants.values():
            plant.update_load()

    def zero(self, positions: Mapping[str, float]) -> None:
        """Align true and measured positions."""
        for name, plant in self.plants.items():
            plant.zero(positions[name])

    def plan(self, overrides: Sequence[Override], origin: int) -> None:
        """Schedule overrides, given at the member, for the motor."""
        for override in overrides:
            plant = self.plants.get(override.node)
            hit = plant.drive if plant is not None else self.modules.get(override.node)
            number = hit.node if hit is not None else self.keys.master
            sign = plant.sign if plant is not None else 1.0
            self.bus.event_queue.at(origin + override.at, partial(override.act, self.bus, number, hit, sign))

    def acted(self, overrides: Sequence[Override], origin: int) -> list[Override]:
        """Overrides whose time has come."""
        return [override for override in overrides if override.at <= self.bus.now - origin]

    def shown(self, name: str) -> dict[str, Callable[[], float]]:
        """True values of a motor."""
        return self.plants[name].shown() if name in self.plants else {}

    def faults_at_rest(self, failed: bool, unconfirmed: Sequence[str]) -> list[str]:  # noqa: ARG002 - the truth is known
        """Return what is not at rest, by the true state."""
        if failed:  # drives that did not hear the master stop by themselves
            self.bus.advance(self.bus.now + AFTERMATH)
        before = [plant.motor.position for plant in self.plants.values()]
        if failed:
            self.bus.advance(self.bus.now + GLANCE)
        faults = [
            text
            for plant, position in zip(self.plants.values(), before, strict=True)
            if (text := plant.faults_at_rest(abs(plant.motor.position - position) * 1e9 / GLANCE))
        ]
        for name, module in self.modules.items():
            if module.outputs != (safe := self.keys.modules[name].safe_outputs):
                faults.append(f"{name}: outputs {module.outputs}, not {safe}.")
        return faults

    def report(self) -> dict[str, Any]:
        """Load of the bus, and the longest that a frame had to wait [s]."""
        return {"bus_load": self.bus.load, "longest_wait": self.bus.longest_wait / 1e9}
