"""Hardware in the loop without hardware: the force scenario and a simulated drive, two processes in real time.

    python -m benchmarks.hil [SECONDS]     prints `name: value` lines; 60 s for each interface if nothing is said

Variant PI+FF+BW runs at a cycle of 5 ms against `twin drive`, over udp_multicast and over slcan on a pair of
pseudo-terminals with a process between them that carries the bytes. Jitter: periods between SYNCs minus the cycle.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

SCENARIO = Path(__file__).parents[1] / "scenarios" / "heart_wall_force.yaml"
GROUP = "239.74.163.77"
FIGURES = ("jitter_std", "jitter_median", "jitter_99", "jitter_max")
HURRY = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))"

BENCH = """interface: {interface}
channel: {channel}
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
metrics: {{force_error_std: null, force_error_max: null, force_error_mean: null}}
expect: [{{name: clinical range, signal: sensor.measured_force, within: [0.1 N, 0.4 N]}}]
plots: []
"""


def bench(folder: Path, profile: str, interface: str, channel: str) -> Path:
    """A hardware file."""
    path = folder / "bench.yaml"
    path.write_text(BENCH.format(profile=profile, interface=interface, channel=channel))
    return path


def run_line(hardware: Path, seconds: float, runs: Path, build: Path) -> list[str]:
    """The command that runs the scenario on it."""
    scenario = hardware.with_name("force.yaml")
    scenario.write_text(LONG.format(scenario=os.path.relpath(SCENARIO, hardware.parent), seconds=seconds))
    words = ["run", str(scenario), "--variant", "PI+FF+BW", "--seed", "1", "--hardware", str(hardware), "--json"]
    return [
        sys.executable, "-c", "from twin.cli import main; main()", *words, "--runs", str(runs), "--build", str(build),
    ]  # fmt: skip


@contextlib.contextmanager
def drive(profile: str, interface: str, channel: str, build: Path) -> Iterator[None]:
    """`twin drive` as a process, with real-time priority where that is allowed."""
    words = ["-p", profile, "-n", "1", "-i", interface, "-c", channel, "--build", str(build)]
    script = f"import contextlib, sys\nwith contextlib.suppress(OSError): {HURRY}\nfrom hw_bridge.drive.command import main; main()"
    process = subprocess.Popen([sys.executable, "-c", script, *words], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        if "node 1" not in process.stdout.readline():
            raise RuntimeError(f"the drive did not start on {interface} {channel}")
        yield
    finally:
        process.terminate()
        process.communicate(timeout=20)


def carry(ends: list[int]) -> None:
    """Carry bytes between two pseudo-terminals for ever, in a process of its own."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(11))
    while True:
        for end in select.select(ends, [], [])[0]:
            os.write(ends[1 - ends.index(end)], os.read(end, 4096))


@contextlib.contextmanager
def cable() -> Iterator[tuple[str, str]]:
    """Two serial ports with a cable between them."""
    import multiprocessing
    import pty
    import tty

    pairs = [pty.openpty() for _ in range(2)]
    for pair in pairs:
        for end in pair:
            tty.setraw(end)
    process = multiprocessing.get_context("fork").Process(
        target=carry, args=([pair[0] for pair in pairs],), daemon=True
    )
    process.start()
    try:
        yield os.ttyname(pairs[0][1]), os.ttyname(pairs[1][1])
    finally:
        process.kill()
        process.join()
        for pair in pairs:
            for end in pair:
                os.close(end)


def measure(interface: str, channel: str, seconds: float, folder: Path, build: Path) -> dict[str, Any]:
    """Summary of a run of so many seconds."""
    with contextlib.ExitStack() as stack:
        ours, theirs = stack.enter_context(cable()) if interface == "slcan" else (channel, channel)
        stack.enter_context(drive("faulhaber_v3", interface, theirs, build))
        time.sleep(0.3)
        line = run_line(bench(folder, "faulhaber_v3", interface, ours), seconds, folder / "runs", build)
        done = subprocess.run(line, capture_output=True, text=True, check=False)
    if not done.stdout:
        raise RuntimeError(done.stderr)
    summary: dict[str, Any] = json.loads(done.stdout)
    return summary


def show(seconds: float) -> None:
    """Print the figures of both interfaces."""
    build = Path("build")
    for interface in ("udp_multicast", "slcan"):
        with tempfile.TemporaryDirectory() as folder:
            summary = measure(interface, GROUP, seconds, Path(folder), build)
        name = f"hil_{interface}"
        print(f"{name}_status: {summary['status']}{' ' + summary['reason'] if summary['reason'] else ''}")
        print(f"{name}_force_in_range: {summary['expectations'][0]['verdict']}")
        for case in summary["hardware"]["cases"]:
            node = case["nodes"]["servomotor"]
            print(f"{name}_cycles: {case['cycles']}")
            print(f"{name}_lost_pdos: {node['lost_pdos']}")
            print(f"{name}_late_pdos: {node['late_pdos']}")
            print(f"{name}_overruns: {case['overruns']}")
            print(f"{name}_real_time_priority: {case['real_time_priority']}")
            for key in FIGURES:
                print(f"{name}_{key}_ms: {1e3 * case[key]:.3f}")


if __name__ == "__main__":
    show(float(sys.argv[1]) if len(sys.argv) > 1 else 60.0)
