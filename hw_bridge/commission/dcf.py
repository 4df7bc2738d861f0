"""Parameters of a node as a DCF file (CiA 306) and back, through the canopen package."""

from __future__ import annotations

import io
from configparser import Error
from typing import TYPE_CHECKING

from canopen.objectdictionary import ODVariable, eds

from hw_bridge.commission.line import refuse_moving
from hw_bridge.commission.objects import ACTING, download, read_all
from hw_bridge.dictionary import Abort, acting, cia301
from hw_bridge.eds import DATED, canopen_dictionary
from hw_bridge.journal import journal_path
from hw_bridge.master import SdoError, restoration, setup
from twin.errors import DeclarationError, SimulationError
from twin.files import write_atomically

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from hw_bridge.commission.line import Line
    from hw_bridge.dictionary import Entry, Value
    from hw_bridge.master import Station

Values = dict[tuple[int, int], "Value"]
PDOS = range(0x1400, 0x1C00)
HISTORY = 0x1003  # its number of errors is written only to clear it
IDENTITY = {(0x1018, 1): "vendor", (0x1018, 2): "product code"}
LEFT_OUT = {*ACTING, HISTORY, *acting.OUTPUTS[acting.COMMON]}  # outputs: valves, brakes


def dump(node: Station, bit_rate: int) -> tuple[str, list[str]]:
    """The text of a DCF file with all that the node holds, and what it refused."""
    values, refused = read_all(node, [entry for entry in node.mirror.entries() if entry.index not in LEFT_OUT])
    whole = canopen_dictionary(node.mirror.entries())
    for (index, sub), value in values.items():
        variable = whole[index] if isinstance(whole[index], ODVariable) else whole[index][sub]
        variable.value_raw = str(value)
    whole.node_id, whole.bitrate = node.number, bit_rate
    whole.device_information.product_name = node.profile.title
    target = io.StringIO()
    eds.export_dcf(whole, target, dict(DATED))
    return target.getvalue(), refused


def dump_path(node: Station, folder: Path) -> Path:
    """Where the last dump of a drive is kept."""
    return journal_path(folder / "dumps", restoration.identity_of(node)).with_suffix(".dcf")


def keep_dump(node: Station, folder: Path, text: str) -> None:
    """Keep a dump, so that `store` can tell what changed since."""
    path = dump_path(node, folder)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, text.encode("latin-1"))


def last_dump(node: Station, folder: Path) -> Path | None:
    """The last dump of a drive, if there is one."""
    path = dump_path(node, folder)
    return path if path.exists() else None


def load(path: Path, node: int) -> Values:
    """The values of a DCF file. An EDS file has none."""
    advice = "Write one with twin hil dump."
    try:
        text = path.read_text(encoding="latin-1")
        if "[DeviceInfo]" not in text:
            raise ValueError("it has no DeviceInfo")  # noqa: TRY301 - as all else that is wrong with the file
        whole = eds.import_eds(io.StringIO(text), node)
        found = dict(_values(whole.values(), node))
    except OSError as error:
        raise DeclarationError(f"{path}: cannot be read: {error.strerror}. {advice}") from error
    except (ValueError, KeyError, TypeError, AttributeError, Error) as error:
        raise DeclarationError(f"{path}: is not a DCF file: {' '.join(str(error).split())[:120]}. {advice}") from error
    if not found:
        raise DeclarationError(
            f"{path}: has no ParameterValue: an EDS file says what a drive can hold, not what it does. {advice}"
        )
    return found


def _values(objects: Iterator[object], node: int) -> Iterator[tuple[tuple[int, int], Value]]:
    for one in objects:
        for variable in [one] if isinstance(one, ODVariable) else one.subindices.values():  # type: ignore[attr-defined]
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
    """Entry, the node's value and the file's, where they differ and can be written."""
    entries = [node.mirror.objects[index][sub] for index, sub in sorted(wanted)
               if sub in node.mirror.objects.get(index, {}) and index not in LEFT_OUT]  # fmt: skip
    own, _ = read_all(node, entries)
    return [
        (entry, own[place], wanted[place])
        for entry in entries
        if (place := (entry.index, entry.sub)) in own and entry.writable and own[place] != wanted[place]
    ]


def another(node: Station, wanted: Mapping[tuple[int, int], Value]) -> str:
    """That a file is of another kind of drive, or nothing."""
    for (index, sub), what in IDENTITY.items():
        if (index, sub) in wanted and (found := node.sdo.number(index, sub)) != wanted[index, sub]:
            return (
                f"{node.name}: {what} is {found:X}h, the file is of {wanted[index, sub]:X}h. Use a file of this drive."
            )
    return ""


def restore(line: Line, node: Station, wanted: Mapping[tuple[int, int], Value]) -> tuple[list[str], list[str]]:
    """Write what differs, read back; names of what was changed, and a line for each that was refused.

    The node goes to Pre-operational, where mappings may be changed. Nothing is stored.
    """
    refuse_moving(node)
    if problem := another(node, wanted):
        raise SimulationError(problem)
    changes = differences(node, wanted)
    line.nmt(cia301.PRE_OPERATIONAL, node.number)
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
    """A PDO by the procedure of CiA 301: out of use, kind and times, mapping, and back into use if it was.

    Entries beyond the count are written too, where they differ. A line for each of those that the drive refuses: no PDO
    carries them.
    """

    def put(place: int, sub: int, value: int) -> None:
        setup.write(node, place, sub, value, lasting=True)

    identifier = int(wanted[index, 1])
    put(index, 1, identifier | cia301.INVALID)
    for sub in (2, 3, 5):
        entry = node.mirror.objects[index].get(sub)
        if (index, sub) in wanted and entry is not None and entry.writable:
            put(index, sub, int(wanted[index, sub]))
    mapping = index + 0x200
    count = int(wanted.get((mapping, 0), 0))
    put(mapping, 0, 0)
    refused = []
    for place in sorted(sub for number, sub in wanted if number == mapping and sub):
        value = int(wanted[mapping, place])
        try:
            if int.from_bytes(setup.upload(node, mapping, place), "little") != value:
                put(mapping, place, value)
        except SdoError as error:
            if place <= count:
                raise
            refused.append(str(error))
    put(mapping, 0, count)
    put(index, 1, identifier)
    return refused
