"""Former names of public Python objects and arguments: accepted for one release, with a one-line note."""

from __future__ import annotations

import logging
from typing import TypeVar

Value = TypeVar("Value")


def note_former(old: str, new: str) -> None:
    """Log that a former name was used."""
    logging.getLogger("twin").warning("note: %s is now %s; the old name ends with the next release.", old, new)


def former_argument(old: str, value: Value | None, new: str, current: Value) -> Value:
    """Return the value given under the former name of an argument, or the current one if there is none."""
    if value is None:
        return current
    note_former(f"{old}=", f"{new}=")
    return value
