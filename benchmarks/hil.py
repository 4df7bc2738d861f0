"""Hardware in the loop without hardware: scenarios and simulated drives, each a process of its own, in real time.

    python -m benchmarks.hil [SECONDS]     prints `name: value` lines; 60 s for each interface if nothing is said
    python -m benchmarks.hil beside ...    a busy host, beside a bare loop in C: benchmarks/stalls.py
    python -m benchmarks.hil where ...     what a cycle's time goes to: the same file

The force scenario's variant PI+FF+BW with one drive, and the whole rig with three, at a cycle of 5 ms, over udp_multicast
and over slcan on pseudo-terminals with a process between them that carries the lines; the rig on slcan at 10 ms. Jitter:
periods between SYNCs minus the cycle.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import select
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[1]
SCENARIO = ROOT / "scenarios" / "heart_wall_force.yaml"
RIG = ROOT / "scenarios" / "racs.yaml"
RIG_BENCH = ROOT / "hw_bridge" / "benches" / "multicast_racs.yaml"
RIDING = {
    "policy": "hold",
    "at_most": "100 ms",
    "rpdo_timeout": False,
}  # an EPOS4 would end a stall of 15 ms with 8250h
RIG_DRIVES = ("faulhaber_v3", "faulhaber_v3", "epos4")
GROUP = "239.74.163.77"
PORT = (
    40_000 + os.getpid() % 20_000
)  # groups of one port are not kept apart on one machine, nor are two of these programs
FIGURES = ("jitter_std", "jitter_median", "jitter_99", "jitter_999", "jitter_max")

BENCH = """interface: {interface}
channel: {channel}
options: {options}
cycle: 5 ms
nodes:
  servomotor:
    node: 1
    profile: {profile}
    heartbeat: {{every: 20 ms, lost_after: 100 ms}}
    contact: {{signal: sensor.measured_force}}
"""

LONG = """extends: {scenario}
stop_time: {seconds} s
metrics: {{force_error_std: null, force_error_max: null, force_error_mean: null, estimate_error_std: null,
  true_force_mean: null, force_lateness: null, commanded_speed: null, estimated_rate: null}}
expect: [{{name: clinical range, signal: wall.force, within: [0.1 N, 0.4 N]}}]
plots: []
"""

LONG_RIG = """extends: {scenario}
stop_time: {seconds} s
members:
  command: {{parameters: {{distance: {distance} m, speed: 20 mm/s, begin: 0.5 s}}}}
  turning: {{component: rotation_command}}
  sequencer: {{parameters: {{stroke: {stroke} mm, alpha: 3}}}}
  servomotor_1: {{parameters: {{target_position: -24.8 mm}}}}  # an increment behind its home would be a broken rule
  servomotor_2: {{parameters: {{target_position: 24.8 mm}}}}
connections: [turning.target_position -> rotation.target_position]
expect:
  - {{name: no violation of the regripping rules, signal: sequencer.violation, at_most: 0}}
  - {{name: at least one gripper holds, signal: "max(sleeve_1.limit_proximal, sleeve_2.limit_proximal)", at_least: 4.5 N, from: 0.7 s}}
  - {{name: the tip arrives, signal: instrument.tip_position, at_least: -2 mm}}
plots: []
"""


def options(interface: str) -> dict[str, int]:
    """Arguments of an interface."""
    return {"port": PORT} if interface == "udp_multicast" else {}


def bench(folder: Path, profile: str, interface: str, channel: str) -> Path:
    """A hardware file."""
    path = folder / "bench.yaml"
    text = BENCH.format(profile=profile, interface=interface, channel=channel, options=json.dumps(options(interface)))
    units = "    units: {acceleration: 1 mm/s^2}\n"  # of the simulated drive: no object of a V3.0 states it
    path.write_text(text + units * (profile == "faulhaber_v3"))
    return path


def rig_bench(
    folder: Path, interface: str, channel: str, profiles: tuple[str, ...] = RIG_DRIVES, cycle: str = "5 ms"
) -> Path:
    """The project's bench of three drives on another bus, which rides through stalls.

    An MCLM has no outputs, and homes by switches only.
    """
    keys = yaml.safe_load(RIG_BENCH.read_text())
    keys |= {
        "interface": interface,
        "channel": channel,
        "options": options(interface),
        "cycle": cycle,
        "late_cycle": RIDING,
    }
    for node, profile in zip(keys["nodes"].values(), profiles, strict=True):
        if node["profile"] != profile:
            node.pop("units", None)
        node["profile"] = profile
        if profile == "mclm":
            for key in ("outputs", "safe_outputs", "homing"):
                del node[key]
    path = folder / "bench.yaml"
    path.write_text(yaml.safe_dump(keys, sort_keys=False))
    return path


def run_line(hardware: Path, seconds: float, runs: Path, build: Path) -> list[str]:
    """The command that runs the force scenario on it."""
    text = LONG.format(scenario=os.path.relpath(SCENARIO, hardware.parent), seconds=seconds)
    return line(hardware, text, runs, build, "--variant", "PI+FF+BW", "--seed", "1")


def rig_line(hardware: Path, seconds: float, runs: Path, build: Path, stroke: int = 50) -> list[str]:
    """The command that runs the whole rig on it: out for half of the time, then back."""
    distance = round(0.02 * (seconds - 2.0) / 2.0, 3)
    return line(
        hardware,
        LONG_RIG.format(
            scenario=os.path.relpath(RIG, hardware.parent), seconds=seconds, distance=distance, stroke=stroke
        ),
        runs,
        build,
    )


def line(hardware: Path, text: str, runs: Path, build: Path, *more: str) -> list[str]:
    """A command that runs a scenario on a bench."""
    scenario = hardware.with_name("scenario.yaml")
    scenario.write_text(text)
    words = ["run", str(scenario), "--hardware", str(hardware), "--json", "--runs", str(runs), "--build", str(build)]
    return [sys.executable, "-c", "from twin.cli import main; main()", *words, *more]


class Process(subprocess.Popen[str]):
    """A running `twin drive`; `port` takes its faults, where it was started with one."""

    port = 0


@contextlib.contextmanager
def drive(
    profile: str, interface: str, channel: str, build: Path, node: int = 1, more: Sequence[str] = ()
) -> Iterator[Process]:
    """`twin drive` as a process."""
    words = ["drive", "-p", profile, "-n", str(node), "-i", interface, "-c", channel, "--build", str(build), *more]
    words += [word for name, value in options(interface).items() for word in ("--option", f"{name}={value}")]
    process = Process(
        [sys.executable, "-c", "from twin.cli import main; main()", *words], stdout=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None
        said = process.stdout.readline()
        if f"node {node}" not in said:
            raise RuntimeError(f"the drive did not start on {interface} {channel}")
        if found := re.search(r"--control (\d+)", said):
            process.port = int(found[1])
        yield process
    finally:
        process.terminate()
        process.communicate(timeout=20)


@contextlib.contextmanager
def drives(
    profiles: Sequence[str], interface: str, channels: Sequence[str], build: Path, more: Sequence[str] = ()
) -> Iterator[list[Process]]:
    """Several of them, with node-IDs from 1."""
    with contextlib.ExitStack() as stack:
        found = [
            stack.enter_context(drive(profile, interface, channel, build, node, more))
            for node, (profile, channel) in enumerate(zip(profiles, channels, strict=True), 1)
        ]
        time.sleep(0.3)
        yield found


def carry(ends: list[int]) -> None:
    """Carry lines from each pseudo-terminal to all others, in a process of its own, as long as the one that started it lives."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(11))
    begun = dict.fromkeys(ends, b"")  # lines that are not complete: others may not come between
    parent = os.getppid()
    while os.getppid() == parent:
        for end in select.select(ends, [], [], 1.0)[0]:
            whole, mark, begun[end] = (begun[end] + os.read(end, 4096)).rpartition(b"\r")
            for other in ends:
                if other != end and mark:
                    os.write(other, whole + mark)


@contextlib.contextmanager
def cable(count: int = 2) -> Iterator[list[str]]:
    """Serial ports with a cable between all of them."""
    import multiprocessing
    import pty
    import tty

    pairs = [pty.openpty() for _ in range(count)]
    for pair in pairs:
        for end in pair:
            tty.setraw(end)
    process = multiprocessing.get_context("fork").Process(
        target=carry, args=([pair[0] for pair in pairs],), daemon=True
    )
    process.start()
    try:
        yield [os.ttyname(pair[1]) for pair in pairs]
    finally:
        process.kill()
        process.join()
        for pair in pairs:
            for end in pair:
                os.close(end)


@contextlib.contextmanager
def bus(interface: str, channel: str, count: int) -> Iterator[list[str]]:
    """A channel for each station."""
    if interface == "slcan":
        with cable(count) as ends:
            yield ends
    else:
        yield [channel] * count


def measure(interface: str, channel: str, seconds: float, folder: Path, build: Path) -> dict[str, Any]:
    """Summary of a run of the force scenario of so many seconds."""
    with bus(interface, channel, 2) as (ours, *theirs), drives(["faulhaber_v3"], interface, theirs, build):
        return summary(run_line(bench(folder, "faulhaber_v3", interface, ours), seconds, folder / "runs", build))


def measure_rig(
    interface: str,
    channel: str,
    seconds: float,
    folder: Path,
    build: Path,
    profiles: tuple[str, ...] = RIG_DRIVES,
    cycle: str = "5 ms",
    stroke: int = 50,
) -> dict[str, Any]:
    """Summary of a run of the whole rig of so many seconds."""
    with bus(interface, channel, 4) as (ours, *theirs), drives(profiles, interface, theirs, build):
        return summary(
            rig_line(rig_bench(folder, interface, ours, profiles, cycle), seconds, folder / "runs", build, stroke)
        )


def summary(command: list[str]) -> dict[str, Any]:
    """What a run says of itself."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not done.stdout:
        raise RuntimeError(done.stderr)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def show(seconds: float) -> None:
    """Print the figures of both interfaces, with one drive and with three."""
    build = Path("build")
    for interface in ("udp_multicast", "slcan"):
        with tempfile.TemporaryDirectory() as folder:
            tell(f"hil_{interface}", measure(interface, GROUP, seconds, Path(folder), build))
    for interface, cycle in (("udp_multicast", "5 ms"), ("slcan", "10 ms")):
        with tempfile.TemporaryDirectory() as folder:
            tell(f"hil_rig_{interface}", measure_rig(interface, GROUP, seconds, Path(folder), build, cycle=cycle))


def tell(name: str, found: dict[str, Any]) -> None:
    """Print the figures of a run."""
    print(f"{name}_status: {found['status']}{' ' + found['reason'] if found['reason'] else ''}")
    for one in found["expectations"]:
        print(f"{name}_{one['name'].replace(' ', '_')}: {one['verdict']}")
    for case in found["hardware"]["cases"]:
        nodes = case["nodes"].values()
        print(f"{name}_cycles: {case['cycles']}")
        print(f"{name}_lost_pdos: {sum(node['lost_pdos'] for node in nodes)}")
        print(f"{name}_late_pdos: {sum(node['late_pdos'] for node in nodes)}")
        print(f"{name}_overruns: {case['overruns']}")
        print(f"{name}_real_time_priority: {case['real_time_priority']}")
        for key in FIGURES:
            if key in case:  # not without cycles
                print(f"{name}_{key}_ms: {1e3 * case[key]:.3f}")


def main(words: Sequence[str]) -> None:
    """What the command line asks for."""
    if words and words[0] in ("beside", "where"):
        from benchmarks import stalls

        seconds = float(words[1]) if len(words) > 1 else 60.0
        if words[0] == "where":
            stalls.where(seconds)
        else:
            stalls.beside(seconds, int(words[2]) if len(words) > 2 else 10)
    else:
        show(float(words[0]) if words else 60.0)


if __name__ == "__main__":
    main(sys.argv[1:])
