"""Systems of this project as SSPs in the tools that read SSP and that PyPI has as wheels, beside our own run of them.

    pip install -e '.[bench]' && python -m benchmarks.ssp      prints `name: value` lines

A scenario is written with `twin export --ssp`, read back and run here, and run by ecos and libcosim, each in a process
of its own. What is told is the largest difference of any output at any step, as a part of that output's largest value;
`yaml` is our run of the scenario itself. OMSimulator has no wheel: its package fetches a binary when it is installed.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from benchmarks import peers, ring

Signals = dict[str, np.ndarray]

RING = """\
stop_time: 2 s
step: 1 ms
members:
{members}
connections:
{wires}
"""
MEMBERS = 8  # of the ring
CHANGE = "factor: 1.5, offset: 0.25"  # of every wire of it


OUTPUTS = (
    "heart.position",
    "wall.force",
    "sensor.measured_force",
    "controller.target_velocity",
    "servomotor.position",
    "sheath.tip_position",
    "sheath.reaction_force",
)


def force() -> str:
    """The force experiment with its first controller, 22 s, at every step."""
    file = Path("scenarios/heart_wall_force.yaml").absolute()
    return f"extends: {file}\nseeds: [1]\nrecord: {{every: 1 ms, variables: [{', '.join(OUTPUTS)}]}}\n"


def relays() -> str:
    """Eight members in a ring, with a transformation on every wire."""
    members = "\n".join(
        f"  m{i}: {{component: 'benchmarks.parts:Relay', parameters: {{gain: 0.3}}}}" for i in range(MEMBERS)
    )
    wires = "\n".join(f"  - {{from: m{(i or MEMBERS) - 1}.y, to: m{i}.u, {CHANGE}}}" for i in range(MEMBERS))
    return RING.format(members=members, wires=wires)


def ours(path: Path) -> tuple[Signals, int, int]:
    """(every signal, its step [ns], number of steps) of a scenario or an SSP."""
    from twin.run import build_simulation, noop, resolve_catalogs, run_case
    from twin.scenario import Backend, load_scenario

    scenario = load_scenario(path)
    case = scenario.cases()[0]
    simulated = build_simulation(case, resolve_catalogs(scenario)[case.variant], Backend.fmu, ring.BUILD)
    run_case(case, simulated, noop)
    signals = simulated.recording().signals
    simulated.terminate()
    return dict(signals), int(case.step_ns), int((case.stop_ns - case.start_ns) // case.step_ns)


def ecos(path: str, names: Sequence[str], step: int, steps: int) -> list[list[float]]:
    """ecos: the values after every step."""
    peers.load_tbb()
    from ecospy import EcosSimulation

    simulation = EcosSimulation(step * 1e-9, ssp_path=path)
    simulation.init(parameter_set="initialValues")
    rows = []
    for _ in range(steps):
        simulation.step(1)
        rows.append([simulation.get_real(name.replace(".", "::", 1)) for name in names])
    simulation.terminate()
    simulation.free()
    return rows


def libcosim(path: str, names: Sequence[str], step: int, steps: int) -> list[list[float]]:
    """The fixed-step algorithm of libcosim: the values after every step."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_ssp_file(path, step)
    slaves = {one.name.decode(): one.index for one in execution.slave_infos()}
    places = []
    for name in names:
        member, _, variable = name.partition(".")
        number = slaves[member]
        references = {one.name.decode(): one.reference for one in execution.slave_variables(number)}
        places.append((number, references[variable]))
    last = CosimObserver.create_last_value()
    execution.add_observer(last)
    rows = []
    for _ in range(steps):
        execution.step(1)
        rows.append([last.last_real_values(number, [reference])[0] for number, reference in places])
    return rows


PEERS: dict[str, Callable[[str, Sequence[str], int, int], list[list[float]]]] = {"ecos": ecos, "libcosim": libcosim}
SYSTEMS: dict[str, tuple[Callable[[], str], Sequence[str]]] = {  # a scenario, and its outputs that are compared
    "ring": (relays, [f"m{i}.y" for i in range(MEMBERS)]),
    "force": (force, OUTPUTS),
}


def theirs(name: str, path: Path, names: Sequence[str], step: int, steps: int, folder: Path) -> np.ndarray:
    """A peer's values, from a process of its own; RuntimeError with one line if it cannot."""
    order, result = folder / "order.json", folder / f"{name}.json"
    order.write_text(json.dumps([str(path), list(names), step, steps]))
    command = [sys.executable, "-m", "benchmarks.ssp", "--one", name, str(order), str(result)]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=600)
    if done.returncode:
        lines = [one for one in done.stderr.splitlines() if one.strip()] or [
            f"its process ended with {done.returncode}"
        ]
        raise RuntimeError(lines[-1])
    return np.array(json.loads(result.read_text()))


def part(one: np.ndarray, other: np.ndarray) -> float:
    """The largest difference as a part of the largest value."""
    return float(np.abs(one - other).max() / (np.abs(one).max() or 1.0))


def compare(name: str, folder: Path) -> None:
    """Print how far everybody is from our run of the SSP."""
    from twin.scenario import load_scenario, pack

    scenario, path = folder / f"{name}.yaml", folder / f"{name}.ssp"
    text, names = SYSTEMS[name]
    scenario.write_text(text())
    pack(load_scenario(scenario), path, ring.BUILD)
    yaml, _, _ = ours(scenario)
    signals, step, steps = ours(path)
    print(f"ssp.{name}.outputs: {len(names)}")
    print(f"ssp.{name}.steps: {steps}")
    print(f"ssp.{name}.yaml: {max(part(signals[key], yaml[key]) for key in names):.1e}")
    for peer in PEERS:
        try:
            rows = theirs(peer, path, names, step, steps, folder)
        except RuntimeError as error:
            print(f"ssp.{name}.{peer}: failed ({error})")
            continue
        found = {key: part(signals[key][1:], rows[:, i]) for i, key in enumerate(names)}
        worst = max(found, key=found.__getitem__)
        print(f"ssp.{name}.{peer}: {found[worst]:.1e}")
        print(f"ssp.{name}.{peer}.worst: {worst}")


def main() -> None:
    """Compare, or run one peer."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--one", nargs=3, metavar=("PEER", "ORDER", "RESULT"))
    one = parser.parse_args().one
    if one:
        rows = PEERS[one[0]](*json.loads(Path(one[1]).read_text()))
        Path(one[2]).write_text(json.dumps(rows))
        return
    for name in SYSTEMS:
        with tempfile.TemporaryDirectory() as folder:
            compare(name, Path(folder))


if __name__ == "__main__":
    main()
