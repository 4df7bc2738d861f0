"""Strings and binaries between members: moved by Python, at the points where the loop moves numbers.

The loop calls a row of its table, as it calls `fmiNGetXXX`; a system without such connections has none. What a member
publishes is kept here until it publishes again, so that nobody sees its future.
"""

from __future__ import annotations

import ctypes
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.compiler import machine
from twin.errors import CouplingError, TwinError, described

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from twin.coupling.algorithms import Algorithm
    from twin.coupling.member import Member
    from twin.coupling.system import Link

OK, ERROR = 0, 3

Key = tuple[str, str]


def flat(value: Any) -> np.ndarray[Any, Any]:
    """The elements of a value; numpy would take bytes for something shorter, without the zeros at their end."""
    if isinstance(value, np.ndarray):
        return np.asarray(value, object).reshape(-1)
    elements = value if isinstance(value, list) else [value]
    found = np.empty(len(elements), object)
    found[:] = elements
    return found


def refuse_objects(links: list[Link], algorithm: Algorithm) -> None:
    """CouplingError where an algorithm goes back: what is kept here does not go with it."""
    named = [link for link in links if not link.source.variable.connectable]
    if named and not algorithm.is_plain:
        source, target = (f"{end.member}.{end.variable.name}" for end in (named[0].source, named[0].target))
        kind = named[0].source.variable.type
        raise CouplingError(
            f"{source} -> {target}: is a {kind} connection, which algorithm {algorithm} cannot take back. "
            "Use jacobi or gauss_seidel."
        )


class Objects:
    """The connections whose values are no numbers, of all `links`; `numbers` are the others.

    Members must have been initialized: what they hold then is what they publish first.
    """

    def __init__(self, members: Mapping[str, Member], links: list[Link]) -> None:
        self.members = members
        self.numbers = [link for link in links if link.source.variable.connectable]
        self.links = [link for link in links if not link.source.variable.connectable]
        keys = dict.fromkeys(link.source.key for link in self.links)
        self.published = {key: flat(members[key[0]].get(key[1])) for key in keys}
        self.inputs = {link.target.key: self._held(link) for link in self.links}
        for link in self.links:
            self._put(link)
        self.given = {key: list(values) for key, values in self.inputs.items()}
        self._kept: list[Any] = []  # callbacks
        self.names: dict[int, str] = {}  # of the callbacks, by address

    def _held(self, link: Link) -> np.ndarray[Any, Any]:
        """What an input holds that is connected, perhaps in some of its elements only."""
        variable = link.target.variable
        if link.target.size == variable.size:
            return np.full(variable.size, None, object)
        return flat(self.members[link.target.member].get(variable.name))

    def _put(self, link: Link) -> None:
        source, target = link.source, link.target
        part = self.published[source.key][source.first : source.first + source.size]
        self.inputs[target.key][target.first : target.first + target.size] = part

    def gets(self, name: str) -> list[list[int]]:
        """Rows that take what a member publishes."""
        return [self._row(name, "get", partial(self._take, key)) for key in self.published if key[0] == name]

    def sets(self, name: str) -> list[list[int]]:
        """Rows that give a member its inputs."""
        return [self._row(name, "set", partial(self._give, key)) for key in self.inputs if key[0] == name]

    def _take(self, key: Key) -> None:
        self.published[key] = flat(self.members[key[0]].get(key[1]))

    def _give(self, key: Key) -> None:
        """Set an input if it has changed."""
        for link in self.links:
            if link.target.key == key:
                self._put(link)
        values = self.inputs[key]
        if list(values) != self.given[key]:
            self.given[key] = list(values)
            variable = self.members[key[0]].variables[key[1]]
            self.members[key[0]].set(key[1], values.reshape(variable.shape) if variable.shape else values[0])

    def _row(self, name: str, word: str, call: Callable[[], None]) -> list[int]:
        """A row of the table of accesses."""

        def called(*_: int) -> int:
            try:
                call()
            except BaseException as error:  # nothing may pass through native frames
                self.members[name].failure = error
                self.members[name].log.append(str(error) if isinstance(error, TwinError) else described(error))
                return ERROR
            return OK

        function = machine.ACCESS(called)
        address = ctypes.cast(function, ctypes.c_void_p).value or 0
        self._kept.append(function)
        self.names[address] = word
        return [address, 0, 0, 0, 0, 0]
