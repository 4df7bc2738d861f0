"""Versions and entry points of installed packages, optional dependencies, and which modules are the standard library's."""

from __future__ import annotations

import importlib
import os
import re
import sys
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from twin.errors import TwinError

STANDARD_LIBRARY = str(Path(os.__file__).parent) + os.sep


@cache
def version(package: str) -> str:
    """Version of an installed package, without the rest of its metadata, which takes milliseconds to parse."""
    text = metadata.distribution(package).read_text("METADATA") or ""
    match = re.search(r"^Version: *(\S+)", text, re.MULTILINE)
    return match[1] if match else metadata.version(package)


def entry_points(group: str) -> dict[str, metadata.EntryPoint]:
    """Entry points of a group, such as `twin.commands`, in the order of their names."""
    return {point.name: point for point in sorted(metadata.entry_points(group=group))}


def is_standard_library(module: str) -> bool:
    """Whether an imported module is Python's own, and not a user's file of the same name."""
    top = module.partition(".")[0]
    if top not in sys.stdlib_module_names:
        return False
    file = getattr(sys.modules.get(top), "__file__", None)
    return file is None or file.startswith(STANDARD_LIBRARY)


def import_optional(module: str, extra: str, what: str) -> Any:
    """Import a module of the optional dependencies `extra`; TwinError says how to install it. `what` needs it."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or module.partition(".")[0] != error.name.partition(".")[0]:
            raise
        raise TwinError(
            f"{what} needs {error.name}, which is not installed. Run: pip install 'catheter-twin[{extra}]'."
        ) from None
