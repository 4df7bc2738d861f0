"""Runs that are killed: what is left, and until when it was recorded.

    python -m benchmarks.kills [COUNT]      prints `name: value` lines; 50 kills of each of two runs
                                            that came as far as to have a folder

A run of three variants and one on simulated drives are killed with SIGKILL at random times, from their start to after
their end: the process that works, the one that watches it, or both at once. A member records the time of the wall clock,
so that the age of the last row at the death is known. Then another run in the same folder finishes what is left.
"""

from __future__ import annotations

import json
import os
import random
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from twin.results.recording.run_folder import read_signals

ROOT = Path(__file__).parent.parent
BUILD = ROOT / "build"
COUNT = 50
LOST = 0.1  # what may be lost [s]
BEGIN, SPAN = 0.3, 5.0  # kills happen between these times after the start [s]

THREE = """
stop_time: 1 s
members: {clock: {component: "benchmarks.parts:WallClock"}, wall: {component: wall}}
variants: {one: {}, two: {}, three: {}}
"""
DRIVES = f"""
extends: {ROOT}/scenarios/heart_wall_force.yaml
seeds: [1]
members: {{clock: {{component: "benchmarks.parts:WallClock", parameters: {{pause: 0.1 ms}}}}}}
record: {{variables: ["clock.*", "sensor.*"]}}
"""
NEXT = "{stop_time: 1 ms, members: {wall: {component: wall}}}"
TARGETS = ("worker", "supervisor", "both")


def command(*words: str) -> list[str]:
    return [sys.executable, "-c", "from twin.cli import main; main()", *words, "--build", str(BUILD), "--no-report"]


def child_of(pid: int) -> int | None:
    """The process that works."""
    try:
        found = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return None
    return int(found[0]) if found else None


def gone(pid: int) -> None:
    """Wait until a process is no more."""
    while Path(f"/proc/{pid}").exists() and " Z " not in Path(f"/proc/{pid}/stat").read_text():
        time.sleep(0.002)


def kill_once(words: list[str], place: Path, target: str, after: float) -> tuple[float, str]:
    """Start, kill, run the next; the time of the death and what the first one said."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(place / "temporary")}
    with subprocess.Popen(words, cwd=place, env=environment, stdout=-1, stderr=subprocess.STDOUT, text=True) as task:
        time.sleep(after)
        worker = child_of(task.pid)
        death = time.time()
        for pid in [task.pid] * (target != "worker") + [worker] * (target != "supervisor"):
            if pid is not None:
                try:
                    os.kill(pid, signal.SIGKILL)
                except ProcessLookupError:
                    continue
        said = task.communicate()[0]
        if worker is not None:
            gone(worker)
    return death, said


def last_row(signals) -> float:
    values = signals.values.get("clock.now")
    return float(values[-1]) if values is not None and len(values) else 0.0


def experiment(name: str, text: str, hardware: list[str], count: int, stop: float, seed: int = 1) -> None:
    """Kill a run many times, and print what came of it."""
    chance = random.Random(seed)
    ages, statuses, bad = [], [], []
    found = number = 0
    while found < count:
        number += 1
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder)
            (place / "temporary").mkdir()
            (place / "s.yaml").write_text(text)
            (place / "next.yaml").write_text(NEXT)
            target, after = TARGETS[number % 3], chance.uniform(BEGIN, SPAN)
            death, said = kill_once(command("run", "s.yaml", *hardware), place, target, after)
            environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(place / "temporary")}
            subprocess.run(command("run", "next.yaml"), cwd=place, env=environment, capture_output=True, check=True)
            wrong = [f"temporary: {one.name}" for one in (place / "temporary").iterdir()]
            for run in (place / "runs" / "s").glob("2*"):
                found += 1
                try:
                    summary = json.loads((run / "summary.json").read_text())
                    cases, _ = read_signals(run / "signals.parquet")
                except Exception as error:
                    wrong.append(f"{type(error).__name__}: {error}")
                    continue
                statuses.append(summary["status"])
                if (run / ".recording").exists():
                    wrong.append("recording left")
                incomplete = [one for one in summary["cases"] if not one["complete"]]
                if (summary["status"] == "completed") != (not incomplete and not summary["reason"]):
                    wrong.append(f"status {summary['status']}: {summary['reason']}")
                if incomplete and target != "supervisor":
                    key = incomplete[-1]["variant"], incomplete[-1]["seed"]
                    # one that had come to its end was being closed, or written; in its first step the clock shows nothing
                    if key in cases and len(cases[key].time) > 1 and cases[key].time[-1] < stop - 1e-6:
                        ages.append(death - last_row(cases[key]))
                        if ages[-1] > LOST:
                            wrong.append(f"the last row is {ages[-1]:.3f} s old")
            if wrong:
                bad.append(f"{target} after {after:.3f} s: {'; '.join(wrong)} | {said[-300:]}")
    for line in bad:
        print(f"# {name}: {line}")
    print(f"kills_{name}: {number}")
    print(f"kills_{name}_with_a_folder: {found}")
    print(f"kills_{name}_wrong: {len(bad)}")
    for status in sorted(set(statuses)):
        print(f"kills_{name}_{status}: {statuses.count(status)}")
    if ages:
        print(f"kills_{name}_in_a_case: {len(ages)}")
        print(f"kills_{name}_age_median_s: {statistics.median(ages):.3f}")
        print(f"kills_{name}_age_max_s: {max(ages):.3f}", flush=True)


def main() -> None:
    """Print the figures."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else COUNT
    experiment("three_variants", THREE, [], count, 1.0)
    bench = ROOT / "hw_bridge" / "benches" / "simulated_force.yaml"
    experiment("drives", DRIVES, ["--hardware", str(bench), "--variant", "PI"], count, 22.0)


if __name__ == "__main__":
    main()
