"""Translate components to C and compile it to native code; the only package that calls a compiler.

Stages: `resolve` (what names stand for), `infer` (types), `write` (text); `unit` puts a file together, `component` a
component's header and source. `toolchain` calls clang and LLD; `native` keeps what they make. Two more read what
`resolve` finds: `dependencies` (what an output is computed from) and `tangent` (directional derivatives).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
