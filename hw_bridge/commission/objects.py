"""Objects of a node for users: by index or by name, in units."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from hw_bridge.commission import object_texts
from hw_bridge.dictionary import Entry, describe_abort_code
from hw_bridge.hardware import format_quantity, without_unit
from hw_bridge.master import Node, SdoError, SilentError, setup
from hw_bridge.profiles import KIND_OF_OBJECT, Measure, acting, measure
from twin.errors import CouplingError, SimulationError, suggestion
from twin.scenario import number

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hw_bridge.dictionary import Value
    from hw_bridge.master import Station

INDEX = re.compile(r"(?:0x)?([0-9A-Fa-f]{4})h?(?:[.:/](\d{1,3}))?")
SOFTWARE_LIMIT = 0x607D
NO_LIMIT = (0xFFFFFFFF, 0x7FFFFFFF, 0x80000000)
OPEN = 0x7FFFFFFF  # from this range on 607Dh is no limit; as a value, any limit of four bytes


def unit_of(node: Station, entry: Entry) -> Measure | None:
    """Unit of an entry of a node; None for plain numbers."""
    if isinstance(node, Node):
        return measure(entry, node.units, node.profile.motor.unit)
    return measure(entry, None, "")


def format_value(node: Station, entry: Entry, value: Value) -> str:
    """Format a value: quantity or text, then the drive's own number."""
    if isinstance(value, str):
        return value
    if entry.index == 0x6041:
        return f"{object_texts.statusword(value, node.mirror.get(0x6061))} ({value:04X}h)"
    if entry.index == 0x6040:
        return f"{object_texts.controlword(value)} ({value:04X}h)"
    if entry.index in (0x6060, 0x6061):
        return f"{object_texts.mode(value)} ({value})"
    if entry.index in (0x603F, 0x1003) and (entry.sub or not entry.title):
        code = value & 0xFFFF
        fault = node.profile.faults.get(code)
        return f"{code:04X}h {fault.meaning if fault else ''}".strip() if code else "none"
    if entry.index == 0x1016 and entry.sub:
        watched, lapse = value >> 16 & 0x7F, value & 0xFFFF  # CiA 301, 7.5.2.16
        return f"node {watched} lost after {lapse} ms ({value:X}h)" if watched and lapse else f"off ({value:X}h)"
    if (unit := unit_of(node, entry)) is not None:
        open_ended = entry.type.size == 4 and (
            abs(value) in NO_LIMIT or (entry.index == SOFTWARE_LIMIT and 2 * abs(value) > OPEN)
        )
        if entry.index == SOFTWARE_LIMIT and value == 0 and getattr(node.profile, "limits_off_when_zero", False):
            return "none if both are 0 (0)"
        assumed = (
            ", scale ASSUMED" if isinstance(node, Node) and node.own.assumed and entry.index in KIND_OF_OBJECT else ""
        )
        return f"{'no limit' if open_ended else format_quantity(value * unit.factor, unit.unit)} ({value}{assumed})"
    return f"{value:X}h" if entry.index < 0x2000 and value > 9 else str(value)


def name(entry: Entry) -> str:
    """Name of an entry for users: `software_position_limit.min_position_limit`."""
    own = slug(entry.label)
    return f"{slug(entry.title)}.{own}" if entry.title else own


def slug(text: str) -> str:
    """Convert to lower case with underscores."""
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


def find(objects: Iterable[Entry], word: str) -> list[Entry]:
    """Find entries by `6064h`, `607Dh.1` or a name; all of a record by its name or index."""
    entries = list(objects)
    if match := INDEX.fullmatch(word):
        index = int(match[1], 16)
        matches = [
            entry for entry in entries if entry.index == index and (match[2] is None or entry.sub == int(match[2]))
        ]
        if not matches and match[2] is None and not any(entry.index == index for entry in entries):
            return []
    else:
        wanted = ".".join(map(slug, word.split(".")))
        matches = [entry for entry in entries if wanted == name(entry)]
        matches = matches or [entry for entry in entries if wanted in (slug(entry.label), slug(entry.title))]
    selected = [item for item in matches if not (item.sub == 0 and item.title and len(matches) > 1)]
    if not matches and not INDEX.fullmatch(word):
        names = {name(entry) for entry in entries if entry.sub or not entry.title}
        near = suggestion(wanted, names) or "Give its index, such as 6085h, or a name of a dump (twin hil dump)."
        raise SimulationError(f"{word}: no such object. {near}")
    return selected


def raw_entry(word: str) -> Entry:
    """Entry for an object that the profile does not have, named by its index: a real drive has more."""
    from hw_bridge.dictionary import U32

    match = INDEX.fullmatch(word)
    assert match is not None
    return Entry(int(match[1], 16), int(match[2] or 0), "not in the profile", U32, "rw")


def upload(node: Station, entry: Entry) -> Value:
    """Read an entry in the node's own size. SdoError if the node refuses."""
    if not entry.type.form:
        return node.sdo.read(entry.index, entry.sub).decode("latin-1").rstrip("\0")
    data = setup.upload(node, entry.index, entry.sub)
    return int.from_bytes(data, "little", signed=entry.type.signed)


def download(node: Station, entry: Entry, value: int) -> None:
    """Write a lasting number, and read it back; a refusal is a one-line error."""
    try:
        setup.write(node, entry.index, entry.sub, value, lasting=True)
    except SilentError as error:
        raise SilentError(f"{node.name}: {error}") from None


def parse_value(node: Station, entry: Entry, text: str) -> int:
    """Parse a number for an entry; range and access are checked before anything is sent."""
    title = f"{entry.index:04X}h.{entry.sub} {entry.label}"
    if entry.index in acting.all_commands():
        raise SimulationError(f"{title}: acts at once. Use twin hil enable, jog, move, store, defaults or lss.")
    if not entry.writable:
        raise SimulationError(f"{title}: can only be read.")
    if not entry.type.form:
        raise SimulationError(f"{title}: is text. Only numbers can be written.")
    value = to_raw(text, unit_of(node, entry), title)
    low, high = entry.type.span
    low = low if entry.low is None else entry.low
    high = high if entry.high is None else entry.high
    if not low <= value <= high:
        ends = " to ".join(format_value(node, entry, end) for end in (low, high))
        raise SimulationError(f"{title}: {text} is outside {ends}.")
    return value


def to_raw(text: str, unit: Measure | None, where: str) -> int:
    """Convert `5 mm`, `26h`, `0x1A`, `150`, or `150 raw` where a unit is expected, to the drive's number."""
    plain = text.strip()
    bare = plain.removesuffix("raw").strip()
    try:
        value = int(bare[:-1], 16) if bare.lower().endswith("h") else int(bare, 0)
    except ValueError:
        value = None  # type: ignore[assignment]
    if value is not None and (unit is None or value == 0 or bare != plain):
        return value
    if unit is None:
        raise SimulationError(f"{where}: expected a whole number such as 150 or 26h, not {text!r}.")
    if value is not None or without_unit(plain):
        raise SimulationError(
            f"{where}: {plain} has no unit. Write it in {unit.unit}, or {plain} raw in the drive's own."
        )
    try:
        return round(number(plain, unit.unit, where) / unit.factor)
    except CouplingError as error:
        raise SimulationError(str(error)) from None


def read_all(node: Station, entries: Iterable[Entry]) -> tuple[dict[tuple[int, int], Value], list[str]]:
    """Read the values of entries; return them, and a line for each that the node refuses."""
    values: dict[tuple[int, int], Value] = {}
    refused = []
    for entry in entries:
        if not entry.readable:
            continue
        try:
            values[entry.index, entry.sub] = upload(node, entry)
        except SdoError as error:
            refused.append(f"{entry.index:04X}h.{entry.sub} {entry.name}: {describe_abort_code(error.code)}")
    return values, refused


def learn(node: Station) -> None:
    """Read the scaling objects of a drive, so that quantities are right."""
    if isinstance(node, Node):
        setup.learn_scaling(node)
