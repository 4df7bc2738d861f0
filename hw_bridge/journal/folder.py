"""Folder of journals and dumps of each drive: in the user's state folder, for all working folders."""

from __future__ import annotations

import os
import re
from pathlib import Path

VARIABLE = "TWIN_STATE"


def state_folder() -> Path:
    """`$TWIN_STATE`, else `twin` in the user's state folder (XDG; `%LOCALAPPDATA%` on Windows)."""
    if given := os.environ.get(VARIABLE):
        return Path(given)
    base = os.environ.get("LOCALAPPDATA" if os.name == "nt" else "XDG_STATE_HOME")
    return (Path(base) if base else Path.home() / ".local" / "state") / "twin"


def bus_folder(interface: str, channel: str, software: bool, options: object = None) -> Path:
    """Folder of a bus. A drive keeps its journal when it is moved to another adapter, so real buses share one.

    Simulated drives have made-up serial numbers: each bus that exists in software only has a folder of its own.
    """
    root = state_folder() / "drives"
    if not software:
        return root
    words = [interface, channel, *(f"{key}-{value}" for key, value in sorted(dict(options or {}).items()))]  # type: ignore[call-overload]
    return root / re.sub(r"[^A-Za-z0-9.-]+", "_", "_".join(words))
