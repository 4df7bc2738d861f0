"""Rings of cheap FMI 2.0 FMUs by the co-simulation masters that PyPI has as wheels, beside our loop and the C loop.

    pip install -e '.[bench]' && python -m benchmarks.peers      prints `name: value` lines

The ring and the C loop are those of ring.py: every member takes its neighbor's output of the step before (Jacobi), with
a step of 1 ms. Each measurement has a process of its own, and only its stepping is timed. The C loop runs right before
and right after each, and what counts is the median of the ratios to the mean of the two; where `c_best`, its fastest,
is much less than `c`, something else kept the machine busy. All must give the same values, to the bit: after 20 steps,
which shows order and delay of the connections since member 0 has another offset than the rest, and after the steps that
are timed.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import io
import json
import math
import statistics
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path

from benchmarks import ring
from benchmarks.parts import Relay
from twin.fmi.exporting import exporter

REPEATS = 7
CHECK = 20  # steps after which the values are compared
OFFSET = 3.0  # of member 0, elsewhere 1
H = 1_000_000  # step [ns]
C_CALLS = 2_000_000  # members times steps of one measurement with the C loop

Result = tuple[float, list[float]]  # time [s], and the last outputs of all members


def source(index: int, members: int) -> int:
    """The member whose output a member takes."""
    return (index or members) - 1


def reference(members: int, steps: int) -> list[float]:
    """The outputs after so many steps, in plain Python; the ring is at rest long before 2000."""
    offsets = [OFFSET] + [1.0] * (members - 1)
    outputs = offsets
    for _ in range(min(steps, 2000)):
        outputs = [0.5 * outputs[source(i, members)] + offsets[i] for i in range(members)]
    return outputs


def references(fmu: Path) -> dict[str, int]:
    """Value references of the ring's FMU."""
    from fmpy import read_model_description

    return {one.name: one.valueReference for one in read_model_description(str(fmu)).modelVariables}


def ours(fmu: Path, members: int, steps: int) -> Result:
    """Our loop; records every output at every step, in memory."""
    from twin.coupling import Connection, CoSimulation, CoupledSystem
    from twin.fmi import FMUMember

    parts = {f"m{i}": FMUMember(f"m{i}", fmu, {} if i else {"offset": OFFSET}) for i in range(members)}
    wires = [Connection(f"m{source(i, members)}.y", f"m{i}.u") for i in range(members)]
    system = CoupledSystem({name: part.variables for name, part in parts.items()}, wires)
    simulation = CoSimulation(parts, system.links(), H, build=ring.BUILD)
    simulation.initialize(0, steps * H)
    begin = time.perf_counter()
    simulation.advance(steps * H)
    took = time.perf_counter() - begin
    signals = simulation.recording().signals
    simulation.terminate()
    return took, [float(signals[f"m{i}.y"][-1]) for i in range(members)]


def container(fmu: Path, members: int, steps: int, *, recording: bool = False) -> Result:
    """fmu-manipulation-toolbox: the ring as one container FMU, stepped by our loop as its only member.

    Without recording it is called once for up to 1000 of its own steps, so that only the container's cost counts; with
    recording once for each, and our loop gets and records every member's output at every step.
    """
    from fmu_manipulation_toolbox.assembly import AssemblyNode

    outputs = [f"y{i}" for i in range(members)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ring.fmu"
        node = AssemblyNode(str(path), step_size=1e-3, auto_link=False, auto_input=False, auto_output=False)
        for i, output in enumerate(outputs):
            node.add_fmu(f"m{i}.fmu", str(fmu))
            node.add_output(f"m{i}.fmu", "y", output)
        for i in range(members):
            node.add_link(f"m{source(i, members)}.fmu", "y", f"m{i}.fmu", "u")
        node.add_start_value("m0.fmu", "offset", str(OFFSET))
        node.make_fmu(Path(folder))
        return whole(path, outputs, steps, recording)


def whole(path: Path, outputs: list[str], steps: int, recording: bool) -> Result:
    """The ring as one FMU, by our loop."""
    from twin.coupling import CoSimulation
    from twin.fmi import FMUMember

    inner = 1 if recording else math.gcd(1000, steps)
    record = [("ring", name) for name in outputs] if recording else []
    simulation = CoSimulation({"ring": FMUMember("ring", path)}, [], inner * H, record=record, build=ring.BUILD)
    simulation.initialize(0, steps * H)
    begin = time.perf_counter()
    simulation.advance(steps * H)
    took = time.perf_counter() - begin
    last = [float(simulation.members["ring"].get(name)) for name in outputs]
    simulation.terminate()
    return took, last


def group(_: Path, members: int, steps: int, *, recording: bool = False) -> Result:
    """Our compiled group: the ring's members made into one FMU, called as the container is."""
    from twin.run import resolve_catalogs
    from twin.scenario import group as grouped
    from twin.scenario import parse_scenario

    lines = ["stop_time: 1 s", "step: 1 ms", "members:"]
    lines += [f"  m{i}: {{component: 'benchmarks.parts:Relay'}}" for i in range(members)]
    lines[3] = f"  m0: {{component: 'benchmarks.parts:Relay', parameters: {{offset: {OFFSET}}}}}"
    lines += ["connections:", *(f"  - m{source(i, members)}.y -> m{i}.u" for i in range(members))]
    scenario = parse_scenario("\n".join(lines))
    names = [f"m{i}" for i in range(members)]
    cls = grouped("ring", scenario.cases()[0], resolve_catalogs(scenario)["base"], names)
    with tempfile.TemporaryDirectory() as folder:
        path = exporter.export(cls, "2.0", Path(folder) / "ring.fmu", ring.BUILD)
        return whole(path, [f"{name}.y" for name in names], steps, recording)


def group_recording(fmu: Path, members: int, steps: int) -> Result:
    """The group with its outputs recorded at every step."""
    return group(fmu, members, steps, recording=True)


def container_recording(fmu: Path, members: int, steps: int) -> Result:
    """The container with its outputs recorded at every step."""
    return container(fmu, members, steps, recording=True)


def load_tbb() -> None:
    """The wheel of ecospy needs libtbb.so.12 and does not bring it; the wheel `tbb` has it where nothing finds it."""
    with contextlib.suppress(metadata.PackageNotFoundError):
        for file in metadata.files("tbb") or []:
            if file.name == "libtbb.so.12":
                ctypes.CDLL(str(file.locate()), mode=ctypes.RTLD_GLOBAL)


def ecos(fmu: Path, members: int, steps: int, *, recording: bool = False) -> Result:
    """ecos: its steps in one call; members step in parallel (TBB). Recording writes a CSV file, with six decimals.

    Each member has a copy of the file: members from one file share a single FMI 2.0 instance in ecos 0.7.2.
    """
    load_tbb()
    from ecospy import EcosSimulation, EcosSimulationStructure

    with tempfile.TemporaryDirectory() as folder, EcosSimulationStructure() as structure:
        for i in range(members):
            copy = Path(folder) / f"m{i}.fmu"
            copy.write_bytes(fmu.read_bytes())
            structure.add_model(f"m{i}", copy)
        for i in range(members):
            structure.make_real_connection(f"m{source(i, members)}::y", f"m{i}::u")
        structure.add_parameter_set("start", {"m0::offset": OFFSET})
        simulation = EcosSimulation(1e-3, structure=structure)
        if recording:
            simulation.add_csv_writer(str(Path(folder) / "ring.csv"), identifiers=[f"m{i}::y" for i in range(members)])
        simulation.init(parameter_set="start")
        begin = time.perf_counter()
        simulation.step(steps)
        took = time.perf_counter() - begin
        last = [simulation.get_real(f"m{i}::y") for i in range(members)]
        simulation.terminate()
        simulation.free()
    return took, last


def ecos_recording(fmu: Path, members: int, steps: int) -> Result:
    """Ecos with its CSV writer."""
    return ecos(fmu, members, steps, recording=True)


def libcosim(fmu: Path, members: int, steps: int, *, recording: bool = False) -> Result:
    """The fixed-step algorithm of libcosim: its steps in one call, in one worker thread per core, which the wheel
    cannot change. Recording is its time-series observer, in memory. The first step initializes and is not timed.

    libcosim switches every FMU's debug logging on and then drops what is below its own level. Our FMUs log each call
    when asked to: `libcosim_quiet` runs the same FMU behind quiet.c, which keeps its logging off.
    """
    from libcosimpy.CosimEnums import CosimVariableType
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.ERROR)
    number = references(fmu)
    execution = CosimExecution.from_step_size(H)
    slaves = [CosimLocalSlave(str(fmu), f"m{i}") for i in range(members)]
    index = [execution.add_local_slave(slave) for slave in slaves]
    for i in range(members):
        execution.connect_real_variables(index[source(i, members)], number["y"], index[i], number["u"])
    execution.real_initial_value(index[0], number["offset"], OFFSET)
    series = CosimObserver.create_time_series(steps + 1)
    if recording:
        execution.add_observer(series)
        for i in index:
            series.start_time_series(i, number["y"], CosimVariableType.REAL)
    execution.step(1)
    begin = time.perf_counter()
    execution.step(steps - 2)
    took = time.perf_counter() - begin
    last = CosimObserver.create_last_value()
    execution.add_observer(last)
    execution.step(1)
    return took * steps / (steps - 2), [last.last_real_values(i, [number["y"]])[0] for i in index]


def libcosim_quiet(fmu: Path, members: int, steps: int) -> Result:
    """The same with the FMU's logging kept off."""
    with tempfile.TemporaryDirectory() as folder:
        return libcosim(quiet(fmu, Path(folder)), members, steps)


def libcosim_quiet_recording(fmu: Path, members: int, steps: int) -> Result:
    """The same with the FMU's logging kept off, recording."""
    with tempfile.TemporaryDirectory() as folder:
        return libcosim(quiet(fmu, Path(folder)), members, steps, recording=True)


def quiet(fmu: Path, folder: Path) -> Path:
    """The same FMU with quiet.c in front of its library."""
    code, path = Path(__file__).parent / "quiet.c", folder / fmu.name
    outer = folder / "outer.so"
    command = [sys.executable, "-m", "ziglang", "cc", "-O3", "-shared", "-fPIC", str(code), "-o", str(outer), "-ldl"]
    subprocess.run(command, check=True)
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            library = name.endswith(".so")
            new.writestr(name.replace(Path(name).name, "inner.so") if library else name, old.read(name))
            if library:
                new.writestr(name, outer.read_bytes())
    return path


def fmpy(fmu: Path, members: int, steps: int) -> Result:
    """A loop over FMPy's slaves as one writes it by hand; every step's outputs go to a list."""
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave

    description = read_model_description(str(fmu))
    number = references(fmu)
    u, y = [number["u"]], [number["y"]]
    folder = extract(str(fmu))
    slaves = []
    for i in range(members):
        slave = FMU2Slave(
            guid=description.guid,
            unzipDirectory=folder,
            instanceName=f"m{i}",
            modelIdentifier=description.coSimulation.modelIdentifier,
        )
        slave.instantiate()
        if i == 0:
            slave.setReal([number["offset"]], [OFFSET])
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        slaves.append(slave)
    values = [slave.getReal(y)[0] for slave in slaves]
    rows = [values]
    begin = time.perf_counter()
    for k in range(steps):
        for i, slave in enumerate(slaves):
            slave.setReal(u, [values[source(i, members)]])
        for slave in slaves:
            slave.doStep(currentCommunicationPoint=k * 1e-3, communicationStepSize=1e-3)
        values = [slave.getReal(y)[0] for slave in slaves]
        rows.append(values)
    took = time.perf_counter() - begin
    return took, rows[-1]


# members times steps of one measurement
PEERS: dict[str, tuple[Callable[[Path, int, int], Result], int]] = {
    "ours":                     (ours,                     2_000_000),
    "group":                    (group,                    2_000_000),
    "group_recording":          (group_recording,          1_000_000),
    "fmucontainer":             (container,                2_000_000),
    "fmucontainer_recording":   (container_recording,      1_000_000),
    "ecos":                     (ecos,                       200_000),
    "ecos_recording":           (ecos_recording,              80_000),
    "libcosim":                 (libcosim,                    20_000),
    "libcosim_quiet":           (libcosim_quiet,              40_000),
    "libcosim_quiet_recording": (libcosim_quiet_recording,    40_000),
    "fmpy":                     (fmpy,                        80_000),
}  # fmt: skip


def measure(name: str, fmu: Path, members: int, steps: int) -> Result:
    """Run a peer in a process of its own; RuntimeError with one line if it cannot."""
    command = [sys.executable, "-m", "benchmarks.peers", "--one", name, str(fmu), str(members), str(steps)]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=300)
    try:
        took, last = json.loads(done.stdout.splitlines()[-1])
    except (IndexError, ValueError):
        lines = done.stderr.strip().splitlines() or [f"its process ended with {done.returncode}"]
        raise RuntimeError(lines[-1]) from None
    return took, last


def checked(name: str, fmu: Path, members: int, steps: int) -> float:
    """Ns per member and step; RuntimeError if the peer cannot run or its values are others."""
    took, last = measure(name, fmu, members, steps)
    expected = reference(members, steps)
    if last != expected:
        raise RuntimeError(f"other values after {steps} steps: {last[:3]}, expected {expected[:3]}")
    return 1e9 * took / (members * steps)


def compare(
    names: Sequence[str] = tuple(PEERS), sizes: Sequence[int] = (2, 8, 32), repeats: int = REPEATS, scale: float = 1.0
) -> None:
    """Print the figures; `scale` shortens every measurement."""
    fmu = exporter.build(Relay, "2.0", ring.BUILD).absolute()
    program = ring.c_loop()
    for members in sizes:
        loops: list[float] = []
        pairs: dict[str, list[tuple[float, float]]] = {name: [] for name in names}
        reasons: dict[str, str] = {}

        def c_loop(members: int = members, loops: list[float] = loops) -> float:
            loops.append(ring.time_c(program, "2.0", fmu, members, int(scale * C_CALLS) // members)[0])
            return loops[-1]

        for repeat in range(repeats):
            for name in names:
                if name in reasons:
                    continue
                try:
                    if repeat == 0:
                        checked(name, fmu, members, CHECK)
                    before = c_loop()
                    took = checked(name, fmu, members, max(CHECK, int(scale * PEERS[name][1]) // members))
                    pairs[name].append((took, (before + c_loop()) / 2))
                except (RuntimeError, subprocess.TimeoutExpired) as error:
                    reasons[name] = str(error)
        print(f"peers_{members}_c_ns: {statistics.median(loops):.2f}")
        print(f"peers_{members}_c_best_ns: {min(loops):.2f}")
        for name in names:
            if name in reasons:
                print(f"peers_{members}_{name}: not available ({reasons[name]})")
            else:
                print(f"peers_{members}_{name}_ns: {statistics.median(ns for ns, _ in pairs[name]):.2f}")
                print(
                    f"peers_{members}_{name}_ratio: {statistics.median(a / b for a, b in pairs[name]):.2f}", flush=True
                )


def main() -> None:
    """Print the figures, or run one peer (`--one`) and print its time and values."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--one", nargs=4, metavar=("PEER", "FMU", "MEMBERS", "STEPS"))
    given = parser.parse_args()
    if given.one is None:
        compare()
        return
    name, fmu, members, steps = given.one
    with contextlib.redirect_stdout(io.StringIO()):
        result = PEERS[name][0](Path(fmu), int(members), int(steps))
    print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
