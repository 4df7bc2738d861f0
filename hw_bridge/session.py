"""One case of a run on drives: from the first step, which brings them up, to the stop."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from hw_bridge import targets
from hw_bridge.bus import Bus
from hw_bridge.cia402 import INTERNAL_LIMIT, Mode
from hw_bridge.contact import ContactWatch
from hw_bridge.drive.drive import Drive
from hw_bridge.drive.motor import Motor
from hw_bridge.fault import inject
from hw_bridge.master.master import Master
from hw_bridge.master.network import Network, SimulatedNetwork
from hw_bridge.module import Module
from hw_bridge.outputs import levels
from hw_bridge.plant import Plant
from hw_bridge.profiles import device, profile
from hw_bridge.shadow import Shadow
from hw_bridge.trace.watch import Watch
from twin.errors import SimulationError
from twin.results import Ending

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from hw_bridge.keys import ContactKeys, FaultKeys, HardwareKeys
    from hw_bridge.master.node import Node
    from twin.component import Component

GLANCE = 10_000_000  # time in which a way is seen [ns]
TOLD: dict[str, Callable[[Node], float]] = {  # what a drive tells of itself, by what members call it
    "position_actual_value": lambda node: node.position,
    "position":              lambda node: node.position,
    "angle":                 lambda node: node.position,
    "motor_angle":           lambda node: node.position / node.keys.scale,
    "velocity_actual_value": lambda node: node.velocity,
    "velocity":              lambda node: node.velocity,
    "angular_velocity":      lambda node: node.velocity,
    "current":               lambda node: node.current,
    "force":                 lambda node: node.force,
    "torque":                lambda node: node.force * node.keys.scale,
    "limited":               lambda node: bool(node.word & INTERNAL_LIMIT),
}  # fmt: skip
AFTERMATH = 500_000_000  # how long a simulated bench is watched after a stop on a failure [ns]


def bench_network(keys: HardwareKeys, build: Path) -> Network:
    """The bus of a bench alone, without a scenario; simulated drives feel no load."""
    if not keys.simulated:
        return wire(keys)
    bus = Bus(keys.bit_rate)
    for node in keys.nodes.values():
        vendor = profile(node.profile)
        bus.attach(Drive(vendor, node.node, Motor(vendor.motor, build=build)))
    for module in keys.modules.values():
        bus.attach(Module(device(module.profile), module.node))
    return SimulatedNetwork(bus)


def wire(keys: HardwareKeys) -> Network:
    """A python-can interface."""
    from hw_bridge.master.wire import WireNetwork

    return WireNetwork(keys.interface, keys.channel, keys.bit_rate, keys.options)


def beginning(axis: Component) -> float:
    """Where a member begins [m or rad]."""
    return float(axis.views["target_position"]) if "target_position" in axis.views else 0.0


class Session:
    """Drives and their master during one case."""

    def __init__(
        self, keys: HardwareKeys, contacts: dict[str, ContactKeys], build: Path, trace: Path | None = None,
        faults: Sequence[FaultKeys] = (), variant: str = "",
    ) -> None:  # fmt: skip
        self.variant = variant
        self.keys, self.contacts, self.build, self.trace, self.faults = keys, contacts, build, trace, faults
        self.watch: Watch | None = None
        self.axes: dict[str, Component] = {}
        self.switches: dict[str, Component] = {}  # members that stand for modules
        self.modules: dict[str, Module] = {}  # those that are simulated
        self.forced: set[str] = set()  # members that are told a force
        self.plants: dict[str, Plant] = {}
        self.master: Master | None = None
        self.bus: Bus | None = None
        self.begun = self.closed = self.real_time = self.failed = False
        self.wall_clock = not keys.simulated
        self.stepped: set[str] = set()
        self.origin = 0  # time of the network at the scenario's zero [ns]
        self.start = 0
        self.watches: dict[str, ContactWatch] = {}
        self.shadows: dict[str, Shadow] = {}
        self.notes: list[str] = []
        self.outputs: list[tuple[Any, Callable[[], float]]] = []
        self.running = False  # all drives were brought up
        self.stopped: tuple[int, str] | None = None  # time of the scenario [ns] and reason of a stop before the end
        self.seen: list[str] = []
        self.unsafe: list[str] = []

    def network(self) -> Network:
        """The bus, with its simulated drives where they are part of the run."""
        keys = self.keys
        if not keys.simulated:
            return wire(keys)
        self.bus = Bus(keys.bit_rate)
        for name, axis in self.axes.items():
            self.plants[name] = Plant(axis, keys.nodes[name], beginning(axis), self.build)
            self.bus.attach(self.plants[name].drive)
        for name, module in keys.modules.items():
            self.modules[name] = Module(device(module.profile), module.node)
            self.bus.attach(self.modules[name])
        return SimulatedNetwork(self.bus)

    def step(self, member: str, t: float, h: float) -> None:
        """The targets of a member are there; with the last one everything goes on from t to t + h [s]."""
        self.stepped.add(member)
        if self.stepped == {*self.axes, *self.switches}:
            self.stepped.clear()
            try:
                self.advance(round(t * 1e9), round(h * 1e9))
            except BaseException as error:
                self.failed = True
                if self.running and isinstance(error, SimulationError):
                    self.stopped = round(t * 1e9), str(error)
                self.close()
                raise

    def advance(self, t: int, h: int) -> None:
        """Let the bus go from t to t + h [ns]."""
        for plant in self.plants.values():
            plant.feel()
        for shadow in self.shadows.values():
            shadow.feel()
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
            if t > self.start:
                for one in self.shadows.values():
                    one.look(t)
            self.take_targets()
            master.exchange()
            master.timing.synced(master.network.now, self.origin + t + master.window)
        master.wait_until(self.origin + t + h)
        for view, value in self.outputs:
            view[...] = value()

    def begin(self, t: int) -> None:
        """Bring the drives up, if they are told what they can do."""
        modes = {name: self.mode(name) for name in self.axes}
        for name, axis in self.axes.items():
            if "target_position" in axis.views:  # where a drive goes after homing
                targets.finite(name, axis, "target_position")
        self.forced |= {name for name, mode in modes.items() if mode is Mode.CST}
        network = self.network()
        self.watch = Watch(self.keys, network, self.trace)
        master = self.master = Master(self.keys, network, self.forced)
        self.begun, self.start, self.real_time = True, t, master.network.real_time
        for name, one in self.keys.nodes.items():
            if one.shadow is not None:
                self.shadows[name] = Shadow(
                    self.axes[name], one, one.shadow, master.nodes[name], network, beginning(self.axes[name]),
                    self.keys.master, self.keys.cycle, self.build,
                )  # fmt: skip
        for name, axis in self.axes.items():
            master.nodes[name].rotary = "angle" in axis.views
        master.begin({name: beginning(axis) for name, axis in self.axes.items()})
        self.origin = master.network.now - t
        self.plan_faults()
        for name, plant in self.plants.items():
            plant.zero(master.nodes[name])
        for name, contact in self.contacts.items():
            self.watches[name] = ContactWatch(name, contact, master.nodes[name], t)
        self.outputs = self.shown()
        self.running = True

    def plan_faults(self) -> None:
        """Faults of the hardware file and of the scenario, at their times."""
        bus = self.bus
        if bus is None:
            return
        for one in self.faults:
            slave = self.plants[one.node].drive if one.node in self.plants else self.modules.get(one.node)
            node = slave.node if slave is not None else self.keys.master
            fault = one.made()
            if one.node in self.plants:  # told at the member, done at the motor
                fault = replace(fault, offset=fault.offset / self.plants[one.node].sign)
            bus.agenda.at(self.origin + one.at, partial(inject, fault, bus, node, slave))

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
            if retracting:  # outputs stay: who holds the instrument takes it along
                watch = self.watches.get(name)
                node.mode, node.target_velocity = Mode.CSV, watch.velocity() if watch and watch.reason else 0.0
                continue
            node.outputs = levels(node.keys.outputs, node.safe_outputs, self.axes[name])
            mode = self.mode(name)
            limit = node.keys.limits
            if mode is Mode.CSV:
                node.target_velocity = targets.velocity(name, self.axes[name], limit)
            if mode is Mode.CST:
                node.target_force = targets.force(name, self.axes[name], limit, node.keys.scale)
            if mode is Mode.CSP:
                target = targets.finite(name, self.axes[name], "target_position")
                if (jump := abs(target - node.position)) > limit.following_error:
                    raise SimulationError(
                        f"{name}: target_position {node.way(target)} is {node.way(jump)} from where the drive is, a jump. "
                        f"All drives stop."
                    )
                node.target_position = target
            node.mode = mode
        for name, module in self.master.modules.items():
            if not retracting:
                module.outputs = levels(module.keys.outputs, module.safe_outputs, self.switches[name])
        if retracting and all(watch.done() for watch in retracting):
            raise SimulationError(f"{retracting[0].reason} All drives stop.")

    def mode(self, name: str) -> Mode:
        """What a member is told in each cycle."""
        views = self.axes[name].views
        wanted = int(views["mode_of_operation"]) if "mode_of_operation" in views else Mode.CSV
        if problem := targets.unknown_mode(wanted, profile(self.keys.nodes[name].profile), views):
            raise SimulationError(f"{name}: {problem} All drives stop.")
        mode = targets.CYCLIC[wanted]
        if mode is Mode.CST and self.begun and name not in self.forced:
            raise SimulationError(
                f"{name}: mode_of_operation 10: its process data have no force. Begin in it, or set or connect a target "
                f"force in the scenario. All drives stop."
            )
        return mode

    def shown(self) -> list[tuple[Any, Callable[[], float]]]:
        """Outputs of all members, and what stands in them."""
        assert self.master is not None
        found: list[tuple[Any, Callable[[], float]]] = []
        for name, node in self.master.nodes.items():
            values: dict[str, Callable[[], float]] = {key: partial(value, node) for key, value in TOLD.items()}
            if name in self.plants:
                values |= self.plants[name].shown()
            views = self.axes[name].views
            found += [(views[key], value) for key, value in values.items() if key in views]
        return found

    def close(self) -> None:
        """Stop everything; once."""
        if self.closed:
            return
        self.closed = True
        if self.master is not None:
            self.master.stop()
            self.notes += self.master.notes
        try:
            self.look_after()
        except SimulationError as error:  # of a motor that cannot go on; the failure that ended the case is told first
            self.unsafe.append(str(error))
        if self.watch is not None:
            self.watch.close()
            self.seen = self.story(self.watch)
        self.notes += [line for shadow in self.shadows.values() for line in shadow.warnings]

    def look_after(self) -> None:
        """What is not at rest after the stop: on a simulated bus in truth, else what the master could not confirm."""
        if self.bus is None:
            self.unsafe = list(self.master.notes) if self.master is not None else []
            return
        if self.failed:  # drives that did not hear the master stop by themselves
            self.bus.advance(self.bus.now + AFTERMATH)
        before = [plant.motor.position for plant in self.plants.values()]
        if self.failed:
            self.bus.advance(self.bus.now + GLANCE)
        self.unsafe = [
            text
            for plant, position in zip(self.plants.values(), before, strict=True)
            if (text := plant.restless(abs(plant.motor.position - position) * 1e9 / GLANCE))
        ]
        for name, module in self.modules.items():
            if module.outputs != (safe := self.keys.modules[name].safe_outputs):
                self.unsafe.append(f"{name}: outputs {module.outputs}, not {safe}.")

    def story(self, watch: Watch) -> list[str]:
        """What was seen on the bus, with the faults that were planned and the stop in their places."""
        marks = [
            (one.at, f"FAULT {one.text}") for one in self.faults if self.bus and one.at <= self.bus.now - self.origin
        ]
        marks += [(self.stopped[0], f"STOP {self.stopped[1]}")] if self.stopped is not None else []
        lines = [*(f"{time / 1e9:.6f} s: {text}" for time, text in marks), *watch.seen(self.origin)]
        return sorted(lines, key=lambda line: float(line.partition(" ")[0]))

    def ending(self) -> Ending:
        """How the case ended."""
        time, reason = self.stopped or (None, "")
        return Ending(time, reason, " ".join(self.unsafe), tuple(self.seen))

    def report(self) -> dict[str, Any]:
        """Statistics of the case."""
        assert self.master is not None
        found = self.master.report() | {"real_time_priority": self.real_time}
        if self.shadows:
            found["shadow"] = {name: shadow.report() for name, shadow in self.shadows.items()}
        if self.watch is not None:
            found |= {"origin": self.origin / 1e9, "seen": self.seen if self.closed else self.story(self.watch)}
            found |= {"trace": str(self.trace), "frames": self.watch.count} if self.trace is not None else {}
        if self.bus is not None:
            found |= {"bus_load": self.bus.load, "longest_wait": self.bus.longest_wait / 1e9}
        return found
