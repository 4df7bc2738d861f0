"""Modules that the import statements of a source text name."""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import re
import sys
from collections.abc import Iterator
from importlib.util import resolve_name
from typing import Any

from twin.compiler.introspection import text_of
from twin.compiler.versions import is_fixed
from twin.component import source_import

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


def modules_of(text: str, package: str, visited: set[str]) -> Iterator[tuple[str, str | None]]:
    """Modules that a text imports: name, and the text of a user's module that a function will import when it runs.

    Nothing is imported. `visited`: names that were looked up before, which are added to.
    """
    for name in imports_of(text, package):
        if name in sys.modules:
            yield name, None
        elif name not in visited and not is_fixed(name):
            visited.add(name)
            if spec := source_import.find_user_file(name):
                later = text_of(spec.origin or "")
                yield name, later
                yield from modules_of(later, spec.parent or "", visited)


def source_hash(value: Any) -> str:
    """SHA-256 of the file of a class or function, followed by the user's modules that it imports, directly or through others."""
    value = inspect.unwrap(value)
    module = sys.modules.get(value.__module__)
    own = text_of(inspect.getsourcefile(value) or "")
    texts = {value.__module__: ""}
    visited: set[str] = set()
    waiting = [(own, getattr(module, "__package__", None) or "")]
    while waiting:
        for name, later in modules_of(*waiting.pop(), visited):
            loaded = sys.modules.get(name)
            file = getattr(loaded, "__file__", None) or ""
            if name in texts or is_fixed(name) or not (later or source_import.is_of_person(name, file)):
                continue
            texts[name] = text_of(file) if later is None else later
            if later is None:
                waiting.append((texts[name], getattr(loaded, "__package__", None) or ""))
    del texts[value.__module__]
    parts = [own, *(f"\n{name}\n{texts[name]}" for name in sorted(texts))]
    return hashlib.sha256("".join(parts).encode("utf-8", "surrogateescape")).hexdigest()
