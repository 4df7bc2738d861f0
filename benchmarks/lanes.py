"""Three members of the force scenario with a patient in each lane of vectors, beside the translator's C for one patient.

    python -m benchmarks.lanes            prints `name: value` lines; times are ns per patient and step of 1 ms

lanes.c is written by hand: branches become selections, so that the bits stay the same, which is checked. Sixteen patients
who differ, two seconds. Linux on x86-64 alone; what the processor does not have is left out. What a study would gain of it
follows from the share that the members have of a case: `twin profile scenarios/heart_wall_force.yaml`.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from twin.compiler import sources
from twin.component import catalog

BUILD = Path("build")
MEMBERS = ("sheath", "wall", "guided_tip")
OPTIONS = (  # as the components', and CLOCK_PROCESS_CPUTIME_ID
    "-std=gnu11",
    "-O3",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fwrapv",
    "-fno-strict-aliasing",
    "-fno-slp-vectorize",
    "-w",
    "-target",
    "x86_64-linux-gnu",
)
# name, processor, what it needs of /proc/cpuinfo, lanes; 0: the translator's C
WAYS = (
    ("written", "x86_64", "sse2", 0),
    ("sse2", "x86_64", "sse2", 2),
    ("avx2", "x86_64_v3", "avx2", 4),
    ("avx512", "x86_64_v4", "avx512f", 8),
)


def measured(folder: Path, name: str, processor: str, lanes: int) -> dict[str, tuple[float, str]]:
    """Member -> time [ns], and the sum of what came out, by all of its digits."""
    program, own = folder / name, Path(__file__).parent / "lanes.c"
    text = [str(folder / f"{one}.c") for one in MEMBERS] if not lanes else []
    kind = [f"-DLANES={lanes or 1}", *(["-DWRITTEN", f"-I{folder}"] if not lanes else [])]
    command = [sys.executable, "-m", "ziglang", "cc", *OPTIONS, f"-mcpu={processor}", *kind, str(own), *text]
    subprocess.run([*command, "-o", str(program), "-lm"], check=True)
    told = subprocess.run([str(program)], check=True, capture_output=True, text=True).stdout
    return {one: (float(time), total) for one, time, total in map(str.split, told.splitlines())}


def main() -> None:
    """Print the figures."""
    folder = BUILD / "benchmarks" / "lanes"
    folder.mkdir(parents=True, exist_ok=True)
    for name in MEMBERS:
        made = sources(catalog.component(name), name, BUILD)
        (folder / f"{name}.c").write_text(made.source)
        (folder / f"{name}.h").write_text(made.header)
    flags = Path("/proc/cpuinfo").read_text().split()
    known = [(name, lanes, measured(folder, name, cpu, lanes)) for name, cpu, need, lanes in WAYS if need in flags]
    first = known[0][2]
    for name, lanes, found in known:
        for member, (time, total) in found.items():
            if total != first[member][1]:
                raise SystemExit(f"{member}: {name} gives other bits")
            print(f"lanes_{name}_{member}_ns: {time:.0f}")
            if lanes:
                print(f"lanes_{name}_{member}_gain: {first[member][0] / time:.2f}")


if __name__ == "__main__":
    main()
