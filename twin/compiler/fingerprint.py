"""Fingerprint of a component: a hash of everything that its translation to C can read.

Translation is skipped only if the fingerprint is that of the previous translation. It is a superset of what the translator
reads, found without the translator's help: for each function its code and the text of its file, and all values that a name
in it can lead to, whether through globals, closures, modules, classes, base classes, instances or properties. Numbers and
arrays count to the last bit. A value that cannot be described exactly makes the component untraceable: it is then
translated every time. Compiled objects are keyed by the C text itself (`toolchain.compile_c`).

The engine and the libraries that components may call count by the content of the engine's files and by their versions.
"""

from __future__ import annotations

import functools
import hashlib
import linecache
import os
import struct
import sys
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from enum import Enum
from functools import cache
from pathlib import Path, PurePath
from types import (
    BuiltinFunctionType,
    CodeType,
    EllipsisType,
    FunctionType,
    GetSetDescriptorType,
    MemberDescriptorType,
    MethodDescriptorType,
    MethodType,
    ModuleType,
    NoneType,
    WrapperDescriptorType,
)
from typing import Any

import numpy as np

from twin import installed

ENGINE = Path(__file__).parents[1]
SUFFIXES = (".py", ".c", ".h", ".html", ".xsd")
LIBRARIES = ("numpy", "ziglang", "pint", "jinja2", "markdown-it-py")  # whose versions decide what is written
FIXED = {"numpy", "scipy", *sys.stdlib_module_names}  # packages that change with their version only
PLAIN = (bool, int, str, bytes, NoneType, EllipsisType)
NATIVE = (
    BuiltinFunctionType, WrapperDescriptorType, MethodDescriptorType, GetSetDescriptorType, MemberDescriptorType, np.ufunc,
)  # fmt: skip
WRAPPERS = ("__func__", "__self__", "__wrapped__", "fget", "fset", "fdel", "func", "args", "keywords")
UNREAD = {  # of a class: what Python adds by itself, and what the engine derives from a component on first use
    "_functions", "_tangents",
    "__dict__", "__weakref__", "__annotations__", "__annotate__", "__annotate_func__", "__annotations_cache__",
    "__abstractmethods__", "_abc_impl", "__firstlineno__", "__static_attributes__", "__parameters__", "__orig_bases__",
}  # fmt: skip
MISSING = object()


class UntraceableError(Exception):
    """A value whose content cannot be described exactly."""


@cache
def engine() -> str:
    """Hash of the engine: the content of its files, and the versions of Python and of the libraries that it writes with."""
    digest = hashlib.sha256(sys.version.encode())
    for name in LIBRARIES:
        digest.update(f"{name} {installed.version(name)} ".encode())
    for folder, folders, names in os.walk(ENGINE):
        folders.sort()
        for name in sorted(names):
            if name.endswith(SUFFIXES):
                with open(os.path.join(folder, name), "rb") as file:  # noqa: PTH118 - pathlib takes ten times as long
                    digest.update(file.read())
    return digest.hexdigest()


def fingerprint(*values: Any) -> str | None:
    """Hash of all that values, such as component classes and texts, can lead to; None if something is untraceable."""
    trace = Trace()
    try:
        for value in values:
            trace.add(value, frozenset())
    except (UntraceableError, RecursionError):
        return None
    trace.digest.update(engine().encode())
    return trace.digest.hexdigest()


class Trace:
    """Walks over values and hashes what it finds, each object once, in an order that is the same in every process."""

    def __init__(self) -> None:
        self.digest = hashlib.sha256()
        self.seen: dict[Any, int] = {}
        self.held: list[Any] = []  # an address may not be used again while the walk goes on

    def put(self, *words: object) -> None:
        """Hash words; no two sequences give the same bytes."""
        for word in words:
            data = str(word).encode("utf-8", "surrogatepass")
            self.digest.update(b"%d:" % len(data) + data)

    def is_known(self, key: Any, value: Any) -> bool:
        """Whether something was walked over before; then only its number counts."""
        if key in self.seen:
            self.put("known", self.seen[key])
            return True
        self.seen[key] = len(self.seen)
        self.held.append(value)
        return False

    def add(self, value: Any, names: frozenset[str]) -> None:
        """Hash a value. `names`: those that stand in the function which reaches it, so that it may use as attributes."""
        kind = type(value)
        if kind in PLAIN:
            self.put(kind.__name__, repr(value))
        elif kind is float:
            self.put("float", struct.pack("<d", value).hex())
        elif isinstance(value, np.dtype):
            self.put("dtype", value.str, value.fields, value.shape)
        elif isinstance(value, np.ndarray | np.generic):
            self.array(value)
        elif kind in (tuple, list):
            self.put(kind.__name__, len(value))
            for item in value:
                self.add(item, names)
        elif isinstance(value, ModuleType):
            self.module(value, names)
        elif isinstance(value, type):
            self.class_(value, names)
        elif isinstance(value, FunctionType):
            self.function(value)
        elif isinstance(value, CodeType):
            self.code(value)
        elif isinstance(value, NATIVE):
            owner = getattr(value, "__self__", None)
            self.put("native", getattr(value, "__module__", ""), getattr(value, "__qualname__", value.__name__))
            if owner is not None and not isinstance(owner, ModuleType):
                self.add(owner, names)
        elif isinstance(value, PurePath):
            self.put("path", kind.__name__, value)
        else:
            self.instance(value, names)

    def array(self, value: Any) -> None:
        """Hash an array or a scalar of NumPy bytewise; elements that are objects one by one."""
        array = np.asarray(value)
        self.put("array", type(value).__name__, array.shape)
        self.add(array.dtype, frozenset())
        if array.dtype.hasobject:
            for item in array.reshape(-1).tolist():
                self.add(item, frozenset())
        else:
            self.put(hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest())

    def module(self, value: ModuleType, names: frozenset[str]) -> None:
        """Hash those names of a module that the function has words for."""
        name = value.__name__
        self.put("module", name)
        if not is_fixed(name):
            self.attributes(value, names & vars(value).keys() if "__getattr__" not in vars(value) else names, names)

    def attributes(self, owner: Any, wanted: frozenset[str], names: frozenset[str]) -> None:
        """Hash the values of attributes, also of those that are computed; each once for an owner."""
        for name in sorted(wanted):
            try:
                value = getattr(owner, name, MISSING)
            except Exception as error:
                self.put(name, type(error).__name__)
                continue
            if value is not MISSING:
                self.put(name)
                if not self.is_known((id(owner), name), value):
                    self.add(value, names)

    def class_(self, value: type, names: frozenset[str]) -> None:
        """Hash all that a class and its bases have, and where it stands."""
        name = (
            value.__module__ if isinstance(value.__module__, str) else "builtins"
        )  # some types of C have a descriptor there
        self.put("class", name, value.__qualname__)
        module = sys.modules.get(name)
        file = getattr(module, "__file__", None) or ""
        if is_fixed(value.__module__):
            return
        if (
            is_of_engine(file) and getattr(module, value.__name__, None) is value
        ):  # not one that the engine made at run time
            return
        if is_installed(file):
            self.put(package_version(name), text_of(file))
            return
        if not self.is_known(id(value), value):
            for base in value.__mro__[1:]:
                self.class_(base, names)
            for name, found in sorted(vars(value).items()):
                if name not in UNREAD:
                    self.put(name)
                    self.add(found, names)
        if type(value) is not type and not is_fixed(type(value).__module__):
            self.attributes(value, names - vars(value).keys(), names)

    def function(self, value: FunctionType) -> None:
        """Hash a function's code, the text of its file, and all that its names lead to."""
        code = value.__code__
        self.put("function", value.__module__, value.__qualname__)
        if is_of_engine(code.co_filename) or is_fixed(value.__module__ or "") or self.is_known(id(value), value):
            return
        self.code(code)
        if not self.is_known(("file", code.co_filename), code):
            self.put(text_of(code.co_filename))
        if is_installed(code.co_filename):
            self.put(package_version(value.__module__))
            return
        names = frozenset(names_in(code))
        for part in (value.__defaults__, value.__kwdefaults__, vars(value) or None):
            self.add(part, names)
        for name, cell in zip(code.co_freevars, value.__closure__ or (), strict=True):
            self.put(name)
            try:
                self.add(cell.cell_contents, names)
            except ValueError:  # not assigned yet
                self.put("empty")
        for name in sorted(names & value.__globals__.keys()):
            self.put(name)
            self.add(value.__globals__[name], names)

    def code(self, value: CodeType) -> None:
        """Hash byte code with its constants."""
        self.put(value.co_code.hex(), value.co_names, value.co_varnames, value.co_freevars, value.co_argcount)
        self.put(value.co_name, value.co_firstlineno, value.co_flags)
        for constant in value.co_consts:
            self.add(constant, frozenset())

    def instance(self, value: Any, names: frozenset[str]) -> None:
        """Hash the state of an object, its class, and those attributes that the function has words for."""
        kind = type(value)
        self.class_(kind, names)
        if not self.is_known(id(value), value):
            self.state(value, names)
        if not is_fixed(kind.__module__):
            self.attributes(value, names, names)

    def state(self, value: Any, names: frozenset[str]) -> None:
        """Hash what an object holds; UntraceableError if it does not show it."""
        kind = type(value)
        if isinstance(value, Enum):
            self.put("enum", value.name)
            self.add(value._value_, names)
            return
        if isinstance(
            value, MethodType | staticmethod | classmethod | property | functools.partial | functools.cached_property
        ):
            for name in WRAPPERS:
                self.add(getattr(value, name, None), names)
            return
        found = False
        for base, show in CONTAINERS:
            if isinstance(value, base):
                self.add(show(value), names)
                found = True
        for number, show in NUMBERS:
            if isinstance(value, number):
                self.put(number.__name__, show(value))  # of a subclass, which may print itself in another way
                found = True
        if hasattr(value, "__wrapped__"):  # such as what functools.lru_cache gives
            self.add(value.__wrapped__, names)
            found = True
        slots = [name for base in kind.__mro__ for name in slot_names(base)]
        fields = {**getattr(value, "__dict__", {}), **{name: getattr(value, name, None) for name in slots}}
        if fields or hasattr(value, "__dict__") or slots:
            self.add(fields, names)
            found = True
        if not found:
            self.reduced(value, names)

    def reduced(self, value: Any, names: frozenset[str]) -> None:
        """Hash what pickle would write of an object that is not made in Python."""
        kind = type(value)
        try:
            parts = value.__reduce_ex__(2)
        except Exception:
            parts = "nothing"
        if isinstance(parts, str):
            if (version := package_version(kind.__module__)) is None:
                raise UntraceableError(f"{kind.__qualname__} does not show what it holds")
            self.put("native object", kind.__qualname__, version)
            return
        for part in parts:
            self.add(list(part) if hasattr(part, "__next__") else part, names)


@cache
def package_version(module: str) -> str | None:
    """Version of the installed package that a module belongs to; None if it belongs to none."""
    from importlib import metadata

    top = module.partition(".")[0]
    names = metadata.packages_distributions().get(top, ())
    return " ".join(f"{name} {metadata.version(name)}" for name in sorted(names)) or None


def items(value: Mapping[Any, Any]) -> list[Any]:
    """Pairs of a mapping in their order, flat."""
    return [part for pair in value.items() for part in pair]


def in_order(value: AbstractSet[Any]) -> list[Any]:
    """Elements of a set, in an order that does not depend on their hashes."""
    prints = [(fingerprint(item) or untraceable(item), item) for item in value]
    return [item for _, item in sorted(prints, key=lambda pair: pair[0])]


def untraceable(value: Any) -> str:
    """Raise what ends the walk."""
    raise UntraceableError(f"{type(value).__qualname__} does not show what it holds")


def slot_names(base: type) -> list[str]:
    """Names of a class's slots."""
    slots = vars(base).get("__slots__", ())
    return [name for name in ([slots] if isinstance(slots, str) else slots) if name not in ("__dict__", "__weakref__")]


def is_fixed(module: Any) -> bool:
    """Whether a module changes with the version of its package only; some types of C have a descriptor for its name."""
    return not isinstance(module, str) or (module.partition(".")[0] in FIXED or module == "builtins")


def is_installed(file: str) -> bool:
    """Whether a file belongs to an installed package, whose version and own text count, and not what they lead to."""
    parts = Path(file).parts
    return ("site-packages" in parts or "dist-packages" in parts) and "fmus" not in parts


def is_of_engine(file: str | None) -> bool:
    """Whether a file is one of the engine's, which count as a whole."""
    return bool(file) and str(file).startswith(f"{ENGINE}{os.sep}")


def names_in(code: CodeType) -> list[str]:
    """All names in a function's code, and in the functions inside it."""
    inner = [name for one in code.co_consts if isinstance(one, CodeType) for name in names_in(one)]
    return [*code.co_names, *inner]


def text_of(file: str) -> str:
    """The text of a source file as it is now; of functions that the engine wrote, what it keeps of them."""
    if file.startswith("<"):
        return "".join(linecache.getlines(file))
    try:
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()
    except OSError:
        return "".join(linecache.getlines(file))


NUMBERS: tuple[tuple[type[Any], Any], ...] = tuple((one, one.__repr__) for one in (float, int, str, bytes, complex))
CONTAINERS: tuple[tuple[type[Any], Any], ...] = (
    (Mapping, items), (AbstractSet, in_order), (tuple, tuple), (list, list), (range, tuple),
)  # fmt: skip
