"""Versions and entry points of installed packages, and which modules are the standard library's."""

from __future__ import annotations

import os
import sys
from importlib import metadata
from pathlib import Path

STANDARD_LIBRARY = str(Path(os.__file__).parent) + os.sep

version = metadata.version


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
