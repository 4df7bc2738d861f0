"""Functions whose text is made by the engine: defined here, so that debuggers, tracebacks and the compiler find it."""

from __future__ import annotations

import itertools
import linecache
from functools import lru_cache
from types import CodeType
from typing import Any

_numbers = itertools.count(1)


def define(name: str, text: str, scope: dict[str, Any], what: str) -> Any:
    """Run text that defines functions in a scope, and keep it as the source of a file called `what`; the function."""
    exec(_code(text, what), scope)  # noqa: S102 - our own text, from checked names
    return scope[name]


@lru_cache(maxsize=64)
def _code(text: str, what: str) -> CodeType:
    """A scenario that is read again defines the same functions again: most of the time of a large group."""
    path = f"<{what} {next(_numbers)}>"
    linecache.cache[path] = (len(text), None, text.splitlines(keepends=True), path)
    return compile(text, path, "exec")
