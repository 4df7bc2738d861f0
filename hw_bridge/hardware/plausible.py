"""Plausibility of a hardware file: missing capabilities of its drives, and units of another kind of axis."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from hw_bridge.dictionary import Mode, cia402
from hw_bridge.hardware import motor_data
from hw_bridge.profiles import MOTORS, acting
from twin.errors import CouplingError
from twin.scenario import number

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hw_bridge.dictionary import Entry
    from hw_bridge.hardware.keys import HardwareKeys, NodeKeys
    from hw_bridge.profiles import Profile
    from twin.scenario import Node

MILLISECOND = 1_000_000
SLOWEST = 255 * MILLISECOND  # 60C2h.1 has a byte
LONGEST = 65_535 * MILLISECOND  # 1016h and 1017h have two
UNITS = {  # of a linear axis and of one that turns
    ("limits", "position"): ("m", "rad"),
    ("limits", "velocity"): ("m/s", "rad/s"),
    ("limits", "force"): ("N", "N*m"),
    ("limits", "following_error"): ("m", "rad"),
    ("limits", "acceleration"): ("m/s^2", "rad/s^2"),
    ("homing", "at"): ("m", "rad"),
    ("homing", "speed"): ("m/s", "rad/s"),
    ("contact", "distance"): ("m", "rad"),
    ("contact", "speed"): ("m/s", "rad/s"),
    ("shadow", "position"): ("m", "rad"),
    ("shadow", "velocity"): ("m/s", "rad/s"),
    ("force_constant",): ("N/A", "N*m/A"),
}


def check(keys: HardwareKeys, root: Node) -> list[str]:
    """Return everything that drives of these profiles cannot do."""
    problems = []
    if keys.cycle > SLOWEST:
        location = root.find(("cycle",)).location
        problems.append(
            f"{location}: cycle: {keys.cycle / 1e6:g} ms is more than 255 ms, which drives can count. Shorten it."
        )
    problems += _check_at_most(keys, root)
    for name, node in keys.nodes.items():
        problems += [
            f"{root.find(('nodes', name, *path)).location}: nodes.{name}.{'.'.join(path)}: {text}"
            for path, text in _node(node, keys.simulated)
        ]
    for k, fault in enumerate(keys.faults):
        where = f"{root.find(('faults', k)).location}: faults[{k + 1}]"
        if fault.at < 0:
            problems.append(f"{where}: a time is below zero. Count from the beginning of the scenario.")
    return problems


def _check_at_most(keys: HardwareKeys, root: Node) -> list[str]:
    """Problem of `late_cycle.at_most`, or none."""
    given = keys.late_cycle.at_most
    silence = min(station.heartbeat.lost_after for _, _, station in keys.stations())
    if given is None or keys.cycle < given <= silence:
        return []
    location = root.find(("late_cycle", "at_most")).location
    if given <= keys.cycle:
        return [f"{location}: late_cycle.at_most: {given / 1e6:g} ms is not more than a cycle. Use `policy: stop`."]
    text = f"after {silence / 1e6:g} ms without a heartbeat drives have stopped by themselves. Shorten it."
    return [f"{location}: late_cycle.at_most: {text}"]


def _node(node: NodeKeys, simulated: bool) -> list[tuple[tuple[str, ...], str]]:
    """Problems of one node, each with the key that it is about."""
    chosen = node.drive
    problems: list[tuple[tuple[str, ...], str]] = []
    if node.homing is not None and node.homing.method not in chosen.homing:
        methods = ", ".join(map(str, sorted(chosen.homing)))
        text = f"{chosen.title} has no method {node.homing.method}. There are: {methods}."
        problems.append((("homing", "method"), text))
    if max(node.heartbeat.every, node.heartbeat.lost_after) > LONGEST:
        problems.append((("heartbeat",), "more than 65535 ms, which 1016h and 1017h can count. Shorten it."))
    if (
        node.safe_outputs is not None
        and not node.outputs
        and not any(entry.index == cia402.OUTPUTS for entry in chosen.objects)
    ):
        text = f"{chosen.title} has no digital outputs 60FEh. Leave it out, or use those of another drive."
        problems.append((("safe_outputs",), text))
    problems += _following(node, chosen) + motor_data.check(node)
    if node.motor == "member" and not simulated:
        problems.append((("motor",), f"a real drive has the motor that is wired to it. Name it: {', '.join(MOTORS)}."))
    if node.motor in MOTORS and node.profile not in MOTORS[node.motor].scaling:
        fitting = [name for name, motor in MOTORS.items() if node.profile in motor.scaling]
        text = f"no values of {MOTORS[node.motor].title} are known for {chosen.title}. There are: {', '.join(fitting)}."
        problems.append((("motor",), text))
    for (index, sub), value in node.objects.items():
        if text := _object(chosen, index, sub, value, simulated):
            problems.append((("objects",), f"{index:04X}h.{sub}: {text}"))
    return problems


def _following(node: NodeKeys, chosen: Profile) -> list[tuple[tuple[str, ...], str]]:
    """Missing capabilities for the file's tracking mode."""
    if "gain" in node.follow.model_fields_set and node.follow.mode != "csv":
        return [(("follow", "gain"), "in csp the position loop is the drive's. Leave it out, or add `mode: csv`.")]
    mappable = any(entry.index == cia402.VELOCITY_OFFSET and entry.mappable for entry in chosen.objects)
    if node.offset and not (mappable and Mode.CSP in chosen.modes):
        text = f"{chosen.title} has no velocity offset 60B1h in csp. Add `mode: csv`, or use another drive."
        return [(("follow", "feedforward"), text)]
    return []


def _object(chosen: Profile, index: int, sub: int, value: int, simulated: bool) -> str:
    """Problem of an object's value, or empty."""
    if index in acting.commands(chosen):
        return "moves the drive or acts at once, and has a command of its own. Leave it out."
    entry: Entry | None = next(
        (candidate for candidate in chosen.objects if (candidate.index, candidate.sub) == (index, sub)), None
    )
    if entry is None:  # a real drive has more objects than its profile, and says itself what it has not
        return f"{chosen.title} has no such object. Correct it." if simulated else ""
    if not entry.writable:
        return f"{entry.name} cannot be written. Leave it out."
    if not entry.type.form:
        return f"{entry.name} is text. Only numbers can be written."
    try:
        entry.encode(value)
    except struct.error:
        return f"{value} is no {entry.type.name}. Correct it."
    low, high = entry.low, entry.high
    if (low is not None and value < low) or (high is not None and value > high):
        return (
            f"{value} is outside {low if low is not None else '-'} to {high if high is not None else '-'}. Correct it."
        )
    return ""


def gearing(node: NodeKeys, rotary: bool) -> str:
    """Problem text if `scale` between a rotary motor and a linear axis, or the reverse, is missing; else empty."""
    chosen = node.drive
    turns = chosen.motor.unit == "rad"
    if turns is rotary or "scale" in node.model_fields_set:
        return ""
    kinds = ("moves along a line", "turns")
    return (
        f"the motor of {chosen.title} {kinds[turns]}, the member {kinds[rotary]}. "
        f"Add `scale`, the member's way for 1 {chosen.motor.unit} of the motor."
    )


def units(root: Node, name: str, rotary: bool) -> list[str]:
    """Limits of a member in units of the other kind of axis: degrees of a carriage."""
    problems = []
    for path, item in given_quantities(root, name):
        try:
            number(item.value, UNITS[path][rotary], f"{item.location}: nodes.{name}.{'.'.join(path)}")
        except CouplingError as error:
            problems.append(f"{error} The member {'turns' if rotary else 'moves along a line'}.")
    return problems


def given_quantities(root: Node, name: str) -> Iterator[tuple[tuple[str, ...], Node]]:
    """Yield the quantities of a drive that the file has: key of `UNITS`, and node."""
    for path in UNITS:
        given = root.find(("nodes", name))
        for key in path:
            if key not in given.entries:
                break
            given = given.entries[key]
        else:
            yield from ((path, item) for item in given.items or [given])
