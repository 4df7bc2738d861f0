"""Components as native code: their C, kept in `build/c`, its objects, and their addresses in this process."""

from __future__ import annotations

import contextlib
import ctypes
from pathlib import Path
from typing import TYPE_CHECKING, Any

import twin
from twin.compiler import toolchain
from twin.compiler.content import content_hash, text_hash
from twin.compiler.text import Sources, place_of
from twin.compiler.zig import digest, kept, put
from twin.component import Component, PythonComponent, functions, source
from twin.errors import BuildError

if TYPE_CHECKING:
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


def component_hash(cls: type[Component], *more: str) -> str:
    """Hash of what a component computes and of its memory; its tangents follow from the same functions."""
    return content_hash(functions(cls), layout_text(cls), *more)


def layout_text(cls: type[Component]) -> str:
    """The record's fields, with those of a group's members."""
    dtype = cls.layout.dtype
    return str(dtype.descr if dtype.names is None else dtype.fields)


def sources(cls: type[Component], name: str, build: Path) -> Sources:
    """The C of a component, translated anew only if its Python, or the translator, is new."""
    with toolchain.SYNTAX:
        return _sources(cls, name, build)


def _sources(cls: type[Component], name: str, build: Path) -> Sources:
    if issubclass(cls, PythonComponent):
        raise BuildError(f"{cls.__name__}: is Python-side and cannot be compiled. Derive it from Component instead.")
    place = _place(cls, name, build)
    with contextlib.suppress(FileNotFoundError):
        header, text = ((place / f"{name}.{suffix}").read_text(encoding="utf-8") for suffix in "hc")
        if (place / "hash").read_text() == digest(header, text):  # a file that somebody changed is no longer ours
            return Sources(name, header, text)
    if problems := source.check(cls):
        raise BuildError("\n".join(problems))
    from twin.compiler.component import translate

    made = translate(cls, name)
    for file, content in ((f"{name}.c", made.source), (f"{name}.h", made.header)):
        put(place / file, content.encode())
    put(place / "hash", digest(made.header, made.source).encode())
    return made


def problems(cls: type[Component], build: Path | None = None) -> list[str]:
    """What keeps a component from becoming C, one line each: what the linter sees, else what the translator does.

    `build`: the folder to keep the C in, if there is any.
    """
    from twin.compiler.component import translate

    found = source.check(cls)
    if not found and not issubclass(cls, PythonComponent):
        name = model_name(cls)
        try:
            translate(cls, name) if build is None else sources(cls, name, build)
        except BuildError as error:
            found = str(error).split("\n")
    return found


def is_translated(cls: type[Component], build: Path) -> bool:
    """Whether the C of a component is there."""
    return (_place(cls, model_name(cls), build) / "hash").exists()


def source_hash(cls: type[Component], name: str, *more: str) -> str:
    """Hash of what a component's C is made from: functions with the files they stand in, declarations, start values."""
    declared = [repr(variable) for variable in cls.variables]
    start = {key: value.tolist() for key, value in _starts(cls).items()}
    told = [name, cls.__doc__ or "", cls.__qualname__, place_of(cls), twin.__version__]  # what its comments say
    return text_hash(functions(cls), layout_text(cls), *told, *declared, repr(start), *more)


def _place(cls: type[Component], name: str, build: Path) -> Path:
    """Folder of a component's C, named by what it is made from."""
    return build / "c" / f"{name}-{source_hash(cls, name)[:16]}"


def _starts(cls: type[Component]) -> dict[str, Any]:
    """Start values as arrays."""
    import numpy as np

    return {name: np.asarray(value) for name, value in cls.start_values().items()}


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
    text = TABLE.format(declared=", ".join(f"{one}(void)" for one in symbols), named=", ".join(symbols))
    here = toolchain.host()
    objects = [compile_sources(made, here, build), toolchain.compile_c(text, here, build, name="table.c")]
    (table,) = toolchain.load(toolchain.link(here, objects, build, keep=True, newest=True), build, ("table",))
    return tuple((ctypes.c_void_p * len(symbols)).from_address(table))


_loaded: dict[tuple[type[Component], Path], tuple[int, int]] = {}  # classes do not change, code stays loaded


def load_component(cls: type[Component], build: Path) -> tuple[int, int]:
    """Addresses of a component's compiled `start(record, t)` and `step(record, t, h)`."""
    if (cls, build) not in _loaded:
        name = model_name(cls)
        start, step = load_symbols(sources(cls, name, build), build, (f"{name}_start", f"{name}_step"))
        _loaded[cls, build] = start, step
    return _loaded[cls, build]


def load_record_function(dtype: np.dtype[Any], name: str, function: Any, head: str, build: Path) -> int:
    """Address of a function over a plain record, `int32_t NAME_run(record)`."""
    key = text_hash((function,), str(dtype.descr), name, head)
    path = build / "c" / f"{name}-{key[:16]}" / f"{name}.c"

    def made() -> bytes:
        from twin.compiler.component import translate_record

        return translate_record(dtype, name, function, head).encode()

    text = kept(path.with_suffix(".kept"), made).decode()
    if not path.exists():
        put(path, text.encode())
    return load_symbols(Sources(name, "", text), build, (f"{name}_run",))[0]
