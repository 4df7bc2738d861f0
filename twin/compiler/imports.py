"""Modules that the import statements of a source text name."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from importlib.util import resolve_name

IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+([.\w]+)[ \t]+import\b[ \t]*(\([^)]*\)|[^\n]*)|import[ \t]+([^\n]*))", re.MULTILINE
)


def imports_of(text: str, package: str) -> Iterator[str]:
    """Names that a text's import statements may mean as modules, and the packages that these are in."""
    for origin, imported, modules in IMPORT.findall(text):
        with contextlib.suppress(ImportError):
            base = resolve_name(origin, package or None) if origin.startswith(".") else origin
            names = [words.split()[0] for words in (imported or modules).strip("() \t").split(",") if words.split()]
            for name in [base, *(f"{base}.{name}" for name in names)] if origin else names:
                parts = name.split(".")
                yield from (".".join(parts[: number + 1]) for number in range(len(parts)))
