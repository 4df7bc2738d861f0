"""Targets and outputs of drives and modules in each cycle, from their members."""

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


class TargetDispatcher:
    """Read and check targets. `axes` and `switches`: members that drives and modules replace.

    `forced`: members with target forces; their process data include one.
    """

    def __init__(self, keys: HardwareKeys) -> None:
        self.keys = keys
        self.axes: dict[str, Component] = {}
        self.switches: dict[str, Component] = {}
        self.forced: set[str] = set()
        self.is_started = False

    def begin(self) -> None:
        """Determine the initial modes, and check that start positions are finite."""
        modes = {name: self.mode(name) for name in self.axes}
        for name, axis in self.axes.items():
            if "target_position" in axis.views:  # where a drive goes after homing
                targets.finite_target(name, axis, "target_position")
        self.forced |= {name for name, mode in modes.items() if mode is Mode.CST}
        self.is_started = True

    def set_targets(self, master: Master, watches: Mapping[str, ContactWatch]) -> None:
        """Set the targets of all drives and modules for this cycle."""
        retracting = [watch for watch in watches.values() if watch.reason]
        for name, node in master.nodes.items():
            if retracting:  # outputs stay: a gripper that holds the instrument takes it along
                watch = watches.get(name)
                node.mode, node.target_velocity = Mode.CSV, watch.velocity() if watch and watch.reason else 0.0
                node.clear_target()
                continue
            node.outputs = levels(node.keys.outputs, node.safe_outputs, self.axes[name])
            mode = self.mode(name)
            if mode is Mode.CST:
                node.target_force = targets.force(name, self.axes[name], node.keys.limits, node.keys.scale)
            node.mode = self.set_drive_targets(node, mode)
        for name, module in master.modules.items():
            if not retracting:
                module.outputs = levels(module.keys.outputs, module.safe_outputs, self.switches[name])
        if retracting and all(watch.done() for watch in retracting):
            raise SimulationError(f"{retracting[0].outcome()} All drives stop.")

    def set_drive_targets(self, node: Node, commanded: Mode) -> Mode:
        """Set a drive's targets in the mode of the hardware file; return the mode."""
        axis, keys, limits = self.axes[node.name], node.keys.follow, node.keys.limits
        mode = commanded if commanded is Mode.CST or keys.mode is None else Mode[keys.mode.upper()]
        speed = targets.velocity(node.name, axis, limits) if commanded is Mode.CSV else 0.0
        error = node.tracking_error  # of the cycle before: what was measured belongs to its target
        if commanded is Mode.CSP:
            node.set_target(targets.position(node, axis), self.keys.cycle)
        elif mode is Mode.CSP:
            node.set_target(node.last_target + speed * self.keys.cycle / 1e9, self.keys.cycle)
        else:
            node.clear_target()
        fed = keys.feedforward * node.speed
        if mode is Mode.CSV:
            node.target_velocity = (
                speed if commanded is Mode.CSV else targets.clamp_target(fed + keys.gain * error, limits.velocity)
            )
        node.offset = targets.clamp_target(fed, limits.velocity)
        return mode

    def mode(self, name: str) -> Mode:
        """Mode of operation of a member."""
        views = self.axes[name].views
        wanted = int(views["mode_of_operation"]) if "mode_of_operation" in views else Mode.CSV
        if problem := targets.unknown_mode(wanted, self.keys.nodes[name].drive, views):
            raise SimulationError(f"{name}: {problem} All drives stop.")
        mode = targets.CYCLIC[wanted]
        if mode is Mode.CST and self.is_started and name not in self.forced:
            raise SimulationError(
                f"{name}: mode_of_operation 10: its process data have no force. Begin in it, or set or connect a target "
                f"force in the scenario. All drives stop."
            )
        return mode
