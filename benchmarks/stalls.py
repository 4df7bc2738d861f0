"""What a busy host does to the cycle of three drives, beside bare loops in C in the same run; where a cycle's time goes.

    python -m benchmarks.hil beside [SECONDS [RUNS]]     both loops while two processes keep the cores busy
    python -m benchmarks.hil where [SECONDS]             time of a cycle by what it went to, and a frame's, two ways

The bare loops have the master's priority and do nothing: what they see is the host's. A host that gives a virtual machine
its share in periods of 100 ms stalls it at the same place of every twentieth cycle: hence five phases, taken together.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can
import numpy as np

from benchmarks import hil
from hw_bridge.bus import Frame
from hw_bridge.wire import link, open_bus, shut_down
from hw_bridge.wire.link import AnyLink
from hw_bridge.wire.realtime import MASTER, set_fifo_priority

PERIOD = 5_000_000  # [ns]
HERE = Path(__file__).parent
PHASES = 5  # of bare loops, evenly over a cycle
TAIL = 2.0  # of a run, until its command has ended [s]
FRAMES, BURST = 2_000, 10  # sent and heard for the cost of one; so many at once, as in a cycle
FIGURES = (("median", 0.5), ("99", 0.99), ("999", 0.999), ("max", 1.0))


@contextlib.contextmanager
def burners(count: int = 2) -> Iterator[None]:
    """Processes that keep the cores busy."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for one in busy:
            one.kill()
            one.wait()


class Metronomes:
    """Bare loops at several phases of the cycle: a stall that comes at regular times hits some and misses others."""

    def __init__(self, folder: Path) -> None:
        program = folder / "metronome"
        source = str(HERE / "metronome.c")
        subprocess.run([sys.executable, "-m", "ziglang", "cc", "-O2", "-o", str(program), source], check=True)
        self.processes = [
            subprocess.Popen(
                [str(program), str(PERIOD), str(PERIOD * k // PHASES), str(MASTER)], stdout=subprocess.PIPE, text=True
            )
            for k in range(PHASES)
        ]

    def errors(self, seconds: float) -> list[np.ndarray[Any, Any]]:
        """Periods minus the wanted one of each, of the time that a run took that has just ended [s]."""
        for one in self.processes:
            one.terminate()
        return [np.abs(_errors(np.array(one.communicate()[0].split(), np.int64), seconds)) for one in self.processes]


def _errors(times: np.ndarray[Any, Any], seconds: float) -> np.ndarray[Any, Any]:
    end = times[-1] - round(TAIL * 1e9)
    return np.asarray((np.diff(times[(times > end - round(seconds * 1e9)) & (times < end)]) - PERIOD) / 1e9)


def beside(seconds: float, runs: int, load: int = 2) -> None:
    """Print the figures of both loops for each run, and of the worst."""
    build, ended, ratios = Path("build"), 0, []
    for number in range(1, runs + 1):
        with tempfile.TemporaryDirectory() as name, burners(load):
            metronomes = Metronomes(folder := Path(name))
            try:
                found = hil.measure_rig("udp_multicast", hil.GROUP, seconds, folder, build)
            finally:
                loops = metronomes.errors(seconds)
            bare = np.concatenate(loops)
        (case,) = found["hardware"]["cases"]
        ended += found["status"] != "completed"
        hil.tell(f"beside_{number}", found)
        if found["status"] != "completed":
            print("\n".join(f"beside_{number}_seen: {one}" for one in case["seen"][-8:]))
        print(f"beside_{number}_longest_overrun_ms: {1e3 * case['longest_overrun']:.3f}")
        for key, share in FIGURES:
            print(f"beside_{number}_bare_{key}_ms: {1e3 * float(np.quantile(bare, share)):.3f}")
        worst = max(float(np.quantile(one, 0.999)) for one in loops)
        print(f"beside_{number}_bare_999_of_the_worst_phase_ms: {1e3 * worst:.3f}")
        ratios.append(case["jitter_999"] / float(np.quantile(bare, 0.999)))
        print(f"beside_{number}_ratio_999: {ratios[-1]:.2f}", flush=True)
    print(f"beside_ended_before_the_end: {ended} of {runs}")
    print(f"beside_ratio_999_median: {np.median(ratios):.2f}")
    print(f"beside_ratio_999_worst: {max(ratios):.2f}")


def where(seconds: float) -> None:
    """Print a cycle's time by what it went to, then the cost of a frame through python-can and past it."""
    with tempfile.TemporaryDirectory() as folder:
        found = hil.measure_rig("udp_multicast", hil.GROUP, seconds, Path(folder), Path("build"))
    (case,) = found["hardware"]["cases"]
    for name, time_span in case["spent"].items():
        print(f"where_{name}_us: {1e6 * time_span:.0f}")
    set_fifo_priority(MASTER)
    for interface in ("udp_multicast", "slcan"):
        for way in ("python-can", "direct"):
            for name, cost in frame_cost(interface, way).items():
                print(f"where_{interface}_{way}_{name}_us: {1e6 * cost:.1f}")


def frame_cost(interface: str, way: str) -> dict[str, float]:
    """Processor time to send and to hear a frame [s], in bursts as they come in a cycle."""
    group = f"239.74.{uuid.uuid4().int % 250}.{os.getpid() % 250 + 1}"
    with hil.bus(interface, group, 2) as ends:
        buses = [open_bus(interface, end, 1_000_000, hil.options(interface)) for end in ends]
        make: Callable[[can.BusABC, str], Any] = AnyLink if way == "python-can" else link
        ours, theirs = (make(one, interface) for one in buses)
        sending = hearing = 0.0
        frame = Frame(0x201, bytes(8))
        for _ in range(FRAMES // BURST):
            begin = time.thread_time()
            for _ in range(BURST):
                ours.send(frame)
            sending += time.thread_time() - begin
            time.sleep(0.002)
            begin, heard = time.thread_time(), 0
            while heard < BURST:
                heard += len(theirs.hear(0.1))
            hearing += time.thread_time() - begin
            if interface == "udp_multicast":  # what is sent comes back
                while ours.hear(0.0):
                    pass
        for one in buses:
            shut_down(one)
    return {"send": sending / FRAMES, "receive": hearing / FRAMES}
