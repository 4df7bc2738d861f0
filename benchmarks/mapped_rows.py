"""Time to write a row of a recording: into memory, as the loop does, or into a file that is mapped into memory.

    python -m benchmarks.mapped_rows [FOLDER]      prints `name: value` lines [us]; FOLDER is on the disk that is measured

A row of 200 words every millisecond for ten seconds, on an idle disk and while another process writes files of 300 MiB
and waits for the disk. All pages are touched first. Where the disk is written back, its pages are write-protected and the
next write waits: see decision 0016.
"""

from __future__ import annotations

import mmap
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SIZE = 64 << 20  # of the memory [byte]
ROW = 1600  # [byte]
PERIOD, DURATION = 1e-3, 10.0  # [s]
BUSY = "while true; do dd if=/dev/zero of={0}/other bs=1M count=300 conv=fsync 2>/dev/null; done"


def write_times(memory: mmap.mmap, duration: float) -> list[float]:
    """Write rows for a time [s]; return how long each took [us], the shortest first."""
    memory[:] = bytes(len(memory))
    row, position, times = os.urandom(ROW), 0, []
    following = time.perf_counter()
    end = following + duration
    while following < end:
        begin = time.perf_counter()
        memory[position : position + ROW] = row
        times.append(1e6 * (time.perf_counter() - begin))
        position = (position + ROW) % (len(memory) - ROW)
        following += PERIOD
        time.sleep(max(0.0, following - time.perf_counter()))
    return sorted(times)


def measure(root: Path, duration: float = DURATION) -> None:
    """Print median, 99.9 % and maximum for both kinds of memory."""
    with tempfile.TemporaryDirectory(dir=root) as folder, Path(folder, "rows").open("w+b") as file:
        file.truncate(SIZE)
        memories = {"memory": mmap.mmap(-1, SIZE), "file": mmap.mmap(file.fileno(), SIZE)}
        for disk in ("idle", "busy"):
            for name, memory in memories.items():
                words = ["sh", "-c", BUSY.format(folder) if disk == "busy" else "true"]
                with subprocess.Popen(words, start_new_session=True) as other:
                    times = write_times(memory, duration)
                    if disk == "busy":
                        os.killpg(other.pid, 15)
                for what, share in (("median", 0.5), ("999", 0.999), ("max", 1.0)):
                    value = times[min(int(share * len(times)), len(times) - 1)]
                    print(f"mapped_rows_{disk}_{name}_{what}_us: {value:.1f}", flush=True)


if __name__ == "__main__":
    measure(Path(*sys.argv[1:]))
