"""The C of a component, and which file it comes from: what there is to know of it without translating anything."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from twin.component import Component


@dataclass(frozen=True, slots=True)
class Sources:
    """C of a component: contents of `NAME.h` and `NAME.c`."""

    name: str
    header: str
    source: str


def source_location(cls: type[Component]) -> str:
    """File of a class, its folder included."""
    try:
        path = Path(inspect.getfile(cls))
    except (TypeError, OSError):
        return "made by the engine"
    return f"{path.parent.name}/{path.name}"
