"""Members stepped at the same time: rings of FMUs that compute or sleep for a while, with one thread and with more.

    pip install -e '.[bench]' && python -m benchmarks.parallel [--peers]       prints `name: value` lines

The ring is that of peers.py, its FMU is work.c. Variants take turns in one process each; times are medians [s], speedups
medians of the turns, with their range. Results must be equal to the bit.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Mapping
from pathlib import Path

from benchmarks import peers, ring
from benchmarks.parts import Relay
from twin.fmi.exporting import exporter

SOURCE = Path(__file__).with_name("work.c")
PARAMETERS = ("offset", "count", "pause", "crash", "what")
MEMBERS, STEPS, CHEAP_STEPS = 4, 1000, 200_000
MILLISECOND = 1e-3  # time of an expensive step [s]
OURS = {"serial": 1, "threads": None}  # threads by variant
VARIABLE = '<ScalarVariable name="{0}" valueReference="{1}" causality="{2}" variability="{3}">{4}</ScalarVariable>'


def description(values: Mapping[str, float]) -> str:
    """Model description with the start values of parameters."""
    lines = [VARIABLE.format("u", 0, "input", "continuous", '<Real start="0"/>')]
    lines.append(VARIABLE.format("y", 1, "output", "continuous", "<Real/>"))
    for i, name in enumerate(PARAMETERS):
        lines.append(VARIABLE.format(name, 2 + i, "parameter", "fixed", f'<Real start="{values[name]!r}"/>'))
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Work" guid="work">
<CoSimulation modelIdentifier="Work" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"/>
<ModelVariables>{"".join(lines)}</ModelVariables>
<ModelStructure><Outputs><Unknown index="2" dependencies=""/></Outputs></ModelStructure>
</fmiModelDescription>"""


def work_fmu(path: Path, **values: float) -> Path:
    """An FMU of work.c with these start values."""
    library = path.with_suffix(".so")
    start = dict.fromkeys(PARAMETERS, 0.0) | {"offset": 1.0} | values
    options = ["-O1", "-fno-sanitize=all", "-w", "-shared", "-fPIC", f"-DSTART={','.join(map(repr, start.values()))}"]
    command = [sys.executable, "-m", "ziglang", "cc", *options, str(SOURCE), "-o", str(library)]
    subprocess.run(command, check=True, capture_output=True)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description(start))
        archive.write(library, "binaries/linux64/Work.so")
    return path


def simulate(fmu: Path, members: int, steps: int, threads: int | None, isolated: bool) -> peers.Result:
    """The ring by our loop: time of its steps [s] and the last outputs."""
    from twin.coupling import Connection, CoSimulation, CoupledSystem, IsolatedMember
    from twin.fmi import FMUMember

    parts = {f"m{i}": FMUMember(f"m{i}", fmu, {} if i else {"offset": peers.OFFSET}) for i in range(members)}
    if isolated:
        parts = {name: IsolatedMember(part, ring.BUILD) for name, part in parts.items()}
    wires = [Connection(f"m{peers.source(i, members)}.y", f"m{i}.u") for i in range(members)]
    links = CoupledSystem({name: part.variables for name, part in parts.items()}, wires).links()
    simulation = CoSimulation(parts, links, peers.H, build=ring.BUILD, threads=threads)
    simulation.initialize(0, steps * peers.H)
    begin = time.perf_counter()
    simulation.advance(steps * peers.H)
    took = time.perf_counter() - begin
    signals = simulation.recording().signals
    simulation.terminate()
    return took, [float(signals[f"m{i}.y"][-1]) for i in range(members)]


def measure(variant: str, fmu: Path, steps: int, isolated: bool) -> peers.Result:
    """One measurement in this process."""
    if variant in OURS:
        return simulate(fmu, MEMBERS, steps, OURS[variant], isolated)
    return {"ecos": peers.ecos, "libcosim": peers.libcosim}[variant](fmu, MEMBERS, steps)


def take_turns(name: str, variants: list[str], fmu: Path, steps: int, repeats: int, isolated: bool = False) -> None:
    """Measure variants in turn, each in its own process; print medians and ratios to the first."""
    times: dict[str, list[float]] = {variant: [] for variant in variants}
    values = {}
    for _ in range(repeats):
        for variant in variants:
            arguments = ["--one", variant, str(fmu), str(steps), str(int(isolated))]
            command = [sys.executable, "-m", "benchmarks.parallel", *arguments]
            output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
            took, values[variant] = json.loads(output.splitlines()[-1])
            times[variant].append(took)
    if any(last != values[variants[0]] for last in values.values()):
        raise SystemExit(f"{name}: results differ: {values}")
    for variant in variants:
        ratios = [first / other for first, other in zip(times[variants[0]], times[variant], strict=True)]
        print(f"{name}_{variant}: {statistics.median(times[variant]):.4f}")
        print(f"{name}_{variant}_speedup: {statistics.median(ratios):.3f}")
        print(f"{name}_{variant}_speedup_range: {min(ratios):.3f} to {max(ratios):.3f}", flush=True)


def passes_of(folder: Path) -> int:
    """Passes of the arithmetic that take a millisecond on this machine."""
    fmu = work_fmu(folder / "calibration.fmu", count=100_000)
    times = [simulate(fmu, 1, 50, 1, isolated=False)[0] / 50 for _ in range(3)]
    return round(100_000 * MILLISECOND / min(times))


def main() -> None:
    """Print all measurements."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peers", action="store_true", help="Also measure ecos and libcosim.")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--one", nargs=4, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        variant, fmu, steps, isolated = arguments.one
        print(json.dumps(measure(variant, Path(fmu), int(steps), isolated == "1")))
        return
    with tempfile.TemporaryDirectory() as name:
        folder, ours = Path(name), list(OURS)
        others = ["ecos", "libcosim"] if arguments.peers else []
        computing = work_fmu(folder / "computing.fmu", count=passes_of(folder))
        sleeping = work_fmu(folder / "sleeping.fmu", pause=MILLISECOND)
        cheap = exporter.export(Relay, "2.0", folder / "ring.fmu", ring.BUILD)
        take_turns("computing", [*ours, *others], computing, STEPS, arguments.repeats)
        take_turns("isolated_sleeping", ours, sleeping, STEPS, arguments.repeats, isolated=True)
        take_turns("cheap", ours, cheap, CHEAP_STEPS, 3 * arguments.repeats)


if __name__ == "__main__":
    main()
