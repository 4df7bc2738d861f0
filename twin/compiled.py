"""Plain Python over a record becomes native code: the only file that knows numba and LLVM.

The functions are compiled with numba, the LLVM text is stripped of everything Python, and what remains is an object
file that refers to libm alone. The same object is loaded into this process or linked into an FMU. numba is imported
only when something has to be compiled; objects are kept in `build/objects` by the hash of what they were made from.
"""

from __future__ import annotations

import hashlib
import os
import re
import sysconfig
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import BuiltinFunctionType, CellType, CodeType, FunctionType, ModuleType
from typing import TYPE_CHECKING, Any

import llvmlite
import llvmlite.binding as llvm
import numpy as np

from twin import source, tangent
from twin.component import Component, PythonComponent, evaluation, functions
from twin.errors import BuildError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

FORMAT = 7  # raise when generated code changes although no function did

TARGETS = {
    "x86_64-linux":    "x86_64-unknown-linux-gnu",
    "aarch64-linux":   "aarch64-unknown-linux-gnu",
    "x86_64-windows":  "x86_64-w64-windows-gnu",
    "x86_64-darwin":   "x86_64-apple-macosx11.0.0",
    "aarch64-darwin":  "arm64-apple-macosx11.0.0",
}  # fmt: skip

# platforms without an operating system: triple, processor, features; their code is linked into a firmware, not loaded.
# Firmware may trap unaligned accesses, and memory without an MMU must not see them
BARE = {
    "cortex-m7":  ("thumbv7em-unknown-none-eabihf", "cortex-m7",  "+strict-align"),
    "cortex-a53": ("aarch64-unknown-none-elf",      "cortex-a53", "+strict-align"),
}  # fmt: skip

# numba's attributes that must go: its CPU, and its wrapper's wish that the wrapped function stays apart
ATTRIBUTES = {
    '"target-cpu"="':      '"was-cpu"="',
    '"target-features"="': '"was-features"="',
    "{ noinline }":        "{ nounwind }",
}  # fmt: skip

# loops that fill or copy stay loops: LLVM would make calls of memset, memcpy and memmove, which an FMU does not have
OPTIONS = ("-disable-loop-idiom-memset", "-disable-loop-idiom-memcpy")
NUMBERED = re.compile(r"@entry\.(\d+)\b")
BLOCKS = re.compile(r"@llvm\.(memset|memcpy)\.(?!inline)")  # left by unrolled loops: in line, a few stores

LIBM = frozenset(
    [
        "acos",
        "acosh",
        "asin",
        "asinh",
        "atan",
        "atan2",
        "atanh",
        "cbrt",
        "ceil",
        "copysign",
        "cos",
        "cosh",
        "erf",
        "erfc",
        "exp",
        "exp2",
        "expm1",
        "fabs",
        "floor",
        "fma",
        "fmax",
        "fmin",
        "fmod",
        "frexp",
        "hypot",
        "ldexp",
        "lgamma",
        "log",
        "log10",
        "log1p",
        "log2",
        "modf",
        "nearbyint",
        "pow",
        "rint",
        "round",
        "sin",
        "sinh",
        "sqrt",
        "tan",
        "tanh",
        "tgamma",
        "trunc",
    ]
)


def host() -> str:
    """The platform this process runs on, by its FMI 3.0 name."""
    machine_name = os.uname().machine if hasattr(os, "uname") else sysconfig.get_platform().rsplit("-", 1)[-1]
    arch = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine_name.lower(), machine_name.lower())
    system = {"nt": "windows"}.get(os.name, sysconfig.get_platform().split("-", maxsplit=1)[0])
    return f"{arch}-{'darwin' if system == 'macosx' else system}"


# ---------------------------------------------------------------------------------------------------- content hash


def _parts(function: FunctionType, seen: set[int]) -> Iterator[str]:
    """Everything that decides what a function compiles to, in a fixed order."""
    if id(function) in seen:
        return
    seen.add(id(function))
    yield from _code_parts(function.__code__)
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


def content_hash(functions_: tuple[Any, ...], *more: str) -> str:
    """Hash of functions, of all they reach and of the tools that compile them; independent of file times."""
    digest = hashlib.sha256(f"{FORMAT} {llvmlite.__version__} {sysconfig.get_python_version()}".encode())
    seen: set[int] = set()
    for function in functions_:
        for part in _parts(function, seen):
            digest.update(part.encode())
    for text in more:
        digest.update(text.encode())
    return digest.hexdigest()[:32]


# ------------------------------------------------------------------------------------------------ from Python to LLVM


@dataclass(frozen=True)
class Entry:
    """A function to compile: its symbol, and the argument types after the record ('f8', 'i8' or 'record')."""

    symbol: str
    function: Any
    arguments: tuple[str, ...]


@lru_cache(maxsize=1)
def _numba() -> Any:
    """Numba with our machine words, imported on first use; its SVML calls would tie the code to one runtime."""
    os.environ["NUMBA_DISABLE_INTEL_SVML"] = "1"
    os.environ["NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING"] = "1"  # escape codes, wherever colorama is installed
    for option in OPTIONS:
        llvm.set_option("twin", option)
    from twin import intrinsics

    return intrinsics


def _compilable(value: Any, memo: dict[int, Any]) -> Any:
    """A plain function as numba sees it: everything it reaches made compilable too, nothing changed in place."""
    words = _numba().WORDS
    if value in words:
        return words[value]
    if id(value) not in memo:
        scope = dict(value.__globals__)
        for name in _names(value.__code__):
            if isinstance(scope.get(name), FunctionType):
                scope[name] = _compilable(scope[name], memo)
        cells = None
        if value.__closure__:
            contents = [cell.cell_contents for cell in value.__closure__]
            cells = tuple(CellType(_compilable(c, memo) if isinstance(c, FunctionType) else c) for c in contents)
        copy = FunctionType(value.__code__, scope, value.__name__, value.__defaults__, cells)
        memo[id(value)] = _numba().jit(copy)
    return memo[id(value)]


def _module(entry: Entry, symbol: str, dtype: np.dtype[Any], where: str, memo: dict[int, Any]) -> llvm.ModuleRef:
    """One entry point as an LLVM module in which only it is visible."""
    numba = _numba()
    name, text = numba.llvm_text(_compilable(entry.function, memo), dtype, entry.arguments, where)
    module = llvm.parse_assembly(text)
    for function in module.functions:
        if function.is_declaration:
            continue
        if function.name == name:
            function.name = symbol
            function.linkage = "external"
            function.visibility = "hidden"
        else:
            function.linkage = "internal"
    for variable in module.global_variables:
        if variable.name.startswith("_ZN08NumbaEnv"):
            variable.linkage = "internal"
    return module


def _optimize(text: str, target: str) -> tuple[llvm.ModuleRef, llvm.TargetMachine]:
    """Set the target, then optimize; no target features, so that every machine of a platform computes the same."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    triple, processor, features = BARE[target] if target in BARE else (TARGETS[target], "", "")
    target_machine = llvm.Target.from_triple(triple).create_target_machine(
        cpu=processor, features=features, opt=3, reloc="static" if processor else "pic", codemodel="small"
    )
    text = "\n".join(line for line in text.splitlines() if not line.startswith("target "))
    for attribute, instead in ATTRIBUTES.items():
        text = text.replace(attribute, instead)
    module = llvm.parse_assembly(text)
    module.triple = triple
    module.data_layout = str(target_machine.target_data)
    builder = llvm.create_pass_builder(target_machine, llvm.create_pipeline_tuning_options(speed_level=3))
    builder.getModulePassManager().run(module, builder)
    return llvm.parse_assembly(BLOCKS.sub(r"@llvm.\1.inline.", str(module))), target_machine


def _text(entries: tuple[Entry, ...], dtype: np.dtype[Any], where: str) -> str:
    """All entries in one module, before anything of a platform, and numbered instead of named."""
    memo: dict[int, Any] = {}
    whole: llvm.ModuleRef | None = None
    for number, entry in enumerate(entries):
        module = _module(entry, f"entry.{number}", dtype, where, memo)
        if whole is None:
            whole = module
        else:
            whole.link_in(module)
    return str(whole)


def _object(text: str, target: str, where: str, entries: tuple[Entry, ...]) -> bytes:
    named = NUMBERED.sub(lambda match: f"@{entries[int(match[1])].symbol}", text)
    module, target_machine = _optimize(named, target)
    declared = [function.name for function in module.functions if function.is_declaration]
    foreign = sorted(name for name in declared if name not in LIBM and not name.startswith("llvm."))
    if foreign:
        raise BuildError(source.explain_symbols(where, foreign, [entry.function for entry in entries]))
    if any(name.startswith("llvm.memmove.") for name in declared):
        raise BuildError(f"{where}: moving a block became a call of memmove, which FMUs lack. Move element by element.")
    return bytes(target_machine.emit_object(module))


def compile_entries(entries: tuple[Entry, ...], dtype: np.dtype[Any], target: str, where: str, build: Path) -> bytes:
    """Object file with the entries as hidden symbols, from the cache in `build` where it holds them.

    The way from Python to LLVM takes most of the time, and is the same for all platforms and symbols: kept too.
    """
    layout = f"{dtype.descr if dtype.names is None else dtype.fields} {[e.arguments for e in entries]}"
    content = content_hash(tuple(entry.function for entry in entries), layout)
    key = content_hash((), content, str(BARE.get(target, target)), *(entry.symbol for entry in entries))

    def text() -> str:
        return _kept(build / "objects" / f"{content}.ll", lambda: _text(entries, dtype, where).encode()).decode()

    return _kept(build / "objects" / f"{key}.o", lambda: _object(text(), target, where, entries))


def _kept(place: Path, make: Callable[[], bytes]) -> bytes:
    """What a file of the cache holds, made if it is not there."""
    if place.exists():
        return place.read_bytes()
    data = make()
    place.parent.mkdir(parents=True, exist_ok=True)
    partial = place.with_suffix(f".{os.getpid()}")
    partial.write_bytes(data)
    partial.replace(place)
    return data


def component_object(cls: type[Component], target: str, build: Path, prefix: str = "component") -> bytes:
    """Object file of a component with `component_initialize(record, t)` and `component_advance(record, t, h)`.

    `prefix` stands for `component` where several components are linked into one program.
    """
    if issubclass(cls, PythonComponent):
        raise BuildError(f"{cls.__name__}: is Python-side and cannot be compiled. Derive it from Component instead.")
    problems = source.check(cls)
    if problems:
        raise BuildError("\n".join(problems))
    initialize, advance = functions(cls)
    entries = (Entry(f"{prefix}_initialize", initialize, ("f8",)), Entry(f"{prefix}_advance", advance, ("f8", "f8")))
    return compile_entries(entries, cls.layout.dtype, target, cls.__name__, build)


def exchange_entries(cls: type[Component]) -> tuple[Entry, ...]:
    """What Model Exchange needs beside `component_object`; empty for a component that is not continuous."""
    evaluate = evaluation(cls)
    if evaluate is None:
        return ()
    entries = [Entry("component_derivatives", evaluate, ("f8",))]
    tangents = tangent.tangents(cls)
    if not isinstance(tangents, str):
        entries.append(Entry("component_tangent", tangents.at, ("record", "f8", "f8")))
        entries.append(Entry("component_first_tangent", tangents.first, ("record", "f8", "f8")))
    return tuple(entries)


def exchange_object(cls: type[Component], target: str, build: Path) -> bytes:
    """Object file of the entries for Model Exchange; empty if there are none."""
    entries = exchange_entries(cls)
    return compile_entries(entries, cls.layout.dtype, target, cls.__name__, build) if entries else b""


# ----------------------------------------------------------------------------------------------- into this process

_engines: list[Any] = []  # loaded code stays valid as long as the process


def load(code: bytes, symbols: tuple[str, ...]) -> tuple[int, ...]:
    """Load an object file into this process; addresses of its symbols."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine_ = llvm.Target.from_default_triple().create_target_machine(opt=0, codemodel="jitdefault", jit=True)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine_)
    engine.add_object_file(llvm.object_file.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _engines.append(engine)
    return tuple(engine.get_function_address(symbol) for symbol in symbols)


def load_component(cls: type[Component], build: Path) -> tuple[int, int]:
    """Addresses of a component's compiled `initialize(record, t)` and `advance(record, t, h)`."""
    symbols = ("component_initialize", "component_advance")
    initialize, advance = load(component_object(cls, host(), build), symbols)
    return initialize, advance
