"""What an installation takes: each package that the main job, or an extra, brings with it.

    python -m benchmarks.sizes            the main job
    python -m benchmarks.sizes test       with an extra

Prints `name: value` lines, MB of files as they are installed, bytecode not counted; which of our dependencies brought it
stands behind.
"""

from __future__ import annotations

import re
import sys
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement

OWN = "catheter-twin"


def needed(name: str, extras: set[str]) -> list[Requirement]:
    """What a package needs here, with these extras."""
    found = [Requirement(text) for text in metadata.requires(name) or ()]
    return [one for one in found if one.marker is None or any(one.marker.evaluate({"extra": e}) for e in extras | {""})]


def closure(extras: set[str]) -> dict[str, str]:
    """Every package that is installed for ours, and which of our own dependencies it came with first."""
    found: dict[str, str] = {}
    waiting = [(one, normal(one.name)) for one in needed(OWN, extras) if normal(one.name) != OWN]
    while waiting:
        one, first = waiting.pop(0)
        name = normal(one.name)
        if name not in found and name != OWN:
            found[name] = first
            waiting += [(other, first) for other in needed(name, set(one.extras))]
    return found


def normal(name: str) -> str:
    """A package's name as all its spellings have it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def size(name: str) -> float:
    """Size of a package's files [MB]."""
    files = [Path(file.locate()) for file in metadata.files(name) or [] if file.suffix != ".pyc"]
    return sum(file.stat().st_size for file in files if file.exists()) / 1e6


def main() -> None:
    """Print the table."""
    extras = set(sys.argv[1:])
    if "test" in extras:
        extras.add("python")
    rows = sorted(((size(name), name, first) for name, first in closure(extras).items()), reverse=True)
    print(f"all: {sum(mb for mb, *_ in rows):.0f} MB")
    for mb, name, first in rows:
        print(f"{name}: {mb:.1f} MB{f', through {first}' if first != name else ''}")


if __name__ == "__main__":
    main()
