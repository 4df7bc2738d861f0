"""C compilers for tests: clang as it builds components, and what links programs with a C library."""

import shutil

from twin import compiler
from twin.compiler import library, zig

CLANG = [str(zig.executable()), "clang", "-nostdinc", "-isystem", str(zig.headers())]


def linking(target: str, language: str = "c") -> list[str]:
    """GCC where it is and for this machine, else zig, which takes seconds: it makes the C library that it links first."""
    own = shutil.which({"c": "gcc", "c++": "g++"}[language])
    if own and target == compiler.host():
        return [own]
    tool = {"c": "cc", "c++": "c++"}[language]
    return [str(zig.executable()), tool, "-target", library.TRIPLES[target][0]]
