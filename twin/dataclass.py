"""`dataclass` as in the standard library, whose methods wait until somebody needs them.

There, every method of every class is text that is compiled when the module is imported: for the seventy classes of a run
that takes as long as importing numpy. Here the methods are the same functions for all classes, and `__init__` is made
with the first instance. Fields, and all that reads them, are the standard library's.
"""

from __future__ import annotations

import dataclasses
from operator import attrgetter
from typing import TYPE_CHECKING, Any

__all__ = ["dataclass"]

if TYPE_CHECKING:
    from collections.abc import Callable
    from dataclasses import dataclass
else:

    def dataclass(
        cls: Any = None, /, *, frozen: bool = False, eq: bool = True, slots: bool = False, kw_only: bool = False
    ) -> Any:
        """The class with the methods of its fields."""
        if cls is None:
            return lambda cls: dataclass(cls, frozen=frozen, eq=eq, slots=slots, kw_only=kw_only)

        def __init__(self: Any, *args: Any, **kwargs: Any) -> None:  # noqa: N807 - until the first instance
            if made.__init__ is __init__:
                made.__init__ = _initializer(made, frozen)
            made.__init__(self, *args, **kwargs)

        methods = {"__init__": __init__, "__repr__": _repr}
        if eq:
            methods |= {"__eq__": _eq}
            if vars(cls).get("__hash__") is None:
                cls.__hash__ = _hash if frozen else None
        if frozen:
            methods |= {"__setattr__": _refuse, "__delattr__": _refuse}
            if slots:
                methods |= {"__getstate__": _getstate, "__setstate__": _setstate}
        for name, method in methods.items():
            if name not in vars(cls):
                setattr(cls, name, method)
        cls.__doc__ = cls.__doc__ or cls.__name__
        made = dataclasses.dataclass(cls, init=False, repr=False, eq=False, slots=slots, kw_only=kw_only)
        return made


def _initializer(cls: Any, frozen: bool) -> Any:
    """`__init__` of a class: an argument for each field, in order."""
    known: dict[str, Any] = {"__set": object.__setattr__, "__missing": dataclasses.MISSING}
    given: dict[bool, list[str]] = {False: ["self"], True: ["*"]}  # those by place, and by keyword alone
    lines = []
    for one in dataclasses.fields(cls):
        name, value, default = one.name, one.name, ""
        if one.default_factory is not dataclasses.MISSING:
            known[f"__of_{name}"], default = one.default_factory, "=__missing"
            value = f"__of_{name}() if {name} is __missing else {name}" if one.init else f"__of_{name}()"
        elif one.default is not dataclasses.MISSING:
            known[f"__of_{name}"], default = one.default, f"=__of_{name}"
            value = name if one.init else f"__of_{name}"
        elif not one.init:
            continue  # `__post_init__` sets it
        if one.init:
            given[bool(one.kw_only)].append(name + default)
        lines.append(f"__set(self, {name!r}, {value})" if frozen else f"self.{name} = {value}")
    if hasattr(cls, "__post_init__"):
        lines.append("self.__post_init__()")
    told = ", ".join(given[False] + given[True] * (len(given[True]) > 1))
    exec(f"def __init__({told}):\n " + "\n ".join(lines or ["pass"]), known)  # noqa: S102 - names of fields
    made = known["__init__"]
    made.__qualname__ = f"{cls.__qualname__}.__init__"
    return made


_getters: dict[Any, Callable[[Any], Any]] = {}  # of what is compared, by class


def _compared(self: Any) -> Any:
    cls = type(self)
    if cls not in _getters:
        names = [one.name for one in dataclasses.fields(cls) if one.compare]
        _getters[cls] = attrgetter(*names) if names else lambda _: ()
    return _getters[cls](self)


def _eq(self: Any, other: object) -> Any:
    return _compared(self) == _compared(other) if type(other) is type(self) else NotImplemented


def _hash(self: Any) -> int:
    return hash(_compared(self))


def _repr(self: Any) -> str:
    told = ", ".join(f"{one.name}={getattr(self, one.name)!r}" for one in dataclasses.fields(self) if one.repr)
    return f"{type(self).__qualname__}({told})"


def _refuse(self: Any, name: str, *_: object) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot change field {name!r} of {type(self).__name__}")


def _getstate(self: Any) -> list[Any]:
    return [getattr(self, one.name) for one in dataclasses.fields(self)]


def _setstate(self: Any, state: list[Any]) -> None:
    for one, value in zip(dataclasses.fields(self), state, strict=True):
        object.__setattr__(self, one.name, value)
