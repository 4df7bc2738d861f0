"""Functions whose text is made by the engine: defined here, so that debuggers, tracebacks and the compiler find it."""

from __future__ import annotations

import itertools
import linecache
from typing import Any

_numbers = itertools.count(1)


def define(name: str, text: str, scope: dict[str, Any], what: str) -> Any:
    """Run text that defines functions in a scope, and keep it as the source of a file called `what`; the function."""
    path = f"<{what} {next(_numbers)}>"
    linecache.cache[path] = (len(text), None, text.splitlines(keepends=True), path)
    exec(compile(text, path, "exec"), scope)  # noqa: S102 - our own text, from checked names
    return scope[name]
