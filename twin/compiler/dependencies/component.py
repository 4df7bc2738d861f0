"""What the variables of a component are computed from."""

from __future__ import annotations

from types import FunctionType
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from twin.compiler.dependencies.reader import UnsureError
from twin.compiler.dependencies.walk import followed
from twin.component import Role
from twin.graph import closure

if TYPE_CHECKING:
    from collections.abc import Iterable

    from twin.component import Component

SET_FROM_OUTSIDE = (Role.input, Role.parameter)

# cached for the life of the process, in which sources do not change
_flows: WeakKeyDictionary[type[Component], dict[tuple[str, ...], dict[str, frozenset[str]]]] = WeakKeyDictionary()


def dependencies(cls: type[Component]) -> dict[str, tuple[str, ...]]:
    """For each output, the inputs it may depend on in InitializationMode."""
    flows = flow(cls, ("initialize", "derivatives"))
    inputs = [variable.name for variable in cls.variables if variable.role is Role.input]
    return {
        variable.name: tuple(name for name in inputs if name in flows.get(variable.name, ()))
        for variable in cls.variables
        if variable.role is Role.output
    }


def flow(cls: type[Component], names: Iterable[str]) -> dict[str, frozenset[str]]:
    """For each variable that the named functions may write, all variables it may be computed from."""
    declared_flows: dict[str, frozenset[str]] | None = getattr(cls, "flows", None)
    if declared_flows is not None:  # a group of components: its members were followed when it was made
        return declared_flows if "initialize" in names else getattr(cls, "reaches", {})
    cached = _flows.setdefault(cls, {})
    if tuple(names) not in cached:
        cached[tuple(names)] = _flow(cls, names)
    return cached[tuple(names)]


def _flow(cls: type[Component], names: Iterable[str]) -> dict[str, frozenset[str]]:
    variables = {variable.name for variable in cls.variables}
    writable = [variable.name for variable in cls.variables if variable.role not in SET_FROM_OUTSIDE]
    try:
        graph = _graph(cls, names)
    except UnsureError:
        return dict.fromkeys(writable, frozenset(variables))
    reached = closure(graph)
    return {name: frozenset(reached[name] & variables) for name in writable if name in graph}


def _graph(cls: type[Component], names: Iterable[str]) -> dict[str, set[str]]:
    """What is written and what is read for it, over several functions of a class."""
    arrays = {variable.name: bool(variable.shape) for variable in cls.variables}
    graph: dict[str, set[str]] = {}
    for name in names:
        function = getattr(cls, name, None)
        if function is None:
            continue
        if not isinstance(function, FunctionType):
            raise UnsureError
        for target, sources in followed(function, 0, arrays).within(name):
            graph.setdefault(target, set()).update(sources)
    return graph
