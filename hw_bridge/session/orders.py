"""What drives and modules are told in each cycle, by the targets of their members."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.dictionary import Mode
from hw_bridge.session import targets
from hw_bridge.session.outputs import levels
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hw_bridge.hardware import HardwareKeys
    from hw_bridge.master import Master, Node
    from hw_bridge.session.contact import ContactWatch
    from twin.component import Component


class Orders:
    """Reads and checks targets. `axes` and `switches`: members that stand for drives and for modules.

    `forced`: those that are told a force; their process data have room for one.
    """

    def __init__(self, keys: HardwareKeys) -> None:
        self.keys = keys
        self.axes: dict[str, Component] = {}
        self.switches: dict[str, Component] = {}
        self.forced: set[str] = set()
        self.begun = False

    def begin(self) -> None:
        """The modes in which the drives begin, and whether where they begin is a place."""
        modes = {name: self.mode(name) for name in self.axes}
        for name, axis in self.axes.items():
            if "target_position" in axis.views:  # where a drive goes after homing
                targets.finite(name, axis, "target_position")
        self.forced |= {name for name, mode in modes.items() if mode is Mode.CST}
        self.begun = True

    def give(self, master: Master, watches: Mapping[str, ContactWatch]) -> None:
        """What the drives are told in this cycle."""
        retracting = [watch for watch in watches.values() if watch.reason]
        for name, node in master.nodes.items():
            if retracting:  # outputs stay: who holds the instrument takes it along
                watch = watches.get(name)
                node.mode, node.target_velocity = Mode.CSV, watch.velocity() if watch and watch.reason else 0.0
                node.clear_target()
                continue
            node.outputs = levels(node.keys.outputs, node.safe_outputs, self.axes[name])
            told = self.mode(name)
            if told is Mode.CST:
                node.target_force = targets.force(name, self.axes[name], node.keys.limits, node.keys.scale)
            node.mode = self.follow(node, told)
        for name, module in master.modules.items():
            if not retracting:
                module.outputs = levels(module.keys.outputs, module.safe_outputs, self.switches[name])
        if retracting and all(watch.done() for watch in retracting):
            raise SimulationError(f"{retracting[0].reason} All drives stop.")

    def follow(self, node: Node, told: Mode) -> Mode:
        """What the member is told, in the mode that the hardware file names for its drive: the answer."""
        axis, keys, limits = self.axes[node.name], node.keys.follow, node.keys.limits
        mode = told if told is Mode.CST or keys.mode is None else Mode[keys.mode.upper()]
        speed = targets.velocity(node.name, axis, limits) if told is Mode.CSV else 0.0
        error = node.tracking_error  # of the cycle before: what was measured belongs to its target
        if told is Mode.CSP:
            node.set_target(targets.position(node, axis), self.keys.cycle)
        elif mode is Mode.CSP:
            node.set_target(node.last_target + speed * self.keys.cycle / 1e9, self.keys.cycle)
        else:
            node.clear_target()
        fed = keys.feedforward * node.speed
        if mode is Mode.CSV:
            node.target_velocity = (
                speed if told is Mode.CSV else targets.within(fed + keys.gain * error, limits.velocity)
            )
        node.offset = targets.within(fed, limits.velocity)
        return mode

    def mode(self, name: str) -> Mode:
        """What a member is told in each cycle."""
        views = self.axes[name].views
        wanted = int(views["mode_of_operation"]) if "mode_of_operation" in views else Mode.CSV
        if problem := targets.unknown_mode(wanted, self.keys.nodes[name].drive, views):
            raise SimulationError(f"{name}: {problem} All drives stop.")
        mode = targets.CYCLIC[wanted]
        if mode is Mode.CST and self.begun and name not in self.forced:
            raise SimulationError(
                f"{name}: mode_of_operation 10: its process data have no force. Begin in it, or set or connect a target "
                f"force in the scenario. All drives stop."
            )
        return mode
