"""Values of a hardware file that contradict each other: with them a run could only fail, or a limit would never act."""

from __future__ import annotations

from itertools import pairwise
from math import pi, sin
from typing import TYPE_CHECKING

from hw_bridge.dictionary import cia401
from hw_bridge.hardware.homing_checks import homing_conflict, search_direction
from hw_bridge.hardware.keys import ModuleKeys
from hw_bridge.hardware.plausible import UNITS, given_quantities
from hw_bridge.hardware.quantities import TARGET_SHARE, format_quantity, parse
from hw_bridge.profiles import SCALING, acting, device
from twin.scenario import dotted

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from hw_bridge.hardware.keys import HardwareKeys, NodeKeys
    from twin.scenario import Node

Problem = tuple[tuple[str, ...], str]  # the key that it is about, and its text
DRIVE_DELAY = 5_000_000  # until a drive moves at a new target velocity: transmission and its own loop, estimate [ns]
GAIN_MARGIN = 2.0  # 6 dB
WRITTEN_BY_RUN = {  # objects whose value follows from another key
    0x1016: "heartbeat",
    0x1017: "heartbeat",
    0x6065: "limits.following_error",
    0x607D: "limits.position",
    0x607F: "limits.velocity",
    0x6080: "limits.velocity",
    0x6081: "limits.velocity",
    0x6083: "limits.acceleration",
    0x6084: "limits.acceleration",
    0x6085: "limits.acceleration",
    0x6098: "homing",
    0x6099: "homing",
    0x60C2: "cycle",
    0x60FE: "safe_outputs",
    **dict.fromkeys((cia401.OUTPUTS, cia401.ERROR_MODE, cia401.ERROR_VALUE), "safe_outputs"),
}
PDO_PARAMETERS = range(0x1400, 0x1C00)


def max_gain(cycle: int) -> float:
    """Largest gain of the position loop that this program closes in csv, with a gain margin of 6 dB [1/s].

    x[k+1] = x[k] - h K x[k-n] is stable for h K < 2 sin(pi / (4 n + 2)) (Levin and May, J. Math. Biology 3, 1976). The delay
    of n cycles of h is one cycle until a measured position acts, and the drive's.
    """
    delay = 1.0 + DRIVE_DELAY / cycle
    return 2.0 * sin(pi / (4.0 * delay + 2.0)) / (cycle / 1e9) / GAIN_MARGIN


def gain_problem(gain: float, cycle: int) -> str:
    """Problem text if the position loop in csv is unstable, or nearly so; else empty."""
    if gain <= (most := max_gain(cycle)):
        return ""
    return (
        f"{gain:g} 1/s is too much at a cycle of {cycle / 1e6:g} ms: the position loop is unstable from about "
        f"{GAIN_MARGIN * most:.0f} 1/s. Use at most {int(most)} 1/s, or a shorter cycle."
    )


def check(keys: HardwareKeys, root: Node) -> list[str]:
    """Return a line for each contradiction."""
    lines = []
    if keys.simulated and (keys.interface or keys.channel):
        where = root.find(("simulated",)).location
        lines.append(f"{where}: simulated: with `true` there is no interface and no channel. Leave one of them out.")
    for name, node in keys.nodes.items():
        if problems := _kinds(root, name):
            unit = ""
        else:
            unit = _unit(root, name, node)
            problems = [*_pairs(keys, node, unit), *_contact(keys, node, unit), *_objects(node), *_scaling(node)]
        lines += _format(root, ("nodes", name), problems)
    for name, module in keys.modules.items():
        lines += _format(root, ("modules", name), _objects(module))
    return lines


def _format(root: Node, parents: tuple[str, str], problems: Iterable[Problem]) -> list[str]:
    """A line for each problem of a drive or module."""
    return [f"{root.find((*parents, *path)).location}: {dotted((*parents, *path))}: {text}" for path, text in problems]


def _given(root: Node, name: str) -> Iterator[tuple[tuple[str, ...], int, str]]:
    """Quantities of a drive in the file: key, index of its unit in `UNITS` (0: line, 1: turn), and text. Zero has no unit."""
    for path, item in given_quantities(root, name):
        value, symbol = parse(item.value, UNITS[path])
        if value:
            yield path, UNITS[path].index(symbol), str(item.value)


def _kinds(root: Node, name: str) -> list[Problem]:
    """Units of a line and of a turn in one drive."""
    kinds = ("of one that moves along a line", "of an axis that turns")
    for (_, kind, text), (path, other, other_text) in pairwise(_given(root, name)):
        if kind != other:
            return [(path, f"`{other_text}` is {kinds[other]}, `{text}` {kinds[kind]}. Use units of one kind.")]
    return []


def _unit(root: Node, name: str, node: NodeKeys) -> str:
    """Unit of the member's positions: that of the file's quantities, else of the motor."""
    kind = next((kind for _, kind, _ in _given(root, name)), None)
    return node.drive.motor.unit if kind is None else ("m", "rad")[kind]


def _pairs(keys: HardwareKeys, node: NodeKeys, unit: str) -> Iterator[Problem]:
    """Limits, heartbeat, homing and tracking of a drive."""
    limits, (low, high) = node.limits, node.limits.position
    room = high - low
    speed, age = limits.velocity, limits.actual_value_age
    if node.heartbeat.lost_after <= keys.cycle:
        text = "lost_after is not more than a cycle, by which this program may be late. Lengthen it."
        yield ("heartbeat",), text
    if age > node.heartbeat.lost_after:
        text = f"{age / 1e6:g} ms is more than heartbeat.lost_after, which ends a run before. Shorten it."
        yield ("limits", "actual_value_age"), text
    # without a mode the member's counts, which is not known here: in csp a drive without targets stands
    alone = speed * (node.heartbeat.lost_after / 1e9 if node.follow.mode == "csv" else 0.0)
    alone += 0.5 * speed**2 / limits.acceleration
    if alone >= room:
        text = (
            f"at {format_quantity(speed, f'{unit}/s')} a drive that misses the heartbeat goes {format_quantity(alone, unit)} until "
            f"it stands, and limits.position are {format_quantity(room, unit)} apart. Lower limits.velocity or "
            "heartbeat.lost_after, or raise limits.acceleration."
        )
        yield ("limits",), text
    if (step := speed * keys.cycle / 1e9) >= limits.following_error:
        text = (
            f"{format_quantity(limits.following_error, unit)} is no more than a cycle of {keys.cycle / 1e6:g} ms takes at "
            f"limits.velocity, {format_quantity(step, unit)}. Make it larger, or the velocity smaller."
        )
        yield ("limits", "following_error"), text
    if node.homing is not None:
        if conflict := homing_conflict(node, lambda value: format_quantity(value, unit)):
            yield ("homing",), conflict
        elif search_direction(node) and (time := room / node.homing.speed) > node.homing.timeout / 1e9:
            text = f"{node.homing.timeout / 1e9:g} s are less than the {time:.3g} s from one limit to the other. Lengthen it."
            yield ("homing", "timeout"), text
    if node.follow.mode == "csv" and "gain" in node.follow.model_fields_set:
        if problem := gain_problem(node.follow.gain, keys.cycle):
            yield ("follow", "gain"), problem
    if node.shadow is not None and node.shadow.window < keys.cycle:
        yield ("shadow", "window"), f"{node.shadow.window / 1e6:g} ms is shorter than a cycle. Lengthen it."


def _contact(keys: HardwareKeys, node: NodeKeys, unit: str) -> Iterator[Problem]:
    """The contact force and its retraction."""
    contact, limits = node.contact, node.limits
    if contact is None:
        return
    if not node.watch_contact:
        yield ("watch_contact",), "is false, and `contact` names a force to monitor. Leave one of them out."
    if "speed" in contact.model_fields_set and contact.speed > TARGET_SHARE * limits.velocity:
        text = (
            f"{format_quantity(contact.speed, f'{unit}/s')} is more than {100 * TARGET_SHARE:g} % of limits.velocity, "
            f"{format_quantity(limits.velocity, f'{unit}/s')}: a drive overshoots, and the limit would end the retraction. Lower it."
        )
        yield ("contact", "speed"), text
    if contact.distance >= limits.position[1] - limits.position[0]:
        yield ("contact", "distance"), "is not less than limits.position are apart. Shorten it."
    if node.watch_force and contact.above >= limits.force:
        newton = "N" if unit == "m" else "N m"
        text = f"{contact.above:g} {newton} is not below limits.force, {limits.force:g} {newton}: it would stop without retracting."
        yield ("contact", "above"), f"{text} Lower it."
    if contact.silent_for <= keys.cycle:
        text = f"{contact.silent_for / 1e6:g} ms is not more than a cycle: every force looks stuck. Lengthen it."
        yield ("contact", "silent_for"), text


def _objects(station: NodeKeys | ModuleKeys) -> Iterator[Problem]:
    """Objects that a run writes from another key, and those that switch outputs: set-up and restoration would switch them."""
    described = device(station.profile) if isinstance(station, ModuleKeys) else station.drive
    for index, sub in station.objects:
        if key := "process data" if index in PDO_PARAMETERS else WRITTEN_BY_RUN.get(index):
            yield ("objects",), f"{index:04X}h.{sub}: a run writes it, as {key} says. Leave it out."
        elif acting.sets_output(described, index):
            text = f"{index:04X}h.{sub}: switches outputs, such as a brake, before a run and again when it is restored after it. "
            advice = f"Set it once: twin hil set {station.node} {index:04X}h.{sub} VALUE --arm --store."
            yield ("objects",), f"{text}{advice}"


def _scaling(node: NodeKeys) -> Iterator[Problem]:
    """Scaling objects that no length follows from."""
    profile = node.drive
    scaling_objects = {*SCALING, *(index for index, _ in (*profile.scaling, *profile.optional_scaling))}
    for index, sub in node.scaling:
        if index not in scaling_objects:
            yield ("scaling",), f"{index:04X}h.{sub}: no length or current of a drive follows from it. Correct it."
