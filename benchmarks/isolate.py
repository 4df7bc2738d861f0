"""What a process of its own costs: rings of cheap FMUs, each isolated, beside a byte through two pipes and back.

    python -m benchmarks.isolate         prints `name: value` lines; times are us per member and step

All take turns. `ratio` is to the bare pipes of two Python processes, median of the pairs. These may lie on two cores,
which costs several times as much; members follow the loop to its core.
"""

from __future__ import annotations

import os
import statistics
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from benchmarks import ring
from benchmarks.parts import Relay
from twin.coupling import Connection, CoSimulation, CoupledSystem, IsolatedMember
from twin.fmi import FMUMember
from twin.fmi.exporting import exporter

REPEATS = 60
STEPS = 1000
STEP = 1_000_000  # [ns]


class Pipes:
    """Another process that sends back every byte it gets."""

    def __init__(self) -> None:
        (there, self.out), (self.back, answer) = os.pipe(), os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            os.close(self.out)
            while byte := os.read(there, 1):
                os.write(answer, byte)
            os._exit(0)
        os.close(there)
        os.close(answer)

    def time(self, count: int) -> float:
        """Us per exchange."""
        begin = time.perf_counter()
        for _ in range(count):
            os.write(self.out, b"x")
            os.read(self.back, 1)
        return 1e6 * (time.perf_counter() - begin) / count

    def close(self) -> None:
        os.close(self.out)
        os.close(self.back)
        os.waitpid(self.pid, 0)


class Ring:
    """A ring of isolated FMUs that is advanced again and again."""

    def __init__(self, path: Path, count: int) -> None:
        members = {f"m{i}": IsolatedMember(FMUMember(f"m{i}", path), ring.BUILD) for i in range(count)}
        wires = [Connection(f"m{i - 1 if i else count - 1}.y", f"m{i}.u") for i in range(count)]
        system = CoupledSystem({name: member.variables for name, member in members.items()}, wires)
        self.simulation = CoSimulation(members, system.links(), STEP, build=ring.BUILD)
        self.simulation.initialize(0)
        self.simulation.advance(100 * STEP)

    def time(self, count: int) -> float:
        """Us per member and step."""
        begin = time.perf_counter()
        self.simulation.advance(self.simulation.time + count * STEP)
        return 1e6 * (time.perf_counter() - begin) / count / len(self.simulation.members)


def main(repeats: int = REPEATS, steps: int = STEPS) -> None:
    """Print the figures."""
    path = exporter.build(Relay, "3.0", ring.BUILD)
    pipes = Pipes()
    rings = {count: Ring(path, count) for count in (1, 2, 4)}
    taken = [(pipes.time(steps), [one.time(steps) for one in rings.values()]) for _ in range(repeats)]
    bare = [pair[0] for pair in taken]
    print(f"isolate_pipe_us: {statistics.median(bare):.2f}")
    print(f"isolate_pipe_best_us: {min(bare):.2f}")
    for place, (count, one) in enumerate(rings.items()):
        ours = [pair[1][place] for pair in taken]
        print(f"isolate_{count}_us: {statistics.median(ours):.2f}")
        print(f"isolate_{count}_best_us: {min(ours):.2f}")
        print(
            f"isolate_{count}_ratio: {statistics.median(a / b for a, b in zip(ours, bare, strict=True)):.3f}",
            flush=True,
        )
        one.simulation.terminate()
    pipes.close()


if __name__ == "__main__":
    main()
