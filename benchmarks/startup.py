"""Start-up of `twin run` with everything built: from the start of the process until the simulation's first step.

    python -m benchmarks.startup             prints `name: value` lines; times in s, of variant PI with seed 1
    python -m benchmarks.startup compare     the lines of `chain` and `container` alone
    python -m benchmarks.startup commands    wall and processor times of commands alone, beside the import of FMPy

A process runs the command line as it is, notes the time on the way and ends at the first step:

interpreter   until Python has started
imports       reading the command line, the process that works, of all that it imports before it reads the scenario
scenario      finding that nothing has changed, or reading, merging and checking the file and looking up the components
members       opening the FMUs, coupling, InitializationMode, the compiled loop

`whole_run` is the whole command with the 22 s of the scenario, results and metrics and no report; `outside` is that
less the wall time it reports for the simulation. The packages' figures are their modules' own times by -X importtime,
which makes importing slower.

`chain` is a command that has nearly nothing to simulate: eight FMUs 2.0 that hand on what they get, 10 s at 1 ms, every
output recorded at every step; `container` has the same FMUs in a container of fmu-manipulation-toolbox, which FMPy
simulates in a process of its own and then drops what it recorded, where `twin run` writes its folder. They take turns;
`cpu` is the processor time of a command with its processes, which a busy machine changes less. The ratio is that of wall
times, the median over the turns.
"""

from __future__ import annotations

import itertools
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

# bytecode is written in the first turn, as in any installation
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
SCENARIO = "scenarios/heart_wall_force.yaml"
ARGUMENTS = ("run", SCENARIO, "--variant", "PI", "--seed", "1", "--no-report", "--runs")
PHASES = ("interpreter", "imports", "scenario", "members")
REPEATS = 7
PACKAGES = 5


def run_until_first_step(begin: float, arguments: list[str]) -> None:
    """The command line with the times of its phases printed at the first step, where the process ends."""
    marks = [begin, time.monotonic()]
    import twin.cli
    import twin.cli.run

    read = twin.cli.run.read

    def mark() -> None:
        marks.append(time.monotonic())

    def first_step(*_given, **_named):
        mark()
        print(json.dumps([after - before for before, after in itertools.pairwise(marks)]), flush=True)
        sys.exit(0)

    def noted_read(*given):
        mark()
        import twin.run.executor
        from twin.coupling import CoSimulation

        simulation = twin.run.executor.build_simulation

        def noted(*given, **named):
            mark()
            return simulation(*given, **named)

        twin.run.executor.build_simulation = noted
        CoSimulation.advance = first_step  # type: ignore[method-assign]
        return read(*given)

    twin.cli.run.read = noted_read
    sys.argv = ["twin", *arguments]
    twin.cli.main()


def phases(folder: str) -> list[float]:
    """Times of the phases of one process [s]."""
    with tempfile.TemporaryDirectory(dir=folder) as runs:  # the next process would finish what this one leaves
        command = [sys.executable, "-m", "benchmarks.startup", str(time.monotonic()), *ARGUMENTS, runs]
        done = subprocess.run(command, check=True, capture_output=True, text=True, env=ENVIRONMENT)
    return list(json.loads(done.stdout.splitlines()[-1]))


def whole(folder: str) -> tuple[float, float]:
    """Wall time of the whole command, and of its simulation as it reports it [s]."""
    command = [sys.executable, "-c", "from twin.cli import main; main()", *ARGUMENTS, folder, "--json"]
    begin = time.monotonic()
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=ENVIRONMENT)
    return time.monotonic() - begin, float(json.loads(done.stdout)["wall_time"])


def packages(folder: str) -> Counter[str]:
    """Time by top-level package until the first step [us]."""
    command = [sys.executable, "-X", "importtime", "-m", "benchmarks.startup", str(time.monotonic())]
    with tempfile.TemporaryDirectory(dir=folder) as runs:
        words = [*command, *ARGUMENTS, runs]
        done = subprocess.run(words, check=True, capture_output=True, text=True, env=ENVIRONMENT)
    result: Counter[str] = Counter()
    for line in done.stderr.splitlines():
        fields = line.removeprefix("import time:").split("|")
        if len(fields) == 3 and fields[0].strip().isdigit():
            name = fields[2].strip().partition(".")[0]
            result["standard library" if name.lstrip("_") in STANDARD or name in STANDARD else name] += int(fields[0])
    return result


CHAIN = 8
FMPY = """
import sys
from fmpy import simulate_fmu
found = simulate_fmu(sys.argv[1], stop_time=10.0, step_size=1e-3, output_interval=1e-3)
print(float(found["y7"][-1]))
"""


def chain(folder: Path, fmu: Path) -> list[str]:
    """A command of ours that runs the chain and prints its summary."""
    lines = ["stop_time: 10 s", "step: 1 ms", "members:"]
    lines += [f"  m{i}: {{component: {fmu}}}" for i in range(CHAIN)]
    lines += ["connections:", *(f"  - m{i}.y -> m{i + 1}.u" for i in range(CHAIN - 1))]
    lines += ["metrics: {last: {signal: m7.y, reduce: final}}", ""]
    (folder / "chain.yaml").write_text("\n".join(lines))
    words = ["run", str(folder / "chain.yaml"), "--no-report", "--json", "--runs", str(folder / "runs")]
    return [sys.executable, "-c", "from twin.cli import main; main()", *words]


def container(folder: Path, fmu: Path) -> list[str]:
    """A command that runs it as a container in FMPy and prints the last output."""
    from fmu_manipulation_toolbox.assembly import AssemblyNode

    path = folder / "chain.fmu"
    node = AssemblyNode(str(path), step_size=1e-3, auto_link=False, auto_input=False, auto_output=False)
    for i in range(CHAIN):
        node.add_fmu(f"m{i}.fmu", str(fmu))
        node.add_output(f"m{i}.fmu", "y", f"y{i}")
    for i in range(CHAIN - 1):
        node.add_link(f"m{i}.fmu", "y", f"m{i + 1}.fmu", "u")
    node.make_fmu(folder)
    return [sys.executable, "-c", FMPY, str(path)]


def timed(command: list[str]) -> tuple[float, float, str]:
    """Wall time of a process, processor time of it and of those that it started [s], and what it printed."""
    spent, begin = os.times(), time.monotonic()
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=ENVIRONMENT)
    took, now = time.monotonic() - begin, os.times()
    cpu = now.children_user + now.children_system - spent.children_user - spent.children_system
    return took, cpu, done.stdout


def compare(repeats: int) -> None:
    """Print the chain's figures."""
    from benchmarks import ring
    from benchmarks.parts import Relay
    from twin.fmi.exporting import exporter

    with tempfile.TemporaryDirectory() as name:
        folder, fmu = Path(name), exporter.build(Relay, "2.0", ring.BUILD).absolute()
        ours = chain(folder, fmu)
        own = json.loads(timed(ours)[-1])["metrics"]["last"]["variants"]["base"]["worst"]
        commands = {"": ours}
        try:
            theirs = container(folder, fmu)
        except ImportError as error:
            print(f"startup_chain_container: not available ({error})")
        else:
            if float(timed(theirs)[-1].split()[-1]) != own:
                raise RuntimeError("the container's last output is another one")
            commands["_container"] = theirs
        turns = [{name: timed(command)[:2] for name, command in commands.items()} for _ in range(repeats)]
    for name in commands:
        for i, what in enumerate(("s", "cpu_s")):
            times = [turn[name][i] for turn in turns]
            print(f"startup_chain{name}_{what}: {statistics.median(times):.3f}")
            print(f"startup_chain{name}_least_{what}: {min(times):.3f}")
    if len(commands) > 1:
        print(f"startup_chain_ratio: {statistics.median(turn[''][0] / turn['_container'][0] for turn in turns):.2f}")


MAIN = "from twin.cli import main; main()"


def commands(repeats: int) -> None:
    """Print wall and processor times of commands that take turns, with everything built."""
    with tempfile.TemporaryDirectory() as folder:
        words = {
            "python": ("-c", "pass"),
            "import_fmpy": ("-c", "import fmpy"),
            "import_twin": ("-c", "import twin"),
            "help": ("-c", MAIN, "--help"),
            "run": ("-c", MAIN, *ARGUMENTS, folder),
        }
        turns = [{name: timed([sys.executable, *each])[:2] for name, each in words.items()} for _ in range(repeats + 1)]
    for name in words:
        for i, what in enumerate(("s", "cpu_s")):
            times = [turn[name][i] for turn in turns[1:]]  # the first turn builds what is missing
            print(f"startup_{name}_{what}: {statistics.median(times):.3f}")
            print(f"startup_{name}_least_{what}: {min(times):.3f}", flush=True)


STANDARD = sys.stdlib_module_names


def measure(repeats: int = REPEATS) -> None:
    """Print the figures."""
    with tempfile.TemporaryDirectory() as folder:
        whole(folder)  # builds what is missing
        split = [phases(folder) for _ in range(repeats)]
        runs = [whole(folder) for _ in range(repeats)]
        imported = [packages(folder) for _ in range(repeats)]
    print(f"startup_to_first_step_s: {statistics.median(sum(one) for one in split):.3f}")
    for i, name in enumerate(PHASES):
        print(f"startup_{name}_s: {statistics.median(one[i] for one in split):.3f}")
    print(f"startup_whole_run_s: {statistics.median(took for took, _ in runs):.3f}")
    print(f"startup_outside_s: {statistics.median(took - stepping for took, stepping in runs):.3f}")
    medians = Counter({name: int(statistics.median(one[name] for one in imported)) for name in imported[0]})
    for name, microseconds in medians.most_common(PACKAGES):
        print(f"startup_import_{name.replace(' ', '_')}_s: {1e-6 * microseconds:.3f}", flush=True)
    commands(repeats)
    compare(repeats)


def main() -> None:
    """Print the figures; with other arguments than `compare` and `commands`, be the process that is measured."""
    if sys.argv[1:] == ["compare"]:
        compare(REPEATS)
    elif sys.argv[1:] == ["commands"]:
        commands(REPEATS)
    elif len(sys.argv) > 1:
        run_until_first_step(float(sys.argv[1]), sys.argv[2:])
    else:
        measure()


if __name__ == "__main__":
    main()
