"""Checks of drives and modules in each cycle of a run; a problem ends it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.dictionary import Mode, NmtState, State, cia402
from hw_bridge.master import fault_report

if TYPE_CHECKING:
    from hw_bridge.master.master import Master
    from hw_bridge.master.module import ModuleNode
    from hw_bridge.master.node import Node


def station_problem(master: Master, node: Node | ModuleNode) -> str:
    """Return why the messages or the state of a drive or module end the run, or an empty string."""
    now = master.network.now
    for said in node.emergencies:
        if said.code >> 8 != 0:
            return f"{node.name}: EMCY {fault_report.format_emergency(node, said, ', ')}."
    if now - node.last_heartbeat_at > node.keys.heartbeat.lost_after:
        return (
            f"{node.name}: no heartbeat for {(now - node.last_heartbeat_at) / 1e6:.0f} ms. Check its power and the bus."
        )
    if node.silent >= master.max_missed_cycles:
        return f"{node.name}: no process data for {node.silent} cycles. Check the bus."
    if node.doubled:
        return node.doubled
    if node.boots:  # the next SYNC shows whether it, or a second node with its ID
        return _restarted(node) if node.silent else ""
    if node.nmt_state in (NmtState.STOPPED, NmtState.PRE_OPERATIONAL):
        state = node.nmt_state.name.capitalize().replace("_", "-")
        return f"{node.name}: left NMT Operational: {state}. Another master stopped it, or an error of its own."
    return ""


def _restarted(node: Node | ModuleNode) -> str:
    return f"{node.name}: started anew by itself. Check its supply."


def control_problem(node: Node, max_cycles: int) -> str:
    """Problem text if another program controls it, or if it ignores mode or set-point for over `max_cycles`; else empty."""
    if node.cycles_in_other_mode > max_cycles:
        return (
            f"{node.name}: is in mode {node.shown_mode} (6061h), not in {node.own_mode.name.lower()}: another program sets it, "
            f"perhaps the vendor's over USB. End that program."
        )
    if node.was_remote and not node.word & cia402.REMOTE:
        return (
            f"{node.name}: does not obey the bus any more (6041h, bit 9 is 0): it is operated locally, perhaps by the vendor's "
            f"program over USB. End that program."
        )
    if node.set_points.unacknowledged > max_cycles:
        return f"{node.name}: does not acknowledge set-points (6041h, bit 12). Look at its statusword and limits."
    return ""


def drive_problem(master: Master, node: Node) -> str:
    """Return why a drive ends the run, by its state and the limits of the hardware file, or an empty string."""
    if text := station_problem(master, node):
        return text
    text = _value_problem(master, node)
    return _restarted(node) if text and node.boots else text  # what it sends has no longer this program's mapping


def _value_problem(master: Master, node: Node) -> str:
    """Return why the actual values of a drive end the run, or an empty string."""
    limits = node.keys.limits
    oldest, age = limits.actual_value_age or master.oldest, node.sample_lag + master.cycle
    if not node.silent and not node.in_doubt and age > oldest:
        return (
            f"{node.name}: its actual values are {age / 1e6:.4g} ms old, more than {oldest / 1e6:.4g} ms: SYNC or "
            f"process data come late. Check the bus and the adapter, or set limits.actual_value_age."
        )
    if text := node.mode_problem or control_problem(node, master.max_missed_cycles):
        return text
    if node.state is not State.ENABLED:
        return f"{node.name}: left Operation enabled: {node.state}."
    low, high = node.position_limits
    if not low <= node.position <= high:
        return (
            f"{node.name}: position {node.format_length(node.position)} is outside {node.format_length(low)} to "
            f"{node.format_length(high)}."
        )
    if abs(node.velocity) > limits.velocity:
        return f"{node.name}: velocity {node.format_length(node.velocity)}/s is above {node.format_length(limits.velocity)}/s."
    acceleration = node.acceleration.measured
    if node.mode is Mode.CST and abs(acceleration) > limits.acceleration and acceleration * node.force > 0.0:
        unit = "rad" if node.rotary else "m"
        return (
            f"{node.name}: acceleration {abs(acceleration):.3g} {unit}/s^2 is above "
            f"{limits.acceleration:g} {unit}/s^2 in cst, where only the force can be bounded."
        )
    if abs(node.force) > limits.force:
        newton = "N m" if node.rotary else "N"
        return f"{node.name}: force {node.force:.2f} {newton} is above {limits.force:g} {newton}."
    if abs(node.following_error) > limits.following_error:
        error, limit = node.format_length(node.following_error), node.format_length(limits.following_error)
        return f"{node.name}: following error {error} is above {limit}."
    return ""
