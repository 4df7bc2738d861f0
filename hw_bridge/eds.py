"""Object dictionaries as EDS files, through the canopen package."""

from __future__ import annotations

import io
from configparser import Error
from typing import TYPE_CHECKING

from canopen import objectdictionary
from canopen.objectdictionary import ODRecord, ODVariable, eds

from hw_bridge.dictionary import TEXT, TYPES, Entry, NodeId, Value
from twin.errors import DeclarationError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from hw_bridge.profile import Device, Profile

DATED = {"CreationDate": "01-01-2026", "CreationTime": "12:00AM", "EdsVersion": "4.0"}
DATED |= {"ModificationDate": DATED["CreationDate"], "ModificationTime": DATED["CreationTime"]}  # same in, same out


def canopen_dictionary(entries: Iterable[Entry]) -> objectdictionary.ObjectDictionary:
    """The entries as the canopen package has them."""
    whole = objectdictionary.ObjectDictionary()
    for entry in entries:
        if entry.title:
            if entry.index not in whole.indices:
                whole.add_object(ODRecord(entry.title, entry.index))
            whole[entry.index].add_member(_variable(entry))
        else:
            whole.add_object(_variable(entry))
    return whole


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
    whole = canopen_dictionary(profile.objects)
    whole.device_information.product_name = profile.title
    target = io.StringIO()
    eds.export_eds(whole, target, dict(DATED))
    return target.getvalue()


def load(path: Path) -> tuple[Entry, ...]:
    """The entries of an EDS file."""
    try:
        whole = eds.import_eds(str(path), None)
    except (OSError, ValueError, KeyError, Error) as error:
        raise DeclarationError(f"{path}: is not an EDS file: {error}. Export one with `eds.export`.") from error
    return tuple(_entry(variable, title) for title, variable in _variables(whole))


def _variables(whole: objectdictionary.ObjectDictionary) -> Iterator[tuple[str, ODVariable]]:
    for one in whole.values():
        if isinstance(one, ODVariable):
            yield "", one
        else:
            yield from ((one.name, one.subindices[sub]) for sub in sorted(one.subindices))


def _entry(variable: ODVariable, title: str) -> Entry:
    kind = TYPES.get(variable.data_type or 0, TEXT)
    raw = getattr(variable, "default_raw", "")
    default: Value
    if "$NODEID" in raw.upper():
        default = NodeId(int(raw.upper().replace(" ", "").replace("$NODEID", "").strip("+") or "0", 0))
    elif kind is TEXT:
        default = raw
    else:
        default = int(raw, 0) if raw else 0
    access = {"rww": "rw", "rwr": "rw"}.get(variable.access_type, variable.access_type)
    return Entry(
        variable.index, variable.subindex, variable.name, kind, access, default, variable.min, variable.max,
        bool(variable.pdo_mappable), title,
    )  # fmt: skip
