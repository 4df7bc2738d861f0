"""Fingerprint of a component: a hash of everything that its translation to C can read.

Translation is skipped only if the fingerprint is that of the previous translation. It covers everything in reach of it:

1. the text of every module that the component's module imports, directly or through others, as it is on disk now;
2. the value of every global name of these modules, through objects, classes, closures and containers, to the last bit;
3. computed attributes (properties, `__getattr__`), evaluated for every name that a function in reach uses;
4. the engine's files, and the versions of Python and of the libraries that the engine writes with; of their modules and
   classes, and of the builtins, the values of names that a function in reach uses, since a user's module may set them.

An object whose content cannot be described exactly makes the component untraceable: it is translated every time.
Compiled objects are keyed by the C text itself (`toolchain.compile_c`).
"""

from __future__ import annotations

import builtins
import functools
import hashlib
import struct
import sys
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from enum import Enum
from pathlib import PurePath
from types import CodeType, EllipsisType, FunctionType, MethodType, ModuleType, NoneType
from typing import Any

import numpy as np

from twin.compiler.imports import modules_of
from twin.compiler.introspection import (
    NATIVE,
    computes_items,
    descriptor_names,
    is_there,
    names_in,
    slot_names,
    text_of,
)
from twin.compiler.versions import engine, is_fixed, is_of_engine
from twin.component import Component
from twin.store import make_key

ARRAYS = np.ndarray, np.generic
PLAIN = frozenset((bool, int, str, bytes, NoneType, EllipsisType))
WRAPPER_TYPES = (MethodType, staticmethod, classmethod, property, functools.partial, functools.cached_property)
WRAPPERS = ("__func__", "__self__", "__wrapped__", "fget", "fset", "fdel", "func", "args", "keywords")
DERIVED = frozenset(("_functions", "_tangents", "composition"))  # what the engine derives from a component
UNREAD = frozenset(  # of classes and modules: what Python adds by itself
    """
    __dict__ __weakref__ __annotations__ __annotate__ __annotate_func__ __annotations_cache__
    __abstractmethods__ _abc_impl __firstlineno__ __static_attributes__ __parameters__ __orig_bases__ __builtins__ __cached__
    __loader__ __spec__ __file__ __path__ __conditional_annotations__
    """.split()  # noqa: SIM905 - as a list it takes a line per word
)
ENUM_NAMES = {"_value_", "_name_", "__objclass__", "_sort_order_"}  # attributes that Python gives each member
LARGEST = 300_000  # values in reach; walking over more takes longer than translation


class UntraceableError(Exception):
    """A value whose content cannot be described exactly."""


def fingerprint(*values: Any) -> str | None:
    """Hash everything reachable from the values (component classes, texts); None if something is untraceable."""
    attributes: frozenset[str] = frozenset()
    while True:
        trace = Trace(attributes)
        try:
            for value in values:
                trace.add(value)
            trace.finish()
        except Exception:  # objects may lie about what they are and have
            return None
        if not (trace.used - attributes) & trace.computable():  # all were evaluated
            return make_key(engine(), "".join(trace.texts))
        attributes |= trace.used


class Trace:
    """Hashes values and the modules in their reach, each object once, in an order that is the same in every process.

    attributes: names of attributes that are evaluated where an object computes them.
    """

    def __init__(self, attributes: frozenset[str] = frozenset()) -> None:
        self.texts: list[str] = []
        self.attributes = attributes
        self.used: set[str] = set()  # names that the functions in reach use
        self.modules: dict[str, None] = {}  # reachable modules in order of discovery
        # imported names that are not there yet: attributes, or modules whose text counts
        self.unloaded: set[str] = set()
        self.packages: dict[str, None] = {}  # those of them that are values, so that submodules are attributes
        self.counted: dict[str, Any] = {"builtins": builtins}  # modules and classes that count by their version
        self.descriptors: dict[type, set[str] | None] = {}  # names that objects compute; None: any
        self.numbers: dict[int, int] = {}  # of objects that were walked over, by address
        self.objects: list[Any] = []  # keeps them alive: an address must not be used again

    def put(self, *words: object) -> None:
        """Hash words; no two sequences give the same text."""
        self.texts.append(repr(words))

    def is_visited(self, value: Any) -> bool:
        """Return whether an object was visited before; if so, hash only its number."""
        if id(value) in self.numbers:
            self.put("known", self.numbers[id(value)])
            return True
        if len(self.objects) > LARGEST:
            raise UntraceableError("too many values are in reach")
        self.numbers[id(value)] = len(self.objects)
        self.objects.append(value)
        return False

    def finish(self) -> None:
        """Hash the modules in reach, and what is used of those that count by their version; each may bring more of them."""
        done: set[str] = set()
        while True:
            waiting = [name for name in (*self.modules, *self.submodules()) if name not in done]
            for name in waiting:
                done.add(name)
                if (module := sys.modules.get(name)) is not None:
                    self.module(name, module)
            if not waiting and not self.used_of_counted(done):
                return

    def used_of_counted(self, done: set[str]) -> bool:
        """Hash the members that functions in reach use of modules and classes that count by their version; false if none is new."""
        used = [
            (name, owner, member)
            for name, owner in self.counted.items()
            for member in sorted(self.used & vars(owner).keys() - UNREAD)
            if f"{name} {member}" not in done
        ]
        for name, owner, member in used:
            done.add(f"{name} {member}")
            self.put(name, member)
            self.add(vars(owner)[member])
        return bool(used)

    def module(self, name: str, value: ModuleType) -> None:
        """Hash the text and all global values of a module, and find what it imports."""
        if not isinstance(value, ModuleType):  # an object that a module put in its own place
            self.add(value)
            return
        text = text_of(getattr(value, "__file__", None) or "")
        self.put("module", name, text)
        for imported, later in modules_of(text, getattr(value, "__package__", None) or "", self.unloaded):
            if later is None:
                self.reach(imported)
            else:
                self.put("unloaded", imported, later)
        # a package has its imported submodules as attributes, also those that another component imported
        self.members({key: item for key, item in vars(value).items() if sys.modules.get(f"{name}.{key}") is not item})
        self.class_(type(value))
        if "__getattr__" in vars(value):
            self.descriptors[type(value)] = None
        self.computed(value, self.computed_names(value) - vars(value).keys())

    def submodules(self) -> list[str]:
        """Submodules that can be read as attributes of packages which are values themselves."""
        named = [f"{package}.{name}" for package in self.packages for name in sorted(self.attributes)]
        return [name for name in named if name in sys.modules]

    def reach(self, name: Any) -> None:
        """Record a module as reachable, unless it is the engine's or changes with its version only."""
        if (
            isinstance(name, str)
            and not is_fixed(name)
            and not is_of_engine(getattr(sys.modules.get(name), "__file__", None))
        ):
            self.modules.setdefault(name)

    def members(self, members: Mapping[str, Any], unread: AbstractSet[str] = UNREAD) -> None:
        """Hash the members of a class or a module by their names."""
        for name, value in sorted(members.items()):
            if name not in unread:
                self.put(name)
                self.add(value)

    def computed(self, owner: Any, names: AbstractSet[str]) -> None:
        """Hash attributes that an object computes when they are read."""
        for name in sorted(names):
            try:
                value = getattr(owner, name)
            except Exception as error:
                self.put(name, type(error).__name__)
            else:
                self.put(name)
                self.add(value)

    def computable(self) -> set[str]:
        """Names of attributes that an object in reach may compute, out of those that functions in reach use."""
        if None in self.descriptors.values():
            return self.used
        inside = [name.rpartition(".") for name in sys.modules] if self.packages else []
        submodules = {name for package, _, name in inside if package in self.packages}
        return submodules.union(*(names or () for names in self.descriptors.values()))

    def computed_names(self, value: Any) -> set[str] | frozenset[str]:
        """Names of attributes to evaluate whose values an object computes: its properties and other descriptors, or any name."""
        kind = type(value)
        if kind not in self.descriptors:
            self.descriptors[kind] = descriptor_names(kind)
        names = self.descriptors[kind]
        return self.attributes if names is None else self.attributes & names

    def add(self, value: Any) -> None:
        """Hash a value."""
        kind = type(value)
        if kind in PLAIN:
            self.put(kind.__name__, value)
        elif kind is float:
            self.put("float", struct.pack("<d", value).hex())
        elif kind in (tuple, list):
            if set(map(type, value)) == {float}:
                self.put(kind.__name__, struct.pack(f"<{len(value)}d", *value))
                return
            others = [item for item in value if type(item) not in PLAIN]
            self.put(kind.__name__, [item if type(item) in PLAIN else () for item in value] if others else value)
            for item in others:
                self.add(item)
        elif isinstance(value, np.dtype):
            if not self.is_visited(value):
                self.put("dtype", value.str, value.fields, value.shape)
        elif isinstance(value, ARRAYS):
            self.array(value)
        elif isinstance(value, ModuleType):
            self.put("module", value.__name__)
            if sys.modules.get(value.__name__) is not value:  # loaded from a file by its path
                if not self.is_visited(value):
                    self.module(value.__name__, value)
                return
            self.reach(value.__name__)
            if value.__name__ not in self.modules:
                self.counted.setdefault(value.__name__, value)
            elif hasattr(value, "__path__"):
                self.packages.setdefault(value.__name__)
        elif isinstance(value, type):
            self.class_(value)
        elif isinstance(value, FunctionType):
            self.function(value)
        elif isinstance(value, CodeType):
            self.code(value)
        elif isinstance(value, NATIVE):
            owner = getattr(value, "__self__", None)
            self.put("native", getattr(value, "__module__", ""), getattr(value, "__qualname__", value.__name__))
            if owner is not None and not isinstance(owner, ModuleType):
                self.add(owner)
        elif isinstance(value, PurePath):
            self.put("path", str(value))
            self.class_(kind)
            self.add(getattr(value, "__dict__", None))
        elif not self.is_visited(value):
            self.class_(kind)
            self.state(value)
            self.computed(value, self.computed_names(value))

    def array(self, value: Any) -> None:
        """Hash an array or a scalar of NumPy bytewise; elements that are objects one by one."""
        array = np.asarray(value)
        self.put("array", type(value).__name__, array.shape)
        self.add(array.dtype)
        if array.dtype.hasobject:
            for item in array.reshape(-1).tolist():
                self.add(item)
        else:
            self.put(hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest())

    def class_(self, value: type) -> None:
        """Hash all that a class and its bases have; those of the engine and of fixed packages by name."""
        if self.is_visited(value):
            return
        name = value.__module__
        self.put("class", name if isinstance(name, str) else "", value.__qualname__)
        module = sys.modules.get(name) if isinstance(name, str) else None
        if (is_fixed(name) or is_of_engine(getattr(module, "__file__", None))) and is_there(value, module):
            self.counted.setdefault(f"{name}.{value.__qualname__}", value)
            return
        self.reach(name)
        for base in value.__mro__[1:]:
            self.class_(base)
        self.members(vars(value), UNREAD | DERIVED if issubclass(value, Component) else UNREAD)
        if type(value) is not type:
            self.class_(type(value))
            self.computed(value, self.computed_names(value) - vars(value).keys())

    def function(self, value: FunctionType) -> None:
        """Hash a function's code and the values that it carries; its text and its globals count with its module."""
        self.put("function", value.__module__, value.__qualname__)
        file = value.__code__.co_filename
        if is_of_engine(file) or is_fixed(value.__module__ or "") or self.is_visited(value):
            return
        self.code(value.__code__)
        self.reach(value.__module__)
        module = sys.modules.get(value.__module__ or "")
        if module is None or value.__globals__ is not vars(module):  # made by `exec`
            self.put(text_of(file))
            named = names_in(value.__code__)
            self.members({name: value.__globals__[name] for name in named if name in value.__globals__})
        for part in (value.__defaults__, value.__kwdefaults__, vars(value) or None):
            self.add(part)
        for name, cell in zip(value.__code__.co_freevars, value.__closure__ or (), strict=True):
            self.put(name)
            try:
                self.add(cell.cell_contents)
            except ValueError:  # not assigned yet
                self.put("empty")

    def code(self, value: CodeType) -> None:
        """Hash byte code with its constants, and note the names that it uses."""
        self.used.update(value.co_names)
        self.put(value.co_code.hex(), value.co_names, value.co_varnames, value.co_freevars, value.co_argcount)
        self.put(value.co_name, value.co_firstlineno, value.co_flags)
        for constant in value.co_consts:
            self.add(constant)

    def state(self, value: Any) -> None:
        """Hash what an object holds; UntraceableError if it does not show it."""
        kind = type(value)
        if isinstance(value, Enum):
            self.put("enum", value.name)
            self.add({name: part for name, part in vars(value).items() if name not in ENUM_NAMES})
            self.add(value._value_)
            return
        if isinstance(value, WRAPPER_TYPES):
            for name in WRAPPERS:
                self.add(getattr(value, name, None))
            if isinstance(value, functools.partial):
                self.add(vars(value))
            return
        if isinstance(value, (tuple, dict)) and computes_items(kind):
            untraceable(value)
        is_shown = False
        for base, show in CONTAINERS:
            if isinstance(value, base):
                self.add(show(value))
                is_shown = True
        for number in NUMBERS:
            if isinstance(value, number):
                show_number: Any = number.__repr__  # a subclass may print itself in another way
                self.put(number.__name__, show_number(value))
                is_shown = True
        if hasattr(value, "__wrapped__"):  # such as what functools.lru_cache gives
            self.add(value.__wrapped__)
            is_shown = True
        slots = [name for base in kind.__mro__ for name in slot_names(base)]
        fields = {**getattr(value, "__dict__", {}), **{name: getattr(value, name, None) for name in slots}}
        if fields or hasattr(value, "__dict__") or slots:
            self.put(*fields)
            self.add([*fields.values()])
            is_shown = True
        if not is_shown or any(is_opaque(base) for base in kind.__mro__):
            self.reduced(value)

    def reduced(self, value: Any) -> None:
        """Hash what pickle would write of an object that is not made in Python."""
        kind = type(value)
        try:
            parts = value.__reduce_ex__(2)
        except Exception as error:
            raise UntraceableError(f"{kind.__qualname__} does not show what it holds") from error
        for part in [parts] if isinstance(parts, str) else parts:
            self.add(list(part) if hasattr(part, "__next__") else part)


def items(value: Mapping[Any, Any]) -> list[Any]:
    """Pairs of a mapping in their order, flat."""
    return [part for pair in value.items() for part in pair]


def in_order(value: AbstractSet[Any]) -> list[Any]:
    """Elements of a set, in an order that does not depend on their hashes."""
    if set(map(type, value)) == {str}:
        return sorted(value)
    prints = [(fingerprint(item) or untraceable(item), item) for item in value]
    return [item for _, item in sorted(prints, key=lambda pair: pair[0])]


def untraceable(value: Any) -> str:
    """Raise the UntraceableError that ends the walk."""
    raise UntraceableError(f"{type(value).__qualname__} does not show what it holds")


def is_opaque(base: type) -> bool:
    """Whether a class is made in C and may hold what its instances' attributes do not show."""
    return not issubclass(base, SHOWN) and base is not object and not vars(base).keys() & PYTHON_MADE


NUMBERS: tuple[type[Any], ...] = (float, int, str, bytes, complex)
PYTHON_MADE = {"__dict__", "__weakref__", "__slots__"}  # one of them is in each class that is made in Python
CONTAINERS: tuple[tuple[type[Any], Any], ...] = (
    (Mapping, items),
    (AbstractSet, in_order),
    (tuple, tuple),
    (list, list),
    (range, tuple),
)
SHOWN = (*NUMBERS, *(container for container, _ in CONTAINERS))
