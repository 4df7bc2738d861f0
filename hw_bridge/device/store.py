"""A file as the non-volatile memory of a device: JSON, a line for each object, written atomically."""

from __future__ import annotations

import json
import re
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from hw_bridge.dictionary import Abort
from twin.errors import DeclarationError
from twin.results import write_text

if TYPE_CHECKING:
    from pathlib import Path

    from hw_bridge.dictionary import Dictionary, Entry, Value

OBJECT = re.compile(r"([0-9A-Fa-f]{4})h\.(\d{1,3})")
APPLICATION = 0x2000  # objects from here on
LARGEST = 1_000_000  # bytes
Values = dict[tuple[int, int], "Value"]


@dataclass(frozen=True)
class Store:
    """Memory file of one device: of a profile, at a node-ID, since that is in the COB-IDs."""

    path: Path
    profile: str
    node: int

    def write(self, dictionary: Dictionary, values: Values) -> None:
        """Write values to the file; OSError if that is not possible."""
        rows = []
        for (index, sub), value in sorted(values.items()):
            entry = dictionary.entry(index, sub)
            name = f"{entry.title}: {entry.name}" if entry.title else entry.name
            rows.append(json.dumps({"object": f"{index:04X}h.{sub}", "value": value, "name": name}, ensure_ascii=False))
        head = f'{{"profile": {json.dumps(self.profile)}, "node": {self.node}, "objects": ['
        write_text(self.path, head + ",".join(f"\n  {row}" for row in rows) + "\n]}\n")

    def read(self, dictionary: Dictionary) -> Values:
        """Read the values, each one that a client could have stored; DeclarationError says what is wrong."""
        try:
            with self.path.open("rb") as file:
                data = file.read(LARGEST + 1)
        except FileNotFoundError:
            if not self.path.parent.is_dir():
                raise DeclarationError(f"{self.path}: there is no folder {self.path.parent}. Make it first.") from None
            return {}
        except OSError as error:
            raise DeclarationError(f"{self.path}: cannot be read: {error.strerror}. Name another file.") from None
        try:
            if len(data) > LARGEST:
                raise ValueError("larger than a drive's memory")  # noqa: TRY301
            content = json.loads(data.decode())
            owner = {"profile": content["profile"], "node": content["node"]}
            rows = [(row["object"], row["value"]) for row in content["objects"]]
        except (ValueError, KeyError, TypeError, RecursionError):
            raise DeclarationError(
                f"{self.path}: is no memory of a simulated drive; it was left as it is. Name another file."
            ) from None
        for key, own in (("profile", self.profile), ("node", self.node)):
            if owner[key] != own:
                raise DeclarationError(
                    f"{self.path}: is the memory of {key} {owner[key]}, not {own}. Name another file or --{key}."
                )
        values: Values = {}
        for name, value in rows:
            entry = self._entry(dictionary, name)
            self._check(dictionary, entry, name, value)
            values[entry.index, entry.sub] = value
        return values

    def _entry(self, dictionary: Dictionary, name: Any) -> Entry:
        match = OBJECT.fullmatch(name) if isinstance(name, str) else None
        entry = dictionary.find(int(match[1], 16), int(match[2])) if match else None
        if entry is None:
            raise DeclarationError(f"{self.path}: {self.profile} has no object {name!r}. Remove its line.")
        return entry

    def _check(self, dictionary: Dictionary, entry: Entry, name: str, value: Any) -> None:
        kind = int if entry.type.form else str
        try:
            if type(value) is not kind or entry.access != "rw":
                raise ValueError  # noqa: TRY301
            entry.encode(value)
            if entry.index < APPLICATION:  # there it depends on what else is stored
                entry.check(value)
            else:
                dictionary.check(entry, value)
        except (ValueError, struct.error, Abort):
            raise DeclarationError(
                f"{self.path}: {name} cannot be {value!r}: {entry.type.name}, access {entry.access}. Remove its line."
            ) from None
