"""All benchmarks, printed and kept.

    pip install -e '.[bench]' && python -m benchmarks

The lines go to stdout and to benchmarks/results/<date>_<revision>.txt, below what they were measured on.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import os
import platform
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import TextIO

from benchmarks import bench, export, first_times, force, group, hil, isolate, iterate, peers, rig, ring, startup

RESULTS = Path(__file__).parent / "results"
PACKAGES = (
    "numpy",
    "ziglang",
    "fmpy",
    "fmu-manipulation-toolbox",
    "ecospy",
    "tbb",
    "libcosimpy",
)


class Both:
    """Text to several files at once."""

    def __init__(self, *files: TextIO) -> None:
        self.files = files

    def write(self, text: str) -> int:
        for file in self.files:
            file.write(text)
        return len(text)

    def flush(self) -> None:
        for file in self.files:
            file.flush()


def revision() -> str:
    """Revision of the working copy, with `-changed` if the package has changes that are not committed."""
    try:
        short = command("git", "rev-parse", "--short", "HEAD").strip()
        changed = command(
            "git", "status", "--porcelain", "--", "twin", "fmus", "scenarios", "benchmarks/*.py", "benchmarks/*.c"
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return f"{short}-changed" if changed.strip() else short


def command(*words: str) -> str:
    """What a command prints."""
    return subprocess.run(words, check=True, capture_output=True, text=True, cwd=Path(__file__).parent.parent).stdout


def processor() -> str:
    """Model of the processor."""
    with contextlib.suppress(OSError):
        found = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())
        if found:
            return found[1]
    return platform.processor() or platform.machine()


def version(package: str) -> str:
    """Version of a package, or that it is missing."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def machine() -> None:
    """Print what the figures were measured on: no names of hosts, no paths."""
    system = platform.freedesktop_os_release()["PRETTY_NAME"] if sys.platform == "linux" else platform.platform()
    print(f"date: {dt.datetime.now(dt.UTC):%Y-%m-%d}")
    print(f"revision: {revision()}")
    print(f"processor: {processor()}")
    print(f"cores: {os.cpu_count()}")
    print(f"load_before: {os.getloadavg()[0]:.2f}")
    print(f"system: {system}, {platform.system()} {platform.machine()}")
    print(f"python: {platform.python_version()}")
    print(f"packages: {', '.join(f'{name} {version(name)}' for name in PACKAGES)}")


def main() -> None:
    """Run everything; force and rig come last, since they keep this process on one core."""
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"{dt.datetime.now(dt.UTC):%Y-%m-%d}_{revision()}.txt"
    with path.open("w") as file, contextlib.redirect_stdout(Both(sys.stdout, file)):  # type: ignore[type-var]
        machine()
        ring.main()
        iterate.main()
        peers.compare()
        startup.measure()
        first_times.main()
        group.main()
        isolate.main()
        hil.show(60.0)
        export.main()
        bench.measure()
        force.main()
        rig.main()
    print(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


if __name__ == "__main__":
    main()
