"""Parameters of a node as a DCF file (CiA 306) and back, through the canopen package."""

from __future__ import annotations

import io
import re
from configparser import Error
from typing import TYPE_CHECKING

from canopen.objectdictionary import ODVariable, eds

from hw_bridge.commission.objects import download, read_all
from hw_bridge.commission.sdo_session import assert_not_driven
from hw_bridge.dictionary import Abort, cia301
from hw_bridge.eds import DATED, canopen_dictionary
from hw_bridge.journal import journal_path
from hw_bridge.master import SdoError, restoration, setup
from hw_bridge.profiles import acting
from twin.errors import DeclarationError, SimulationError
from twin.files import write_atomically

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from hw_bridge.commission.sdo_session import SdoSession
    from hw_bridge.dictionary import Entry, Value
    from hw_bridge.master import Station

Values = dict[tuple[int, int], "Value"]
PDOS = range(0x1400, 0x1C00)
HISTORY = 0x1003  # its number of errors is written only to clear it
OUTPUT = re.compile(r"^([0-9A-F]{4})sub(\d+)=(-?\d+)$", re.MULTILINE)  # in the comments of a dump
IDENTITY = {(0x1018, 1): "vendor", (0x1018, 2): "product code"}


def left_out() -> frozenset[int]:
    """Objects that are neither dumped nor compared: those that act at once, and the error history."""
    return acting.all_commands() | {HISTORY}


def output_notes(node: Station, wanted: Mapping[tuple[int, int], Value]) -> list[str]:
    """Return a line for each output that differs: outputs are compared, but not restored."""
    outputs = {address: value for address, value in wanted.items() if address[0] in acting.OUTPUTS}
    return [
        f"{entry.index:04X}h.{entry.sub} {entry.name} differs; outputs are not restored: they would switch."
        for entry, _, _ in differences(node, outputs)
    ]


def dump(node: Station, bit_rate: int) -> tuple[str, list[str]]:
    """Return the text of a DCF file with all values of the node, and a line for each object that it refused.

    Outputs are in its comments: another tool that downloads the file does not switch them.
    """
    values, refused = read_all(node, [entry for entry in node.mirror.entries() if entry.index not in left_out()])
    od = canopen_dictionary(node.mirror.entries())
    od.comments = "\n".join(f"{i:04X}sub{sub}={value}" for (i, sub), value in values.items() if i in acting.OUTPUTS)
    for (index, sub), value in values.items():
        if index in acting.OUTPUTS:
            continue
        variable = od[index] if isinstance(od[index], ODVariable) else od[index][sub]
        variable.value_raw = str(value)
    od.node_id, od.bitrate = node.number, bit_rate
    od.device_information.product_name = node.profile.title
    target = io.StringIO()
    eds.export_dcf(od, target, dict(DATED))
    return target.getvalue(), refused


def dump_path(node: Station, folder: Path) -> Path:
    """Path of a drive's last dump."""
    return journal_path(folder / "dumps", restoration.identity_of(node)).with_suffix(".dcf")


def save_dump(node: Station, folder: Path, text: str) -> None:
    """Save a dump, so that `store` can report what changed since."""
    path = dump_path(node, folder)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, text.encode("latin-1"))


def last_dump(node: Station, folder: Path) -> Path | None:
    """The last dump of a drive, if there is one."""
    path = dump_path(node, folder)
    return path if path.exists() else None


def load(path: Path, node: int) -> Values:
    """Read the values of a DCF file. An EDS file has none."""
    advice = "Write one with twin hil dump."
    try:
        text = path.read_text(encoding="latin-1")
        if "[DeviceInfo]" not in text:
            raise ValueError("it has no DeviceInfo")  # noqa: TRY301 - as all else that is wrong with the file
        od = eds.import_eds(io.StringIO(text), node)
        values = dict(_values(od.values(), node))
        for index, number, value in OUTPUT.findall(od.comments):
            values[int(index, 16), int(number)] = int(value)
    except OSError as error:
        raise DeclarationError(f"{path}: cannot be read: {error.strerror}. {advice}") from error
    except (ValueError, KeyError, TypeError, AttributeError, Error) as error:
        raise DeclarationError(f"{path}: is not a DCF file: {' '.join(str(error).split())[:120]}. {advice}") from error
    if not values:
        raise DeclarationError(
            f"{path}: has no ParameterValue: an EDS file says what a drive can hold, not what it does. {advice}"
        )
    return values


def _values(objects: Iterator[object], node: int) -> Iterator[tuple[tuple[int, int], Value]]:
    for item in objects:
        for variable in [item] if isinstance(item, ODVariable) else item.subindices.values():  # type: ignore[attr-defined]
            raw = getattr(variable, "value_raw", None)
            if raw is None:
                continue
            is_text = variable.data_type not in range(0x01, 0x08) and variable.data_type not in (0x15, 0x1B)
            if is_text:
                yield (variable.index, variable.subindex), raw
                continue
            offset = node if "$NODEID" in raw.upper() else 0
            text = raw.upper().replace("$NODEID", "").strip("+ ") or "0"
            yield (variable.index, variable.subindex), int(text, 0) + offset


def differences(node: Station, wanted: Mapping[tuple[int, int], Value]) -> list[tuple[Entry, Value, Value]]:
    """Return entry, the node's value and the file's, where they differ and can be written."""
    entries = [
        node.mirror.objects[index][sub]
        for index, sub in sorted(wanted)
        if sub in node.mirror.objects.get(index, {}) and index not in left_out()
    ]
    stored, _ = read_all(node, entries)
    return [
        (entry, stored[address], wanted[address])
        for entry in entries
        if (address := (entry.index, entry.sub)) in stored and entry.writable and stored[address] != wanted[address]
    ]


def identity_mismatch(node: Station, wanted: Mapping[tuple[int, int], Value]) -> str:
    """Problem text if a file belongs to another kind of drive, else empty."""
    for (index, sub), what in IDENTITY.items():
        if (index, sub) in wanted and (value := node.sdo.number(index, sub)) != wanted[index, sub]:
            return (
                f"{node.name}: {what} is {value:X}h, the file is of {wanted[index, sub]:X}h. Use a file of this drive."
            )
    return ""


def restore(
    sdo_session: SdoSession,
    node: Station,
    wanted: Mapping[tuple[int, int], Value],
    check: Callable[[Entry], None] = lambda _: None,
) -> tuple[list[str], list[str]]:
    """Write and read back what differs; return names of changed objects, and a line for each refused one.

    `check` raises SimulationError for an entry that may not be written; it is called for all before the first write. The
    node goes to Pre-operational, where mappings may be changed. Nothing is stored.
    """
    assert_not_driven(node)
    if problem := identity_mismatch(node, wanted):
        raise SimulationError(problem)
    changes = [change for change in differences(node, wanted) if change[0].index not in acting.OUTPUTS]
    for entry, _, _ in changes:
        check(entry)
    sdo_session.nmt(cia301.PRE_OPERATIONAL, node.number)
    changed, refused = [], []
    for entry, _, value in changes:
        if entry.index in PDOS or isinstance(value, str):
            continue
        try:
            download(node, entry, value)
            changed.append(f"{entry.index:04X}h.{entry.sub} {entry.name}")
        except (SdoError, Abort, SimulationError) as error:
            refused.append(str(error))
    for number in sorted({entry.index & ~0x200 for entry, _, _ in changes if entry.index in PDOS}):
        try:
            refused += _restore_pdo(node, number, wanted)
            changed.append(f"{number:04X}h {node.mirror.objects[number][1].title}")
        except SimulationError as error:
            refused.append(str(error))
    return changed, refused


def _restore_pdo(node: Station, index: int, wanted: Mapping[tuple[int, int], Value]) -> list[str]:
    """Restore a PDO by the procedure of CiA 301: disable, kind and times, mapping, enable if it was.

    Entries beyond the count are written too, where they differ. Returns a line for each of those that the drive refuses: no PDO
    carries them. A COB-ID or count that the file does not have stays the drive's.
    """

    def target_value(target: int, sub: int) -> int:
        if (target, sub) in wanted:
            return int(wanted[target, sub])
        return int.from_bytes(setup.upload(node, target, sub), "little")

    def put(target: int, sub: int, value: int) -> None:
        setup.write(node, target, sub, value, lasting=True)

    identifier, count = target_value(index, 1), target_value(index + 0x200, 0)
    put(index, 1, identifier | cia301.INVALID)
    for sub in (2, 3, 5):
        entry = node.mirror.objects[index].get(sub)
        if (index, sub) in wanted and entry is not None and entry.writable:
            put(index, sub, int(wanted[index, sub]))
    mapping = index + 0x200
    put(mapping, 0, 0)
    refused = []
    for target in sorted(sub for number, sub in wanted if number == mapping and sub):
        value = int(wanted[mapping, target])
        try:
            if int.from_bytes(setup.upload(node, mapping, target), "little") != value:
                put(mapping, target, value)
        except SdoError as error:
            if target <= count:
                raise
            refused.append(str(error))
    put(mapping, 0, count)
    put(index, 1, identifier)
    return refused
