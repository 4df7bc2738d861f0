"""Connections of strings and binaries: moved by Python callbacks where the loop moves numbers.

The loop calls a row of its table, as it calls `fmiNGetXXX`; a system without such connections has no such row. Published
values are stored here until the member publishes again, so that readers never see values of a later time. Rollback covers
these values too.
"""

from __future__ import annotations

import ctypes
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.compiler import machine
from twin.component import solver
from twin.coupling.member import StateAccess

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from twin.coupling.member import Member
    from twin.coupling.system import ResolvedConnection

Key = tuple[str, str]


def flatten(value: Any) -> np.ndarray[Any, Any]:
    """Return the elements of a value as objects; a numpy bytes array would drop trailing zeros."""
    if isinstance(value, np.ndarray):
        return np.asarray(value, object).reshape(-1)
    elements = value if isinstance(value, list) else [value]
    result = np.empty(len(elements), object)
    result[:] = elements
    return result


class StringBinaryLinks:
    """Connections of strings and binaries among `links`; `numbers` are the other ones.

    Members must be initialized: their current values are the first published ones.
    """

    def __init__(self, members: Mapping[str, Member], links: list[ResolvedConnection]) -> None:
        self.members = members
        self.numbers = [link for link in links if link.source.variable.connectable]
        self.links = [link for link in links if not link.source.variable.connectable]
        keys = dict.fromkeys(link.source.key for link in self.links)
        self.published = {key: flatten(members[key[0]].get(key[1])) for key in keys}
        self.inputs = {link.target.key: self._current_input(link) for link in self.links}
        for link in self.links:
            self._put(link)
        self.last_set = {key: list(values) for key, values in self.inputs.items()}
        self._callbacks: list[Any] = []  # must outlive the loop
        self.names: dict[int, str] = {}  # names of the callbacks by address

    def _current_input(self, link: ResolvedConnection) -> np.ndarray[Any, Any]:
        """Return the current value of a connected input, of which only some elements may be connected."""
        variable = link.target.variable
        if link.target.size == variable.size:
            return np.full(variable.size, None, object)
        return flatten(self.members[link.target.member].get(variable.name))

    def _put(self, link: ResolvedConnection) -> None:
        source, target = link.source, link.target
        part = self.published[source.key][source.first : source.first + source.size]
        self.inputs[target.key][target.first : target.first + target.size] = part

    def gets(self, name: str) -> list[list[int]]:
        """Return rows that publish a member's values."""
        return [self._row(name, "get", partial(self._take, key)) for key in self.published if key[0] == name]

    def sets(self, name: str) -> list[list[int]]:
        """Return rows that set a member's inputs."""
        return [self._row(name, "set", partial(self._give, key)) for key in self.inputs if key[0] == name]

    def state_access(self, count: int) -> StateAccess:
        """Return the state access for rollback of the values stored here, with `count` saved points."""
        saved: dict[int, dict[str, list[Any]]] = {}  # by the address of their pointers

        def save(_instance: int, address: int) -> int:
            machine.write64(address, address)
            saved[address] = self.values()
            return solver.OK

        def restore(_instance: int, address: int) -> int:
            self.restore(saved[address])
            return solver.OK

        access = StateAccess.from_callbacks(save, restore, [ctypes.c_void_p() for _ in range(count)])
        self._callbacks.append(access)
        return access

    def values(self) -> dict[str, list[Any]]:
        """Return all values as plain data: a list of [member, variable, elements] for each kind of value."""
        tables: dict[str, Mapping[Key, Any]] = {
            "published": self.published,
            "inputs": self.inputs,
            "last_set": self.last_set,
        }
        return {kind: [[*key, list(values)] for key, values in table.items()] for kind, table in tables.items()}

    def restore(self, values: Mapping[str, list[Any]]) -> None:
        """Restore the result of `values`."""
        self.published = {(member, name): flatten(elements) for member, name, elements in values["published"]}
        self.last_set = {(member, name): list(elements) for member, name, elements in values["last_set"]}
        for member, name, elements in values["inputs"]:
            self.inputs[member, name][:] = elements

    def _take(self, key: Key) -> None:
        self.published[key] = flatten(self.members[key[0]].get(key[1]))

    def _give(self, key: Key) -> None:
        """Set a connected input if it has changed."""
        for link in self.links:
            if link.target.key == key:
                self._put(link)
        values = self.inputs[key]
        if list(values) != self.last_set[key]:
            self.last_set[key] = list(values)
            variable = self.members[key[0]].variables[key[1]]
            self.members[key[0]].set(key[1], values.reshape(variable.shape) if variable.shape else values[0])

    def _row(self, name: str, function_name: str, call: Callable[[], None]) -> list[int]:
        """Return a row of the table of accesses that runs a callback."""
        function = machine.ACCESS(self.members[name].guarded(lambda *_: call()))
        address = machine.address_of(function)
        self._callbacks.append(function)
        self.names[address] = function_name
        return [address, 0, 0, 0, 0, 0]
