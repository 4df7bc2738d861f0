"""Rings of cheap FMUs: our loop beside a hand-written C loop over the same FMUs, every step recorded, in one run.

    python benchmarks/ring.py            prints `name: value` lines; times are ns per member and step

The C loop (ring.c) is compiled by zig here; it and our loop take turns, and the median of the paired ratios counts.
`best_ratio` is that of both at their fastest: where the two differ much, something else kept the machine busy.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from benchmarks.parts import Relay
from twin.coupling import Connection, CoSimulation, CoupledSystem
from twin.fmi import FMUMember, unpack
from twin.fmi.exporting import exporter

BUILD = Path("build")
REPEATS = 15
CALLS = 4_000_000  # members times steps of one measurement


def c_loop() -> Path:
    """The hand-written loop, compiled."""
    program = BUILD / "benchmarks" / "ring"
    program.parent.mkdir(parents=True, exist_ok=True)
    source = Path(__file__).parent / "ring.c"
    command = [sys.executable, "-m", "ziglang", "cc", "-O3", str(source), "-o", str(program), "-ldl"]
    subprocess.run(command, check=True)
    return program


def time_c(program: Path, version: str, path: Path, members: int, steps: int) -> tuple[float, float]:
    """Ns per member and step, and the last output."""
    unpacked = unpack(path)
    library = next((unpacked.folder / "binaries").rglob("*.so"))
    variables = {variable.name: str(variable.reference) for variable in unpacked.description.variables}
    command = [str(program), version[0], str(library), unpacked.description.token, str(members), str(steps)]
    output = subprocess.run([*command, variables["u"], variables["y"]], check=True, capture_output=True, text=True)
    unpacked.close()
    result = output.stdout.split()
    return float(result[0]), float(result[1])


def time_ours(path: Path, members: int, steps: int) -> tuple[float, float]:
    """The same for our loop."""
    ring = {f"m{i}": FMUMember(f"m{i}", path) for i in range(members)}
    wires = [Connection(f"m{i - 1 if i else members - 1}.y", f"m{i}.u") for i in range(members)]
    system = CoupledSystem({name: member.variables for name, member in ring.items()}, wires)
    simulation = CoSimulation(ring, system.links(), 1_000_000, build=BUILD)
    stop = steps * 1_000_000
    simulation.initialize(0, stop)
    begin = time.perf_counter()
    simulation.advance(stop)
    took = time.perf_counter() - begin
    last = float(simulation.recording().signals[f"m{members - 1}.y"][-1])
    simulation.terminate()
    return 1e9 * took / (steps * members), last


def main() -> None:
    """Print the figures."""
    program = c_loop()
    for version in ("2.0", "3.0"):
        path = exporter.build(Relay, version, BUILD)
        for members in (2, 8, 32, 128):
            steps = CALLS // members
            pairs = []
            for _ in range(REPEATS):
                ours, last = time_ours(path, members, steps)
                theirs, c_last = time_c(program, version, path, members, steps)
                if last != c_last:
                    raise SystemExit(f"results differ: {last} and {c_last}")
                pairs.append((ours, theirs))
            name = f"ring_fmi{version[0]}_{members}"
            print(f"{name}_ours_ns: {statistics.median(p[0] for p in pairs):.2f}")
            print(f"{name}_c_ns: {statistics.median(p[1] for p in pairs):.2f}")
            print(f"{name}_ratio: {statistics.median(p[0] / p[1] for p in pairs):.3f}")
            best = min(p[0] for p in pairs) / min(p[1] for p in pairs)
            print(f"{name}_best_ratio: {best:.3f}", flush=True)


if __name__ == "__main__":
    main()
