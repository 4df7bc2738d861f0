"""What a run stands on: drives and modules on a bus in simulated time that feel the scenario, or a wire to real ones."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import partial
from typing import TYPE_CHECKING, Any

from hw_bridge.bus import Bus, SimulatedNetwork
from hw_bridge.device import Drive, Module, Motor
from hw_bridge.plant.plant import Plant, beginning, set_up_for
from hw_bridge.profiles import device, motor_parameters

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from hw_bridge.bus import Network, Override
    from hw_bridge.hardware import HardwareKeys
    from twin.component import Component

GLANCE = 10_000_000  # time in which a way is seen [ns]
AFTERMATH = 500_000_000  # how long a simulated bench is watched after a stop on a failure [ns]


def wire(keys: HardwareKeys) -> Network:
    """A python-can interface."""
    from hw_bridge.wire import WireNetwork

    return WireNetwork(keys.interface, keys.channel, keys.bit_rate, keys.options)


def bench_network(keys: HardwareKeys, build: Path) -> Network:
    """The bus of a bench alone, without a scenario; simulated drives feel no load."""
    if not keys.simulated:
        return wire(keys)
    bus = Bus(keys.bit_rate)
    for node in keys.nodes.values():
        vendor = node.drive
        motor = motor_parameters(vendor, node.motor)
        bus.attach(set_up_for(Drive(vendor, node.node, Motor(motor.model, build=build)), motor))
    for module in keys.modules.values():
        bus.attach(Module(device(module.profile), module.node))
    return SimulatedNetwork(bus)


def set_up(keys: HardwareKeys, axes: Mapping[str, Component], build: Path) -> Bench:
    """The bench of a hardware file, whose drives stand for these members."""
    return SimulatedBench(keys, axes, build) if keys.simulated else WireBench(keys)


class Bench(ABC):
    """The drives and modules of a case. `network`: their bus, as a master uses it."""

    network: Network

    @abstractmethod
    def feel(self) -> None:
        """Loads and parameters of the members act from now on."""

    @abstractmethod
    def zero(self, positions: Mapping[str, float]) -> None:
        """These are the positions that are measured here [m or rad]."""

    @abstractmethod
    def plan(self, overrides: Sequence[Override], origin: int) -> None:
        """Let them act at their times; `origin` [ns] is the scenario's zero."""

    @abstractmethod
    def acted(self, overrides: Sequence[Override], origin: int) -> list[Override]:
        """Those whose time has come."""

    @abstractmethod
    def shown(self, name: str) -> dict[str, Callable[[], float]]:
        """What can be told of a drive beside what it tells itself, by what members call it."""

    @abstractmethod
    def restless(self, failed: bool, unconfirmed: Sequence[str]) -> list[str]:
        """What is not at rest after the stop. `unconfirmed`: what the master could not confirm."""

    @abstractmethod
    def report(self) -> dict[str, Any]:
        """Figures of the bus."""


class WireBench(Bench):
    """Real drives, or simulated ones in processes of their own: only what they tell is known."""

    def __init__(self, keys: HardwareKeys) -> None:
        self.network = wire(keys)

    def feel(self) -> None:
        """They feel what there is."""

    def zero(self, positions: Mapping[str, float]) -> None:
        """Nobody knows where they are in truth."""

    def plan(self, overrides: Sequence[Override], origin: int) -> None:
        """Real drives have their own."""

    def acted(self, overrides: Sequence[Override], origin: int) -> list[Override]:  # noqa: ARG002 - none was planned
        """None."""
        return []

    def shown(self, name: str) -> dict[str, Callable[[], float]]:  # noqa: ARG002 - the same for all
        """Nothing."""
        return {}

    def restless(self, failed: bool, unconfirmed: Sequence[str]) -> list[str]:  # noqa: ARG002 - nothing more is known
        """What the master could not confirm."""
        return list(unconfirmed)

    def report(self) -> dict[str, Any]:
        """The interface tells nothing of the bus."""
        return {}


class SimulatedBench(Bench):
    """Drives, modules and their bus are part of the run, in simulated time."""

    def __init__(self, keys: HardwareKeys, axes: Mapping[str, Component], build: Path) -> None:
        self.keys = keys
        self.bus = Bus(keys.bit_rate)
        self.plants: dict[str, Plant] = {}
        self.modules: dict[str, Module] = {}
        for name, axis in axes.items():
            self.plants[name] = Plant(axis, keys.nodes[name], beginning(axis), build)
            self.bus.attach(self.plants[name].drive)
        for name, module in keys.modules.items():
            self.modules[name] = Module(device(module.profile), module.node)
            self.bus.attach(self.modules[name])
        self.network = SimulatedNetwork(self.bus)

    def feel(self) -> None:
        """Motors feel their members' loads."""
        for plant in self.plants.values():
            plant.feel()

    def zero(self, positions: Mapping[str, float]) -> None:
        """True and measured positions count from the same place."""
        for name, plant in self.plants.items():
            plant.zero(positions[name])

    def plan(self, overrides: Sequence[Override], origin: int) -> None:
        """Told at the member, done at the motor."""
        for override in overrides:
            plant = self.plants.get(override.node)
            hit = plant.drive if plant is not None else self.modules.get(override.node)
            number = hit.node if hit is not None else self.keys.master
            sign = plant.sign if plant is not None else 1.0
            self.bus.agenda.at(origin + override.at, partial(override.act, self.bus, number, hit, sign))

    def acted(self, overrides: Sequence[Override], origin: int) -> list[Override]:
        """Those whose time has come."""
        return [override for override in overrides if override.at <= self.bus.now - origin]

    def shown(self, name: str) -> dict[str, Callable[[], float]]:
        """What is true of a motor."""
        return self.plants[name].shown() if name in self.plants else {}

    def restless(self, failed: bool, unconfirmed: Sequence[str]) -> list[str]:  # noqa: ARG002 - the truth is known
        """What is not at rest in truth."""
        if failed:  # drives that did not hear the master stop by themselves
            self.bus.advance(self.bus.now + AFTERMATH)
        before = [plant.motor.position for plant in self.plants.values()]
        if failed:
            self.bus.advance(self.bus.now + GLANCE)
        found = [
            text
            for plant, position in zip(self.plants.values(), before, strict=True)
            if (text := plant.restless(abs(plant.motor.position - position) * 1e9 / GLANCE))
        ]
        for name, module in self.modules.items():
            if module.outputs != (safe := self.keys.modules[name].safe_outputs):
                found.append(f"{name}: outputs {module.outputs}, not {safe}.")
        return found

    def report(self) -> dict[str, Any]:
        """Load of the bus, and the longest that a frame had to wait [s]."""
        return {"bus_load": self.bus.load, "longest_wait": self.bus.longest_wait / 1e9}
