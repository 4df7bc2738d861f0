"""Native code of components: their C, the object files, and the addresses in this process."""

from __future__ import annotations

import ctypes
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import twin
from twin.compiler import toolchain
from twin.compiler.component_source import Sources, source_location
from twin.compiler.fingerprint import fingerprint
from twin.component import Component, PythonComponent, functions, source
from twin.errors import BuildError
from twin.store import Store, make_key

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np

# what an FMU holds is hidden; the same object serves this process behind a table of addresses
TABLE = """extern void {declared};
__attribute__((visibility("default"))) void (*const table[])(void) = {{{named}}};
"""


def model_name(cls: type[Component]) -> str:
    """Name of the model: the component's folder in `fmus`, else the class; with its period if that is not its own."""
    parts = cls.__module__.split(".")
    of_a_folder = len(parts) == 3 and parts[0] == "fmus" and parts[2] == "model"
    return parts[1] + cls.sampled_as if of_a_folder else cls.__name__


def sources(cls: type[Component], name: str, build: Path) -> Sources:
    """Return the C of a component; translate it again if anything that the last translation could read has changed."""
    if issubclass(cls, PythonComponent):
        raise BuildError(f"{cls.__name__}: is Python-side and cannot be compiled. Derive it from Component instead.")
    with toolchain.SYNTAX:
        key = component_fingerprint(cls, name)
        files = Store(build).get(name, key) if key is not None else None
        if files is not None:
            return Sources(name, files[f"{name}.h"].decode(), files[f"{name}.c"].decode())
        if problems := source.check(cls):
            raise BuildError("\n".join(problems))
        from twin.compiler.component import translate

        made = translate(cls, name)
        files = {f"{name}.h": made.header.encode(), f"{name}.c": made.source.encode()}
        Store(build).put(name, key or make_key(*files.values()), files)
        return made


def problems(cls: type[Component], build: Path | None = None) -> list[str]:
    """List the reasons why a component cannot be translated to C, one line each: from the linter, else from the translator.

    `build`: the folder to keep the C in, if there is any.
    """
    from twin.compiler.component import translate

    messages = source.check(cls)
    if not messages and not issubclass(cls, PythonComponent):
        name = model_name(cls)
        try:
            translate(cls, name) if build is None else sources(cls, name, build)
        except BuildError as error:
            messages = str(error).split("\n")
    return messages


def is_translated(cls: type[Component], build: Path) -> bool:
    """Return whether the C of the current state of a component is stored."""
    name = model_name(cls)
    key = component_fingerprint(cls, name)
    return key is not None and Store(build).path(name, key).exists()


def component_fingerprint(cls: type[Component], *more: str) -> str | None:
    """Key of what is made from a component and `more`; None for an untraceable component.

    The record of a new instance is part of it, since `__init__` may compute start values.
    """
    if cls not in _fingerprints:
        _fingerprints[cls] = fingerprint(
            cls, functions(cls), source_location(cls), twin.__version__, cls().record.tobytes()
        )
    base = _fingerprints[cls]
    return make_key(base, *more) if base is not None else None


def reset_fingerprints() -> None:
    """Discard cached fingerprints, so that sources and values are read again; call this when a run begins."""
    _fingerprints.clear()


def component_object(cls: type[Component], target: str, build: Path, name: str) -> bytes:
    """Object file of a component for a platform: `NAME_init`, `NAME_start`, `NAME_step`, ..."""
    made = sources(cls, name, build)
    return compile_sources(made, target, build)


def compile_sources(made: Sources, target: str, build: Path) -> bytes:
    """Object file of a component's C."""
    headers = {f"{made.name}.h": made.header}
    return toolchain.compile_c(made.source, target, build, headers=headers, name=f"{made.name}.c")


def load_symbols(made: Sources, build: Path, symbols: tuple[str, ...]) -> tuple[int, ...]:
    """Addresses of functions of a component's C in this process."""
    text = TABLE.format(declared=", ".join(f"{symbol}(void)" for symbol in symbols), named=", ".join(symbols))
    here = toolchain.host()
    objects = [compile_sources(made, here, build), toolchain.compile_c(text, here, build, name="table.c")]
    (table,) = toolchain.load(made.name, objects, build, ("table",))
    return tuple((ctypes.c_void_p * len(symbols)).from_address(table))


_fingerprints: dict[type[Component], str | None] = {}  # of one run


def load_component(cls: type[Component], build: Path) -> tuple[int, int]:
    """Addresses of a component's compiled `start(record, t)` and `step(record, t, h)`."""
    name = model_name(cls)
    start, step = load_symbols(sources(cls, name, build), build, (f"{name}_start", f"{name}_step"))
    return start, step


@lru_cache(maxsize=32)
def load_record_function(
    dtype: np.dtype[Any], name: str, function: Any, head: str, build: Path
) -> Callable[[int], int]:
    """Compile a function over a plain record, `int32_t NAME_run(record)`; returns a native function of its address."""
    key = fingerprint(function, dtype, name, head)
    assert key is not None, "functions of the engine can be traced"

    def create() -> dict[str, bytes]:
        from twin.compiler.component import translate_record

        return {f"{name}.c": translate_record(dtype, name, function, head).encode()}

    text = Store(build).get_or_create(name, key, create)[f"{name}.c"].decode()
    address = load_symbols(Sources(name, "", text), build, (f"{name}_run",))[0]
    return ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p)(address)
