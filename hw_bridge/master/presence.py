"""Objects of a run that a drive does not have: optional ones are left out and noted, required ones are refused.

A profile or an EDS file is a claim. The drive is read; "no such object" counts as missing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from hw_bridge.dictionary import Mode, supported
from hw_bridge.master.pdo_mapping import CONTROL, FORCE, OFFSET, PDOS, SUBSTITUTES, takes_set_points
from hw_bridge.master.sdo import MISSING, SdoError
from hw_bridge.master.writes import upload

if TYPE_CHECKING:
    from hw_bridge.master.node import Node

MODES_OFFERED, CURRENT_NAMES = 0x6502, "6077h, 6078h"
ALONE = "is watched by this program in each cycle, and by nothing in the drive"


class Requirement(NamedTuple):
    """An object of a run: the subindex that is read, its name, and the consequence of its absence."""

    sub: int
    name: str
    consequence: str


OPTIONAL = {
    0x6007: Requirement(
        0,
        "Abort connection option code",
        "what it does when this program's heartbeat is missing is its own choice: try it",
    ),
    0x603F: Requirement(0, "Error code", "errors are told by EMCY and 1003h"),
    0x6061: Requirement(0, "Modes of operation display", "that another program changed its mode is not noticed"),
    0x6065: Requirement(0, "Following error window", f"limits.following_error {ALONE}"),
    0x607D: Requirement(1, "Software position limit", f"limits.position {ALONE}"),
    0x607F: Requirement(0, "Max profile velocity", "limits.velocity acts on targets and is watched by this program"),
    0x6080: Requirement(0, "Max motor speed", "limits.velocity acts on targets and is watched by this program"),
    0x6081: Requirement(
        0, "Profile velocity", "limits.velocity does not bound set-points of profile position in the drive"
    ),
    0x6083: Requirement(0, "Profile acceleration", "its ramps of profile modes are its own"),
    0x6084: Requirement(0, "Profile deceleration", "its ramps of profile modes are its own"),
    0x6085: Requirement(0, "Quick stop deceleration", "how it brakes at a stop is its own choice: try it at low speed"),
    0x60C2: Requirement(1, "Interpolation time period", "whether it interpolates between targets in csp is not known"),
    0x60FE: Requirement(1, "Digital outputs", "a run can switch none of its outputs"),
    MODES_OFFERED: Requirement(0, "Supported drive modes", "the modes of its profile are taken for its own"),
}
REQUIRED = {
    0x1016: Requirement(
        1, "Consumer heartbeat time", "nothing would stop it when this program dies (node guarding is not supported)"
    ),
    0x1017: Requirement(0, "Producer heartbeat time", "that it is gone could not be noticed"),
    0x6040: Requirement(0, "Controlword", "it cannot be enabled or stopped"),
    0x6041: Requirement(0, "Statusword", "its state is not known"),
    0x6060: Requirement(0, "Modes of operation", "its mode cannot be set"),
    0x6064: Requirement(0, "Position actual value", "limits.position cannot be watched"),
    0x606C: Requirement(0, "Velocity actual value", "limits.velocity cannot be watched"),
    0x607A: Requirement(0, "Target position", "it cannot be held or moved by positions"),
}
HOMING = {
    0x6098: Requirement(0, "Homing method", "it cannot home: leave `homing` out"),
    0x6099: Requirement(1, "Homing speeds", "how fast it would search is not known: leave `homing` out"),
}
MAPPED = (0x6040, 0x6041, 0x6060, 0x6064, 0x606C, 0x607A)  # have to go with process data


class Findings(NamedTuple):
    """`notes`: what is left out, and what acts instead; `problems`: why the drive cannot be run."""

    notes: list[str]
    problems: list[str]


def learn_objects(node: Node) -> Findings:
    """Read the objects that a run uses; missing ones are removed from `node.mirror`. Only reads."""
    notes = []
    required = REQUIRED | (HOMING if node.keys.homing is not None else {})
    absent = {index for index, need in (OPTIONAL | required).items() if not _has(node, index, need.sub)}
    for number in PDOS:
        for index, sub in ((0x1400 + number, 1), (0x1600 + number, 0), (0x1800 + number, 1), (0x1A00 + number, 0)):
            _has(node, index, sub)
    words = (*CONTROL, *FORCE, *OFFSET, *(word for word, _ in node.profile.current_objects))
    for word in words:  # process data
        _has(node, word >> 16, word >> 8 & 0xFF)
    _learn_modes(node)
    node.absent = frozenset(absent)
    if node.mode_problem:  # until it is told something, it holds its place
        node.mode = Mode.CSP
    for index, need in OPTIONAL.items():
        needless = index == 0x60C2 and takes_set_points(node.mirror)
        if index in absent and not needless:
            notes.append(f"{node.name}: has no {index:04X}h {need.name}: {need.consequence}.")
    problems = [
        f"{node.name}: has no {index:04X}h {need.name}: {need.consequence}."
        for index, need in required.items()
        if index in absent
    ]
    node.use_process_data()
    more = _mode_findings(node)
    return Findings(notes + more.notes, problems + more.problems + _process_data_problems(node, absent))


def _has(node: Node, index: int, sub: int) -> bool:
    """Whether the drive has an object; a missing one is removed."""
    if not node.mirror.find(index, sub):
        return False
    try:
        upload(node, index, sub)
    except SdoError as error:
        if error.code in MISSING:
            node.mirror.remove(index)
            return False
    return True


def _learn_modes(node: Node) -> None:
    """Read 6502h; the profile's modes where the drive does not have it."""
    if MODES_OFFERED in node.mirror:
        data = upload(node, MODES_OFFERED)
        node.mirror.values[MODES_OFFERED, 0] = int.from_bytes(data, "little")
    else:
        node.mirror.values[MODES_OFFERED, 0] = supported(*node.profile.modes)


def _mode_findings(node: Node) -> Findings:
    """Modes that are missing together with their substitutes."""
    offered = f"6502h is {node.mirror.get(MODES_OFFERED):X}h"
    notes, problems = [], []
    if not node.offers(Mode.CSP) and not node.offers(SUBSTITUTES[Mode.CSP]):
        problems.append(f"{node.name}: has neither csp nor pp ({offered}): it cannot be held at a position.")
    if not node.offers(Mode.CSV) and not node.offers(SUBSTITUTES[Mode.CSV]):
        notes.append(
            f"{node.name}: has neither csv nor pv ({offered}): a member that is told speeds needs `follow: {{mode: csp}}`, and a "
            f"contact ends a run without a retraction."
        )
    elif 0x60FF not in node.mirror:
        problems.append(f"{node.name}: has no 60FFh Target velocity: its velocity modes ({offered}) cannot be used.")
    if node.has_target_force and not node.offers(Mode.CST):
        problems.append(f"{node.name}: is told a force, but has no cst: {offered}. Use another drive.")
    if node.keys.homing is not None and not node.offers(Mode.HM):
        problems.append(f"{node.name}: has no homing mode ({offered}): leave `homing` out.")
    return Findings(notes, problems)


def _process_data_problems(node: Node, absent: set[int]) -> list[str]:
    """Return why process data cannot be exchanged as a run needs them."""
    data, problems, mirror = node.process_data, [], node.mirror
    for index in MAPPED:
        if index not in absent and index in mirror and not mirror.objects[index][0].mappable:
            problems.append(f"{index:04X}h cannot be mapped to process data")
    for kind, start, maps in (("RPDO", 0x1400, data.receive), ("TPDO", 0x1800, data.transmit)):
        for number, words in enumerate(maps):
            if words:
                problems += _pdo_problems(node, f"{kind} {number + 1}", start + number, len(words))
    if not data.current and node.keys.watch_force:
        problems.append(
            f"it tells no current ({CURRENT_NAMES}): limits.force cannot be watched. Add `watch_force: false` if something else "
            f"bounds the force"
        )
    wanted = node.keys.outputs or node.keys.safe_outputs is not None
    if wanted and 0x60FE not in mirror:
        problems.append("it has no 60FEh Digital outputs: leave outputs and safe_outputs out")
    return [f"{node.name}: {text}." for text in problems]


def _pdo_problems(node: Node, title: str, index: int, count: int) -> list[str]:
    mirror = node.mirror
    if index not in mirror or index + 0x200 not in mirror:
        return [f"it has no {title} ({index:04X}h), which a run needs"]
    entries = mirror.objects[index + 0x200]
    fixed = [
        entry
        for entry in (mirror.objects[index].get(1), entries.get(0), entries.get(1))
        if entry and not entry.writable
    ]
    if fixed:
        return [f"{title} is fixed ({index:04X}h, {index + 0x200:04X}h cannot be written)"]
    return [f"{title} has room for {len(entries) - 1} objects, a run needs {count}"] if len(entries) - 1 < count else []
