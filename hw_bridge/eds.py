"""Object dictionaries as EDS files, through the canopen package."""

from __future__ import annotations

import io
import struct
from configparser import Error
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from canopen import objectdictionary
from canopen.objectdictionary import ODRecord, ODVariable, eds

from hw_bridge.dictionary import TEXT, TYPES, Abort, Dictionary, Entry, NodeId, Value
from hw_bridge.profiles import GENERIC, GivenUnits, generic
from hw_bridge.profiles import profile as profile_of
from twin.errors import DeclarationError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from hw_bridge.profiles import Device, Profile

ACCESS = ("ro", "wo", "rw", "const")
VENDORS = range(0x2000, 0x6000)  # objects that each vendor has as he likes
PDOS = range(0x1400, 0x1C00)
MAPPINGS = (range(0x1600, 0x1800), range(0x1A00, 0x1C00))
NO_UNITS = GivenUnits()
NEEDED = (0x1000, 0x6040, 0x6041, 0x6060, 0x6064)  # of every drive of CiA 402
LONGEST = 160  # characters of what a parser says
DATED = {"CreationDate": "01-01-2026", "CreationTime": "12:00AM", "EdsVersion": "4.0"}
DATED |= {"ModificationDate": DATED["CreationDate"], "ModificationTime": DATED["CreationTime"]}  # same in, same out


def canopen_dictionary(entries: Iterable[Entry]) -> objectdictionary.ObjectDictionary:
    """The entries as the canopen package has them."""
    od = objectdictionary.ObjectDictionary()
    for entry in entries:
        if entry.title:
            if entry.index not in od.indices:
                od.add_object(ODRecord(entry.title, entry.index))
            od[entry.index].add_member(_variable(entry))
        else:
            od.add_object(_variable(entry))
    return od


def _variable(entry: Entry) -> ODVariable:
    variable = ODVariable(entry.name, entry.index, entry.sub)
    variable.data_type = entry.type.code
    variable.access_type = entry.access
    variable.pdo_mappable = entry.mappable
    variable.min, variable.max = entry.low, entry.high
    variable.default = entry.default
    # as text: canopen writes negative numbers in a form that it cannot read
    variable.default_raw = (
        f"$NODEID+{int(entry.default):#x}" if isinstance(entry.default, NodeId) else f"{entry.default}"
    )
    return variable


def export(profile: Profile | Device) -> str:
    """The profile's object dictionary as the text of an EDS file."""
    od = canopen_dictionary(profile.objects)
    od.device_information.product_name = profile.title
    target = io.StringIO()
    eds.export_eds(od, target, dict(DATED))
    lines = target.getvalue().split("\n")
    rates = [i for i, line in enumerate(lines) if line.startswith("BaudRate_")]
    # canopen takes them from a set of constants, whose order is another one once its bytecode is cached
    lines[rates[0] : rates[-1] + 1] = sorted(lines[rates[0] : rates[-1] + 1], key=_baud_rate)
    return "\n".join(lines)


def _baud_rate(line: str) -> int:
    return int(line.removeprefix("BaudRate_").partition("=")[0])


def load(path: Path, own: Iterable[Entry] = ()) -> tuple[Entry, ...]:
    """The entries of an EDS file. Where it has no default, that of a profile's `own` entry counts, else 0."""
    advice = "Write one with `twin drive --profile epos4 --write-eds FILE`."
    own_entries = {(value.index, value.sub): value for value in own}
    try:
        data = path.read_bytes()
        source = io.StringIO(_text(data))
        if not data.strip():
            raise ValueError("it is empty")  # noqa: TRY301 - as all else that is wrong with the file
        od = eds.import_eds(source, None)
        return _with_correct_counts(
            _entry(variable, title, own_entries.get((variable.index, variable.subindex)))
            for title, variable in _variables(od)
        )
    except OSError as error:
        raise DeclarationError(f"{path}: cannot be read: {error.strerror}. {advice}") from error
    except (ValueError, KeyError, TypeError, Error) as error:
        what = " ".join(str(error).split()).replace("'<???>'", "the file")
        raise DeclarationError(f"{path}: is not an EDS file: {what[:LONGEST]}. {advice}") from error


def _with_correct_counts(entries: Iterable[Entry]) -> tuple[Entry, ...]:
    """The entries, with mappings that count no more objects than they name: an EPOS2's file counts an empty one."""
    by_address = {(entry.index, entry.sub): entry for entry in entries}
    for (index, sub), item in by_address.items():
        if sub or not any(index in mapping for mapping in MAPPINGS) or not isinstance(item.default, int):
            continue
        named = 0
        while named < item.default and (entry := by_address.get((index, named + 1))) is not None and entry.default:
            named += 1
        by_address[index, sub] = replace(item, default=named)
    return tuple(by_address.values())


def _text(data: bytes) -> str:
    """Vendors' tools write UTF-8 or Windows' code page."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="strict")


def load_profile(name: str, path: str = "", given: GivenUnits = NO_UNITS) -> Profile:
    """The profile of this name, with the dictionary of an EDS file where there is one. `given`: units that no object states.

    DeclarationError if the file is none of such a drive.
    """
    if not path and name not in GENERIC:
        return profile_of(name).with_units(given)
    content = Path(path).read_bytes() if path and Path(path).is_file() else b""
    return _load_profile(name, path, given, content)


@cache
def _load_profile(name: str, path: str, given: GivenUnits, _content: bytes) -> Profile:
    if name not in GENERIC:
        return adopt(profile_of(name), Path(path))[0].with_units(given)
    if not path:
        raise DeclarationError(f"{name}: which drive is it? Name its EDS file: eds: FILE, of its vendor.")
    profile = generic(load(Path(path)), given, f"{Path(path).name} (CiA 402)")
    if missing := [f"{index:04X}h" for index in NEEDED if index not in Dictionary(profile.objects, 1)]:
        raise DeclarationError(
            f"{path}: is no drive of CiA 402: {', '.join(missing)} missing. Use the file of the drive."
        )
    return profile


def adopt(profile: Profile, path: Path) -> tuple[Profile, list[str]]:
    """The profile with the object dictionary of an EDS file, and warnings: what the file has otherwise.

    A vendor's file counts for the vendor's objects. Of those that CiA defines the profile's types stay: the drive
    computes with them. DeclarationError if the file is of another drive.
    """
    entries, warnings = merged(profile, path)
    changed = replace(profile, objects=entries)
    try:
        dictionary = Dictionary(entries, 1)
        scales = all(scale > 0.0 for scale in (*changed.units(dictionary)[:3], *changed.currents(dictionary)[:2]))
    except (ZeroDivisionError, KeyError, Abort):
        scales = False
    if not scales:
        raise DeclarationError(
            f"{path}: does not state the scale of {profile.title}: an object is missing or 0. Is it the EDS file of another "
            f"drive? Use one of this drive."
        )
    return changed, warnings


def merged(device: Profile | Device, path: Path) -> tuple[tuple[Entry, ...], list[str]]:
    """Merge the entries of a file with the device's, and return a line for each object whose type differs."""
    own = {(entry.index, entry.sub): entry for entry in device.objects}
    entries, warnings = [], []
    for entry in load(path, device.objects):
        before = own.get((entry.index, entry.sub), entry)
        if before.type is entry.type:
            entries.append(entry)
            continue
        vendors = entry.index in VENDORS and bool(entry.type.form) == bool(before.type.form)
        entries.append(entry if vendors else before)
        warnings.append(
            f"{path}: {entry.index:04X}h.{entry.sub} {entry.name} is {entry.type.name}, {device.title} has "
            f"{before.type.name} here. {'The file' if vendors else 'The profile'} counts."
        )
    return tuple(entries), warnings


def _variables(od: objectdictionary.ObjectDictionary) -> Iterator[tuple[str, ODVariable]]:
    for item in od.values():
        if isinstance(item, ODVariable):
            yield "", item
        else:
            yield from ((item.name, item.subindices[sub]) for sub in sorted(item.subindices))


def _entry(variable: ODVariable, title: str, own: Entry | None) -> Entry:
    kind = TYPES.get(variable.data_type or 0, TEXT)
    raw = getattr(variable, "default_raw", "")
    where = f"{variable.index:04X}h.{variable.subindex}"
    if variable.index in PDOS and not kind.form:
        raise ValueError(f"{where}: is {kind.name}, parameters of PDOs are numbers")
    default: Value
    try:
        if "$NODEID" in raw.upper():
            default = NodeId(int(raw.upper().replace(" ", "").replace("$NODEID", "").strip("+") or "0", 0))
        elif not kind.form:
            default = raw
        else:
            default = int(raw, 0) if raw else 0
            if kind.signed and raw.lower().startswith("0x") and default > kind.span[1]:
                default -= 1 << 8 * kind.size  # some write the bits
        if not raw and own is not None and bool(own.type.form) == bool(kind.form):
            default = own.default
        if kind.form:
            struct.pack(kind.form, default)
    except (ValueError, struct.error):
        raise ValueError(f"{where}: the default {raw[:20]} is no {kind.name}") from None
    access = {"rww": "rw", "rwr": "rw"}.get(variable.access_type, variable.access_type)
    if access not in ACCESS:
        raise ValueError(f"{where}: the access {access[:20]} is none of {', '.join(ACCESS)}")
    return Entry(
        variable.index,
        variable.subindex,
        variable.name,
        kind,
        access,
        default,
        variable.min,
        variable.max,
        bool(variable.pdo_mappable),
        title,
    )
