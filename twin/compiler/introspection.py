"""Questions about classes and functions: which names run code when they are read, slots, names in byte code, source text."""

from __future__ import annotations

import linecache
from pathlib import Path
from types import (
    BuiltinFunctionType,
    ClassMethodDescriptorType,
    CodeType,
    FunctionType,
    GetSetDescriptorType,
    MemberDescriptorType,
    MethodDescriptorType,
    ModuleType,
    WrapperDescriptorType,
)
from typing import Any

import numpy as np

from twin.compiler.versions import is_fixed

METHODS = BuiltinFunctionType, ClassMethodDescriptorType, WrapperDescriptorType, MethodDescriptorType
NATIVE = (*METHODS, GetSetDescriptorType, MemberDescriptorType, np.ufunc)

HEAP_TYPE = 1 << 9  # flag of classes that are made at run time (Py_TPFLAGS_HEAPTYPE)


def is_there(value: type, module: ModuleType | None) -> bool:
    """Whether a class counts with its module: made in C, or there by its name, which one made at run time may only bear."""
    if not value.__flags__ & HEAP_TYPE:
        return True
    member: Any = module
    for name in value.__qualname__.split("."):
        member = getattr(member, name, None)
    return member is value


def bases_of_user(kind: type) -> list[type]:
    """A class and its bases, those of the language and of fixed packages aside."""
    return [base for base in kind.__mro__ if not is_fixed(base.__module__)]


def computes_items(kind: type) -> bool:
    """Whether a class of a user computes items when they are read."""
    return any(vars(base).keys() & {"__getitem__", "__missing__"} for base in bases_of_user(kind))


def descriptor_names(kind: type) -> set[str] | None:
    """Names of the properties and other descriptors of a class; None if it computes attributes of any name."""
    bases = bases_of_user(kind)
    if any("__getattr__" in vars(base) or "__getattribute__" in vars(base) for base in bases):
        return None
    return {name for base in bases for name, member in vars(base).items() if is_descriptor(member)}


def is_descriptor(value: Any) -> bool:
    """Whether reading an attribute runs code of its class; functions and slots only give what is there."""
    return not isinstance(value, (FunctionType, staticmethod, classmethod, *NATIVE)) and hasattr(type(value), "__get__")


def slot_names(base: type) -> list[str]:
    """Names of a class's slots."""
    slots = vars(base).get("__slots__", ())
    return [name for name in ([slots] if isinstance(slots, str) else slots) if name not in ("__dict__", "__weakref__")]


def names_in(code: CodeType) -> list[str]:
    """All names in a function's code, and in the functions inside it."""
    inner = [name for constant in code.co_consts if isinstance(constant, CodeType) for name in names_in(constant)]
    return [*code.co_names, *inner]


def text_of(file: str) -> str:
    """The text of a source file as it is now; of functions that the engine wrote, what it keeps of them."""
    if file and not file.startswith("<"):
        try:
            return Path(file).read_bytes().decode("utf-8", "surrogateescape")
        except OSError:
            pass
    return "".join(linecache.getlines(file))
