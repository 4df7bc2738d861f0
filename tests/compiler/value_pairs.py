"""Pairs of values that differ in what a component can read. The module imports little: all of that is in their reach."""

import functools
from collections import OrderedDict
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from pathlib import PurePosixPath
from types import SimpleNamespace

import numpy as np


@dataclass
class Quiet:
    """Prints nothing of what it holds."""

    value: float = field(repr=False)
    other: int = 0


class Slotted:
    """Holds its values in slots."""

    __slots__ = ("value",)

    def __init__(self, value):
        self.value = value


class Tricky(float):
    """A number that prints itself as another one."""

    __slots__ = ()

    def __repr__(self):
        return "0.0"


def of_class(**body):
    return type("Of", (), {"__module__": __name__, "__qualname__": "Of", **body})


def of_enum(kind, value):
    return kind("Level", {"LOW": value}, module=__name__)


def of_member(**attributes):
    """A member of an enumeration that holds more than its value."""
    member = of_enum(Enum, 1).LOW
    vars(member).update(attributes)
    return member


def with_attributes(made, **attributes):
    """An object with attributes of its own."""
    vars(made).update(attributes)
    return made


def executed(text):
    """The class `Of` of a text: it bears the name of the module of the builtins, and there is none of this name in it."""
    names = {}
    exec(text, names)
    return names["Of"]


class OwnPath(PurePosixPath):
    """A path that holds more."""


def closure(value):
    def step():
        return value

    return step


def default(value):
    def step(gain=value):
        return gain

    return step


def reading(value):
    """A function that reads a global through an attribute."""
    names = {"helper": SimpleNamespace(gain=value), "__name__": __name__}
    exec(compile("def step():\n    return helper.gain\n", "step.py", "exec"), names)
    return names["step"]


LONG = np.zeros(2000)
PAIRS = {
    "an integer": lambda x: (1, 2)[x],
    "a type": lambda x: (1, True)[x],
    "a kind of number": lambda x: (1, 1.0)[x],
    "the last bit": lambda x: (0.1, np.nextafter(0.1, 1).item())[x],
    "a sign of zero": lambda x: (0.0, -0.0)[x],
    "text": lambda x: ("a", "b")[x],
    "bytes and text": lambda x: (b"a", "a")[x],
    "none and text": lambda x: (None, "None")[x],
    "where items end": lambda x: ((("a", "b"), "c"), ("a", ("b", "c")))[x],
    "tuple and list": lambda x: ((1, 2), [1, 2])[x],
    "order in a dict": lambda x: ({"a": 1, "b": 2}, {"b": 2, "a": 1})[x],
    "a value in a dict": lambda x: ({"a": {"b": 1}}, {"a": {"b": 2}})[x],
    "an ordered dict": lambda x: (OrderedDict(a=1), OrderedDict(a=2))[x],
    "a set": lambda x: ({1, 2}, {1, 3})[x],
    "an element of a long array": lambda x: (LONG, np.where(np.arange(2000) == 1000, 1e-300, LONG))[x],
    "a shape": lambda x: (np.zeros((2, 3)), np.zeros((3, 2)))[x],
    "a width": lambda x: (np.zeros(2, np.float32), np.zeros(1, np.float64))[x],
    "objects in an array": lambda x: (np.array([1, "a"], object), np.array([1, "b"], object))[x],
    "a field without repr": lambda x: Quiet((1.0, 2.0)[x]),
    "a slot": lambda x: Slotted((1.0, 2.0)[x]),
    "a number that hides itself": lambda x: Tricky((1.0, 2.0)[x]),
    "a class attribute": lambda x: of_class(gain=(1.0, 2.0)[x]),
    "a tuple in a class": lambda x: of_class(table=((1, 2), (1, 3))[x]),
    "a base's attribute": lambda x: type("Sub", (of_class(gain=(1.0, 2.0)[x]),), {"__module__": __name__}),
    "a static method": lambda x: of_class(f=staticmethod((closure(1), closure(2))[x])),
    "a class method": lambda x: of_class(f=classmethod((closure(1), closure(2))[x])),
    "a property": lambda x: of_class(f=property((closure(1), closure(2))[x])),
    "an enumeration": lambda x: of_enum(Enum, (1, 2)[x]),
    "a member of an enumeration": lambda x: of_enum(IntEnum, (1, 2)[x]).LOW,
    "an attribute of a member": lambda x: of_member(gain=(1.0, 2.0)[x]),
    "an attribute of a partial": lambda x: with_attributes(functools.partial(max), gain=(1, 2)[x]),
    "an attribute of a path": lambda x: with_attributes(OwnPath("a"), gain=(1, 2)[x]),
    "one of two classes of a name": lambda x: [
        executed("class Of: gain = 0"),
        executed(f"class Of: gain = {(1, 2)[x]}"),
    ],
    "a class without its base": lambda x: executed(f"class Base: gain = {(1, 2)[x]}\nclass Of(Base): pass"),
    "a class of no module": lambda x: type("Of", (), {"__module__": "not_there", "gain": (1, 2)[x]}),
    "a closure": lambda x: closure((1.0, 2.0)[x]),
    "a default": lambda x: default((1.0, 2.0)[x]),
    "an attribute of a global": lambda x: reading((1.0, 2.0)[x]),
    "a partial": lambda x: functools.partial(closure(1), gain=(1, 2)[x]),
    "a cached function": lambda x: functools.lru_cache(closure((1, 2)[x])),
    "a path": lambda x: PurePosixPath(("a", "b")[x]),
    "a constant in code": lambda x: (lambda: 1, lambda: 2)[x],
    "a dtype": lambda x: np.dtype([("a", ("f4", "f8")[x])]),
}
