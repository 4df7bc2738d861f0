"""What decides which C a function becomes: a hash of its code and of all it reaches, independent of file times."""

from __future__ import annotations

import hashlib
import linecache
import sysconfig
from functools import cache
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

ENGINE = Path(__file__).parent


@cache
def engine() -> str:
    """Hash of the translator itself, so that nothing an older one wrote is taken for its work."""
    digest = hashlib.sha256(sysconfig.get_python_version().encode())
    for file in sorted(ENGINE.rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _parts(function: FunctionType, seen: dict[int, FunctionType]) -> Iterator[str]:
    """Everything that decides what a function compiles to, in a fixed order."""
    if id(function) in seen:
        return
    seen[id(function)] = function
    yield from _code_parts(function.__code__)
    yield repr(function.__defaults__)
    reached = {name: function.__globals__[name] for name in _names(function.__code__) if name in function.__globals__}
    for cell_name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        reached[cell_name] = cell.cell_contents
    for name, value in sorted(reached.items()):
        if isinstance(value, FunctionType):
            yield name
            yield from _parts(value, seen)
        elif isinstance(value, np.ndarray):
            yield f"{name}={value.dtype.str}{value.shape}{value.tobytes().hex()}"
        elif not isinstance(value, ModuleType | BuiltinFunctionType | type):
            yield f"{name}={value!r}"


def _names(code: CodeType) -> list[str]:
    """Global names a function reads, those of its inner code included."""
    inner = [name for const in code.co_consts if isinstance(const, CodeType) for name in _names(const)]
    return [*code.co_names, *inner]


def _code_parts(code: CodeType) -> Iterator[str]:
    yield f"{code.co_code.hex()}|{code.co_names}|{code.co_varnames}"
    for const in code.co_consts:
        if isinstance(const, CodeType):
            yield from _code_parts(const)
        else:
            yield repr(const)


def content_hash(functions: tuple[Any, ...], *more: str) -> str:
    """Hash of what functions compute, of the layout or other text in `more`, and of the translator."""
    return _hash(functions, more, {})


def text_hash(functions: tuple[Any, ...], *more: str) -> str:
    """The same with the files the functions stand in: their comments and lines are in the C text too."""
    seen: dict[int, FunctionType] = {}
    content = _hash(functions, more, seen)
    files = sorted({function.__code__.co_filename for function in seen.values()})
    digest = hashlib.sha256(content.encode())
    for file in files:
        if not file.startswith("<"):
            digest.update("".join(linecache.getlines(file)).encode())
    return digest.hexdigest()[:32]


def _hash(functions: tuple[Any, ...], more: tuple[str, ...], seen: dict[int, FunctionType]) -> str:
    digest = hashlib.sha256(engine().encode())
    for function in functions:
        for part in _parts(function, seen):
            digest.update(part.encode())
    for text in more:
        digest.update(text.encode())
    return digest.hexdigest()[:32]
