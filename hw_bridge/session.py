"""One case of a run on drives: from the first step, which brings them up, to the stop."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from hw_bridge.bus import Bus
from hw_bridge.cia402 import Mode
from hw_bridge.contact import ContactWatch
from hw_bridge.drive.drive import Drive
from hw_bridge.drive.motor import Motor
from hw_bridge.fault import inject
from hw_bridge.master.master import Master
from hw_bridge.master.network import Network, SimulatedNetwork
from hw_bridge.profiles import profile
from hw_bridge.trace.watch import Watch
from twin.errors import SimulationError
from twin.variable import Role

if TYPE_CHECKING:
    from pathlib import Path

    from hw_bridge.hardware import HardwareKeys
    from hw_bridge.master.node import Node
    from twin.component import Component

SHARE = 0.8  # of the velocity limit that a target may ask for: the drive overshoots
OWN = ("current_maximum", "current_continuous")  # parameters of a motor that its drive uses for itself


def bench_network(keys: HardwareKeys, build: Path) -> Network:
    """The bus of a bench alone, without a scenario; simulated drives feel no load."""
    if not keys.simulated:
        return wire(keys)
    bus = Bus(keys.bit_rate)
    for node in keys.nodes.values():
        vendor = profile(node.profile)
        bus.attach(Drive(vendor, node.node, Motor(vendor.motor, build=build)))
    return SimulatedNetwork(bus)


def wire(keys: HardwareKeys) -> Network:
    """A python-can interface."""
    from hw_bridge.master.wire import WireNetwork

    return WireNetwork(keys.interface, keys.channel, keys.bit_rate, keys.options)


class Plant:
    """A simulated drive with its motor, which feels the load of the co-simulation."""

    def __init__(self, axis: Component, keys: HardwareKeys, name: str, build: Path) -> None:
        node = keys.nodes[name]
        vendor = profile(node.profile)
        model = vendor.motor
        self.axis, self.parameters = axis, {}
        start = {v.name: v.start for v in type(axis).variables if v.role is Role.parameter}
        if axis.replaced.__module__.endswith(f".{model.component}.model"):  # type: ignore[attr-defined]
            given = {key: float(axis.views[key]) for key in start if float(axis.views[key]) != start[key]}
            model = replace(model, parameters={**model.parameters, **given})
            self.parameters = {key: float(axis.views[key]) for key in start if key not in OWN}
        self.motor = Motor(model, build=build)
        self.drive = Drive(vendor, node.node, self.motor)
        self.sign = -node.scale if node.inverted else node.scale
        self.scale = node.scale
        self.origin = 0.0

    def zero(self, node: Node) -> None:
        """True and measured positions count from the same place."""
        self.origin = self.sign * self.motor.measured_position - node.position

    def feel(self) -> None:
        """Take over load and parameters that changed."""
        views = self.axis.views
        if "load_force" in views:
            self.motor.load(float(views["load_force"]) * self.sign)
        for key, before in self.parameters.items():
            if (value := float(views[key])) != before:
                self.parameters[key] = value
                self.motor._views[key][...] = value

    def show(self, values: dict[str, float]) -> None:
        """What only a simulated motor can tell."""
        values["position"] = self.sign * self.motor.position - self.origin


class Session:
    """Drives and their master during one case."""

    def __init__(self, keys: HardwareKeys, build: Path, trace: Path | None = None) -> None:
        self.keys, self.build, self.trace = keys, build, trace
        self.watch: Watch | None = None
        self.axes: dict[str, Component] = {}
        self.plants: dict[str, Plant] = {}
        self.master: Master | None = None
        self.bus: Bus | None = None
        self.begun = self.closed = self.real_time = self.failed = False
        self.wall_clock = not keys.simulated
        self.stepped: set[str] = set()
        self.origin = 0  # time of the network at the scenario's zero [ns]
        self.start = 0
        self.watches: dict[str, ContactWatch] = {}
        self.notes: list[str] = []

    def network(self) -> Network:
        """The bus, with its simulated drives where they are part of the run."""
        keys = self.keys
        if not keys.simulated:
            return wire(keys)
        self.bus = Bus(keys.bit_rate)
        for name, axis in self.axes.items():
            self.plants[name] = Plant(axis, keys, name, self.build)
            self.bus.attach(self.plants[name].drive)
        return SimulatedNetwork(self.bus)

    def step(self, member: str, t: float, h: float) -> None:
        """The targets of a member are there; with the last one everything goes on from t to t + h [s]."""
        self.stepped.add(member)
        if self.stepped == set(self.axes):
            self.stepped.clear()
            try:
                self.advance(round(t * 1e9), round(h * 1e9))
            except BaseException:
                self.failed = True
                self.close()
                raise

    def advance(self, t: int, h: int) -> None:
        """Let the bus go from t to t + h [ns]."""
        for plant in self.plants.values():
            plant.feel()
        if not self.begun:
            self.begin(t)
        master = self.master
        assert master is not None
        for name, watch in self.watches.items():
            watch.look(t, float(self.axes[name].views["contact_force"]))
        if (t - self.start) % self.keys.cycle == 0:
            self.keep_pace(t)
            if problem := master.check():
                raise SimulationError(f"{problem} All drives stop.")
            self.take_targets()
            master.exchange()
            master.timing.synced(master.network.now, self.origin + t + master.window)
        master.wait_until(self.origin + t + h)
        self.show()

    def begin(self, t: int) -> None:
        """Bring the drives up."""
        network = self.network()
        self.watch = Watch(self.keys, network, self.trace)
        master = self.master = Master(self.keys, network)
        self.begun, self.start, self.real_time = True, t, master.network.real_time
        master.begin()
        self.origin = master.network.now - t
        self.plan_faults()
        for name, plant in self.plants.items():
            plant.zero(master.nodes[name])
        for name, node in self.keys.nodes.items():
            if node.contact is not None:
                self.watches[name] = ContactWatch(name, node.contact, master.nodes[name], t)

    def plan_faults(self) -> None:
        """Faults of the hardware file, at their times."""
        bus = self.bus
        if bus is None:
            return
        for one in self.keys.faults:
            plant = self.plants.get(one.node)
            node = plant.drive.node if plant is not None else self.keys.master
            drive = plant.drive if plant is not None else None
            bus.agenda.at(self.origin + one.at, partial(inject, one.made(), bus, node, drive))

    def keep_pace(self, t: int) -> None:
        """A loop that came too late goes on from here instead of hurrying after."""
        master = self.master
        assert master is not None
        late = master.network.now - (self.origin + t)
        if self.wall_clock and late > self.keys.cycle:
            master.timing.overruns += 1
            self.origin += late

    def take_targets(self) -> None:
        """What the drives are told in this cycle."""
        assert self.master is not None
        retracting = [watch for watch in self.watches.values() if watch.reason]
        for name, node in self.master.nodes.items():
            views = self.axes[name].views
            if retracting:
                watch = self.watches.get(name)
                node.mode, node.target_velocity = Mode.CSV, watch.velocity() if watch and watch.reason else 0.0
                continue
            mode = Mode(int(views["mode_of_operation"])) if "mode_of_operation" in views else Mode.CSV
            limit = node.keys.limits
            fastest = SHARE * limit.velocity
            node.target_velocity = min(max(float(views["target_velocity"]), -fastest), fastest)
            if mode is Mode.CSP:
                target = float(views["target_position"])
                if abs(target - node.position) > limit.following_error:
                    raise SimulationError(
                        f"{name}: target_position {1e3 * target:.2f} mm is {1e3 * abs(target - node.position):.2f} mm from "
                        f"where the drive is, a jump. All drives stop."
                    )
                node.target_position = target
            node.mode = mode
        if retracting and all(watch.done() for watch in retracting):
            raise SimulationError(f"{retracting[0].reason} All drives stop.")

    def show(self) -> None:
        """Outputs of all members."""
        assert self.master is not None
        for name, node in self.master.nodes.items():
            values = {
                "position_actual_value": node.position, "velocity_actual_value": node.velocity,
                "position": node.position, "velocity": node.velocity, "current": node.current, "force": node.force,
            }  # fmt: skip
            if name in self.plants:
                self.plants[name].show(values)
            views = self.axes[name].views
            for key, value in values.items():
                if key in views:
                    views[key][...] = value

    def close(self) -> None:
        """Stop everything; once."""
        if self.closed:
            return
        self.closed = True
        if self.master is not None:
            self.master.stop()
            self.notes += self.master.notes
        if self.watch is not None:
            self.watch.close()

    def report(self) -> dict[str, Any]:
        """Statistics of the case."""
        assert self.master is not None
        found = self.master.report() | {"real_time_priority": self.real_time}
        if self.watch is not None:
            found |= {"origin": self.origin / 1e9, "seen": self.watch.seen(self.origin)}
            found |= {"trace": str(self.trace), "frames": self.watch.count} if self.trace is not None else {}
        if self.bus is not None:
            found |= {"bus_load": self.bus.load, "longest_wait": self.bus.longest_wait / 1e9}
        return found
