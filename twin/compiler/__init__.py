"""Translate components to C and compile it to native code; the only package that calls a compiler.

Stages: `resolve` (what names stand for), `infer` (types), `write` (text); `unit` puts a file together, `component` a
component's header and source. `toolchain` calls clang and LLD; `native` keeps what they make. Two more read what
`resolve` finds: `dependencies` (what an output is computed from) and `tangent` (directional derivatives).
"""

from typing import TYPE_CHECKING

import lazy_loader

from twin.compiler import machine
from twin.compiler.component_source import Sources
from twin.compiler.dependencies import dependencies, flow
from twin.compiler.fingerprint import fingerprint
from twin.compiler.hosted import build_hosted_library
from twin.compiler.imports import source_hash
from twin.compiler.machine import (
    call_access,
    call_state,
    call_step,
    call_trial,
    read8,
    read16,
    read32,
    read64,
    read_float,
    read_float32,
    write8,
    write16,
    write32,
    write64,
    write_float,
    write_float32,
)
from twin.compiler.native import (
    compile_sources,
    component_fingerprint,
    component_object,
    is_translated,
    load_component,
    load_record_function,
    load_symbols,
    model_name,
    problems,
    reset_fingerprints,
    sources,
)
from twin.compiler.toolchain import (
    BARE,
    LIBM,
    PLATFORMS,
    SYNTAX,
    archive,
    compile_c,
    host,
    in_order,
    link,
    side_by_side,
)
from twin.compiler.versions import engine

if TYPE_CHECKING:
    from twin.compiler import library
    from twin.compiler.autodiff import Tangents, tangents
    from twin.compiler.component import translate

# the translator, which a run of components that are already built does not need
__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submodules=["library"],
    submod_attrs={"autodiff": ["Tangents", "tangents"], "component": ["translate"]},
)

__all__ = [
    "BARE",
    "LIBM",
    "PLATFORMS",
    "SYNTAX",
    "Sources",
    "Tangents",
    "archive",
    "build_hosted_library",
    "call_access",
    "call_state",
    "call_step",
    "call_trial",
    "compile_c",
    "compile_sources",
    "component_fingerprint",
    "component_object",
    "dependencies",
    "engine",
    "fingerprint",
    "flow",
    "host",
    "in_order",
    "is_translated",
    "library",
    "link",
    "load_component",
    "load_record_function",
    "load_symbols",
    "machine",
    "model_name",
    "problems",
    "read8",
    "read16",
    "read32",
    "read64",
    "read_float",
    "read_float32",
    "reset_fingerprints",
    "side_by_side",
    "source_hash",
    "sources",
    "tangents",
    "translate",
    "write8",
    "write16",
    "write32",
    "write64",
    "write_float",
    "write_float32",
]
