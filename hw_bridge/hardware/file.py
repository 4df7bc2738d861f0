"""The hardware file read and checked, with a line for every problem."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from hw_bridge.bus import Frame, bit_count
from hw_bridge.dictionary import Mode, cia402
from hw_bridge.fault import Cause, problem
from hw_bridge.hardware import contradictions, plausible
from hw_bridge.hardware.keys import (
    MASTER,
    ContactKeys,
    FaultKeys,
    FollowKeys,
    HardwareKeys,
    HeartbeatKeys,
    HomingKeys,
    LateCycleKeys,
    LimitKeys,
    ModuleKeys,
    NodeKeys,
    ShadowKeys,
    UnitKeys,
)
from hw_bridge.profiles import DRIVE_PROFILES, GENERIC, profile, units_without_object
from twin.errors import DeclarationError, ScenarioError, nearest
from twin.scenario import Keys, Node, dotted, quoted, read

BENCHES = Path(__file__).parents[1] / "benches"
PROCESS_DATA = (4, 7, 7, 8, 1)  # bytes of a drive's frames in a cycle: two RPDOs, two TPDOs, a heartbeat
SET_POINT = (7, 2, 2)  # of a drive without csp: the controlword once more, and its statusword as it rises and falls
EXTRA_BYTES = 4  # bytes of digital outputs or a velocity offset in the first RPDO, or in one more
IN_AND_OUT = (4, 1, 1)  # of a module: outputs, inputs, a heartbeat
FORCE_DATA = 2  # bytes of one more RPDO, for a drive with a target force
UNIT_EXAMPLES = {"position": "1 um", "velocity": "1 mm/s", "acceleration": "1 mm/s^2", "current": "1 mA"}
FULL = 0.8  # more leaves no room for what is repeated


def bus_load(keys: HardwareKeys, forces: int = 0) -> float:
    """Largest share of a cycle that process data, SYNC and heartbeats take on the wire. `forces`: drives with target forces."""
    sizes = [size for node in keys.nodes.values() for size in process_data(node)]
    sizes += [size for _ in keys.modules for size in IN_AND_OUT]
    sizes += forces * [FORCE_DATA]
    frames = [*(Frame(0, bytes(size)) for size in sizes), Frame(0), Frame(0, b"0")]
    return sum(map(bit_count, frames)) / keys.bit_rate * 1e9 / keys.cycle


def process_data(node: NodeKeys) -> tuple[int, ...]:
    """Bytes of a drive's frames in a cycle."""
    extra = bool(node.outputs) + node.offset
    first = PROCESS_DATA[0] + min(extra, 1) * EXTRA_BYTES
    handshake = () if Mode.CSP in node.drive.modes else SET_POINT
    return (first, *PROCESS_DATA[1:], *[EXTRA_BYTES] * (extra - 1), *handshake)


def overloaded(keys: HardwareKeys, forces: int = 0) -> str:
    """Problem text if the bus is overloaded, else empty."""
    if (share := bus_load(keys, forces)) <= FULL:
        return ""
    return (
        f"cycle: process data fills {100 * share:.0f} % of {keys.cycle / 1e6:g} ms at {keys.bit_rate} bit/s. "
        f"Make the cycle longer or the bit rate higher."
    )


def resolve_bench(path: Path) -> Path:
    """Resolve a bare name that is no file to the project's bench of this name."""
    own = BENCHES / f"{path.stem}.yaml"
    if path.exists() or not own.exists():
        return path
    if path == Path(path.stem):
        return own
    raise ScenarioError(
        [f"{path}: is not there. A bench of this name came with the project: give the name alone, {path.stem}."]
    )


def load(path: Path) -> HardwareKeys:
    """Read and check a hardware file, or a bench by its name; ScenarioError lists every problem with file and line."""
    path = resolve_bench(path)
    root = read(path, str(path))
    try:
        keys = HardwareKeys.model_validate(root.plain())
    except ValidationError as error:
        raise ScenarioError([line(root, problem_item) for problem_item in error.errors(include_url=False)]) from None
    keys = resolve_eds_paths(keys, path)
    if problems := eds_problems(keys, root):
        raise ScenarioError(problems)
    if problems := check(keys, root) + check_outputs(keys, root) + plausible.check(keys, root):
        raise ScenarioError(problems)
    if problems := contradictions.check(keys, root):
        raise ScenarioError(problems)
    return keys


def resolve_eds_paths(keys: HardwareKeys, path: Path) -> HardwareKeys:
    """Resolve paths of EDS files relative to the hardware file."""
    nodes = {
        name: node.model_copy(update={"eds": str(path.parent / node.eds)}) if node.eds else node
        for name, node in keys.nodes.items()
    }
    return keys.model_copy(update={"nodes": nodes})


def _stated_twice(location: object, name: str, node: NodeKeys) -> list[str]:
    """Units of the file that the drive states itself, or that are of another kind of axis."""
    own = profile(node.profile)
    problems = []
    for kind in sorted(node.units.model_fields_set):
        where = f"{location}: nodes.{name}.units.{kind}: "
        size, symbol = getattr(node.units, kind)
        if kind not in own.unstated_units:
            problems.append(f"{where}{own.title} states its own. Leave it out.")
        elif symbol.partition("/")[0] != own.motor.unit:
            problems.append(f"{where}{size:g} {symbol} is of another kind of axis. Give it in {own.motor.unit}.")
    return problems


def eds_problems(keys: HardwareKeys, root: Node) -> list[str]:
    """Drives whose dictionary or units are unknown."""
    problems = []
    for name, node in keys.nodes.items():
        location = root.find(("nodes", name, "eds" if node.eds else "profile")).location
        try:
            chosen = node.drive
        except DeclarationError as error:
            problems.append(f"{location}: nodes.{name}.eds: {error}")
            continue
        given = node.units.model_fields_set
        if node.profile not in GENERIC:
            problems += _stated_twice(location, name, node)
            continue
        problems += [
            f"{location}: nodes.{name}.units.{kind}: neither the EDS file tells it ({objects}) nor this file. Add it, such as "
            f"units: {{{kind}: {UNIT_EXAMPLES[kind]}}}."
            for kind, objects in units_without_object(chosen.objects).items()
            if kind not in given
        ]
        if node.force_constant is None:
            problems.append(
                f"{location}: nodes.{name}.force_constant: is missing, and no profile knows the motor. Add it, such "
                "as 0.05 N*m/A."
            )
    return problems


def check(keys: HardwareKeys, root: Node) -> list[str]:
    """Problems that involve several keys."""
    from hw_bridge.bus import BIT_RATES

    problems = []
    if not keys.simulated and not (keys.interface and keys.channel):
        problems.append(f"{root.location}: interface and channel are missing. Add them, or `simulated: true`.")
    if keys.bit_rate not in BIT_RATES:
        location = root.find(("bit_rate",)).location
        problems.append(f"{location}: bit_rate: {keys.bit_rate} is none of CANopen's. Use 1000000, 500000, ...")
    elif problem := overloaded(keys):
        problems.append(f"{root.find(('cycle',)).location}: {problem}")
    taken = {keys.master: "this program"}
    for group, name, station in keys.stations():
        where = root.find((group, name, "node")).location
        if station.node in taken:
            problems.append(
                f"{where}: {group}.{name}: node {station.node} is {taken[station.node]} already. Use another node-ID."
            )
        taken[station.node] = f"`{name}`"
        if station.heartbeat.lost_after <= station.heartbeat.every:
            location = root.find((group, name, "heartbeat")).location
            problems.append(
                f"{location}: {group}.{name}.heartbeat: lost_after is not longer than every. Use three times as long."
            )
        if name == MASTER or (group == "modules" and name in keys.nodes):
            problems.append(f"{where}: {group}.{name}: something else has this name. Use another one.")
    for name, node in keys.nodes.items():
        age = node.limits.actual_value_age
        if 0 < age <= keys.cycle:
            location = root.find(("nodes", name, "limits", "actual_value_age")).location
            problems.append(
                f"{location}: nodes.{name}.limits.actual_value_age: {age / 1e6:g} ms is not more than a cycle, which "
                "is the least."
            )
        low, high = node.limits.position
        if low >= high:
            location = root.find(("nodes", name, "limits", "position")).location
            problems.append(
                f"{location}: nodes.{name}.limits.position: the first limit is not below the second. Swap them."
            )
    return problems + check_faults(keys, root)


def check_faults(keys: HardwareKeys, root: Node) -> list[str]:
    """Faults that cannot be injected."""
    return [
        f"{root.find(('faults', index)).location}: faults[{index + 1}]: {text}"
        for index, fault in enumerate(keys.faults)
        if (text := fault_problem(fault, keys))
    ]


def fault_problem(fault: FaultKeys, keys: HardwareKeys) -> str:
    """Return why a fault cannot be injected on a bench, or an empty string."""
    if not keys.simulated:
        return "only a bench with `simulated: true` can have faults. Use twin drive inject."
    names = [*keys.nodes, *keys.modules, MASTER]
    if fault.node not in names:
        return f"no node {fault.node!r}. {nearest(fault.node, names)}"
    chosen = keys.nodes[fault.node].drive if fault.node in keys.nodes else None
    text = problem(fault.made(), chosen, master=fault.node == MASTER)
    return f"{text}." if text else ""


def check_outputs(keys: HardwareKeys, root: Node) -> list[str]:
    """Outputs that the drive does not have, or without `safe_outputs`."""
    problems = []
    for name, node in keys.nodes.items():
        if not node.outputs:
            continue
        where = f"{root.find(('nodes', name, 'outputs')).location}: nodes.{name}.outputs"
        chosen = node.drive
        if not any(entry.index == cia402.OUTPUTS and entry.sub and entry.mappable for entry in chosen.objects):
            problems.append(f"{where}: {chosen.title} has no digital outputs 60FEh.1. Use those of another drive.")
        if node.safe_outputs is None:
            problems.append(f"{where}: what are they after a stop? Add `safe_outputs`, such as `safe_outputs: 0`.")
    return problems


def line(root: Node, error: Any, model: type[Keys] | None = None) -> str:
    """Format a problem of pydantic's as one line. `model`: type of `root`; None: a hardware file."""
    path = tuple(error["loc"])
    location, what = root.find(path).location, dotted(path)
    kind, given = error["type"], error["input"]
    if kind == "extra_forbidden":
        return f"{location}: {what}: unknown key.{_near(path, model)}"
    if kind == "missing":
        return f"{location}: {what}: is missing. Add it."
    if kind in ("model_type", "dict_type"):
        begin = f"{what}: " if what else ""
        return f"{location}: {begin}expected keys with values, such as `node: 1`, not {quoted(given)}. Correct it."
    if kind == "literal_error" and path[-1] == "profile":
        return f"{location}: {what}: {quoted(given)} is no drive profile. {nearest(str(given), [*DRIVE_PROFILES, *GENERIC])}"
    if kind == "literal_error" and path[-1] == "fault":
        return (
            f"{location}: {what}: {quoted(given)} is no fault. {nearest(str(given), [str(cause) for cause in Cause])}"
        )
    text = error["msg"].removeprefix("Value error, ").rstrip(".")
    return f"{location}: {what}: {text[0].lower()}{text[1:]}" + (
        "." if kind == "value_error" else f", not {quoted(given)}. Correct it."
    )


KEYS: dict[str, type[Keys]] = {
    "limits": LimitKeys,
    "heartbeat": HeartbeatKeys,
    "late_cycle": LateCycleKeys,
    "homing": HomingKeys,
    "follow": FollowKeys,
    "contact": ContactKeys,
    "faults": FaultKeys,
    "shadow": ShadowKeys,
    "units": UnitKeys,
    "modules": ModuleKeys,
}


def _near(path: tuple[str | int, ...], model: type[Keys] | None) -> str:
    """Suggest the most similar key."""
    parents = [str(key) for key in path[:-1] if isinstance(key, str)]
    group = ModuleKeys if parents[:1] == ["modules"] else NodeKeys
    model = KEYS.get(parents[-1], group) if parents else model or HardwareKeys
    return " " + nearest(str(path[-1]), list(model.model_fields))
