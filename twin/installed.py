"""Installed packages: their versions and entry points, from the names and files of their folders.

`importlib.metadata` knows both, but imports a parser of mail for it, which takes as long as all else that `twin --help`
does. It is asked where the folders do not tell.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
from functools import cache, reduce
from typing import Any

SUFFIX = ".dist-info"
STANDARD_LIBRARY = os.path.dirname(os.__file__) + os.sep  # noqa: PTH120 - quicker


@cache
def folders() -> dict[str, tuple[str, str]]:
    """Version and folder of every installed package; the first on the path counts, as for an import."""
    found: dict[str, tuple[str, str]] = {}
    for entry in dict.fromkeys(sys.path):
        try:
            names = os.listdir(entry or ".")  # noqa: PTH208 - quicker
        except OSError:
            continue  # an archive, or nothing
        for name in names:
            package, hyphen, version = name.removesuffix(SUFFIX).partition("-")
            if name.endswith(SUFFIX) and hyphen:
                found.setdefault(normal(package), (version, os.path.join(entry, name)))  # noqa: PTH118 - quicker
    return found


def normal(package: str) -> str:
    """A package's name as all its spellings have it."""
    return re.sub(r"[-_.]+", "-", package).lower()


def is_standard_library(module: str) -> bool:
    """Whether an imported module is Python's own, and not a user's file of the same name."""
    top = module.partition(".")[0]
    if top not in sys.stdlib_module_names:
        return False
    file = getattr(sys.modules.get(top), "__file__", None)
    return file is None or file.startswith(STANDARD_LIBRARY)


def version(package: str) -> str:
    """Version of a package; `importlib.metadata.PackageNotFoundError` if there is none."""
    if normal(package) in folders():
        return folders()[normal(package)][0]
    from importlib import metadata

    return metadata.version(package)


def entry_points(group: str) -> dict[str, str]:
    """What packages offer to a group, such as `{"drive": "hw_bridge.drive.command:command"}`, by name."""
    found: dict[str, str] = {}
    for _, folder in folders().values():
        try:
            with open(f"{folder}/entry_points.txt", encoding="utf-8") as file:
                lines = file.read().splitlines()
        except OSError:
            continue
        section = ""
        for line in map(str.strip, lines):
            name, equals, place = line.partition("=")
            if line.startswith("["):
                section = line[1:-1].strip()
            elif section == group and equals and not line.startswith(("#", ";")):
                found.setdefault(name.strip(), place.partition("[")[0].strip())
    return dict(sorted(found.items()))


def load(place: str) -> Any:
    """What an entry point names."""
    module, _, name = place.partition(":")
    return reduce(getattr, name.split("."), importlib.import_module(module))
