"""What counts as a whole in a fingerprint: the engine by the content of its files, installed packages by their version."""

from __future__ import annotations

import hashlib
import os
import sys
from functools import cache
from pathlib import Path
from typing import Any

from twin import installed

ENGINE = Path(__file__).parents[1]
SUFFIXES = (".py", ".pyi", ".c", ".h", ".html", ".xsd")
LIBRARIES = ("numpy", "scipy", "ziglang", "pint", "jinja2", "markdown-it-py")  # whose versions decide what is written
VERSIONED = {"numpy", "scipy"}  # packages that change with their version only


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


def is_fixed(module: Any) -> bool:
    """Whether a module changes with the version of its package only; some types of C have a descriptor for its name."""
    if not isinstance(module, str):
        return True
    return module.partition(".")[0] in VERSIONED or installed.is_standard_library(module)


@cache
def is_of_engine(file: str | None) -> bool:
    """Whether a file is one of the engine's, which count as a whole."""
    return bool(file) and str(file).startswith(f"{ENGINE}{os.sep}")
