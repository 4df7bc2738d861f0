"""Every way in which a run can end: real processes, killed by real signals and by their own members."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from tests.run.endings import MODES, ending_fmu
from twin.errors import TwinError
from twin.results import Signals
from twin.results.evaluation.reduction import REDUCTIONS
from twin.results.recording import stream
from twin.results.recording.rows import RowColumn, RowFile
from twin.results.recording.run_folder import read_signals
from twin.run import RunOptions, recover, run_scenario
from twin.scenario import Backend, parse_scenario

ROOT = Path(__file__).parents[2]
CLOCK = """
    stop_time: 1 s
    members: {clock: {component: "tests.run.endings:WallClock"}}
    variants: {one: {}, two: {}}
"""
LOG = "Last log: WARNING: goes to the end | native: the end is near"
ENDS = {
    "crash": f"crashed with SIGSEGV (Segmentation fault) in fmi3DoStep, in the step from t = 300 ms. {LOG}",
    "abort": f"crashed with SIGABRT (Aborted) in fmi3DoStep, in the step from t = 300 ms. {LOG}",
    "exit": f"ended the process with exit code 7 in fmi3DoStep, in the step from t = 300 ms. {LOG}",
    "hang": f"did not return for 0.5 s in fmi3DoStep, in the step from t = 300 ms. {LOG}",
}


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    return ending_fmu(tmp_path_factory.mktemp("fmu"))


def results(folder: Path) -> tuple[dict, dict[tuple[str, int], Signals]]:
    """Summary and signals of the only run in a folder, which is whole."""
    (run,) = folder.glob("runs/*/2*")
    assert sorted(one.name for one in run.iterdir()) == ["scenario.yaml", "signals.parquet", "summary.json"]
    return json.loads((run / "summary.json").read_text()), read_signals(run / "signals.parquet")[0]


@pytest.mark.slow
def test_a_member_may_end_its_process_and_the_other_variants_run(tmp_path, build, command_line, fmu):
    variants = ", ".join(
        f"{name}: {{members: {{a: {{parameters: {{mode: {mode}}}}}}}}}" for name, mode in MODES.items()
    )
    (tmp_path / "s.yaml").write_text(f"""
        title: ends
        stop_time: 1 s
        step: 100 ms
        members: {{a: {{component: {fmu}}}}}
        variants: {{first: {{}}, {variants}, last: {{}}}}
        record: {{variables: ["a.y*"]}}
        metrics: {{last: {{signal: "a.y[1]", reduce: final}}}}
    """)
    done = command_line.run(["run", "s.yaml", "--build", str(build), "--no-report", "--timeout", "0.5"], tmp_path)
    assert done.returncode == 1
    summary, cases = results(tmp_path)
    assert summary["status"] == "failed"
    assert summary["reason"].splitlines() == [f"{name}, seed 0: a: {text}" for name, text in ENDS.items()]
    assert [case["complete"] for case in summary["cases"]] == [True, False, False, False, False, True]
    assert {case[0]: len(signals.time) for case, signals in cases.items()} == {
        "first": 11,
        "crash": 4,
        "abort": 4,
        "exit": 4,
        "hang": 4,
        "last": 11,
    }
    assert summary["scenario"]["title"] == "ends"
    assert summary["metrics"]["last"]["variants"]["last"]["mean"] == 1.0


@pytest.mark.slow
def test_a_component_that_ends_its_process_outside_of_the_loop(tmp_path, build, command_line):
    (tmp_path / "s.yaml").write_text('{stop_time: 5 ms, members: {m: {component: "tests.run.endings:Closes"}}}')
    done = command_line.run(["run", "s.yaml", "--build", str(build), "--no-report"], tmp_path)
    assert done.returncode == 1
    summary, cases = results(tmp_path)
    assert summary["reason"] == "base, seed 0: m: ended the process with exit code 3 in termination, at t = 5 ms."
    assert len(cases["base", 0].time) == 6


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("how", ["crash", "exit", "hang"])
def test_simulating_an_fmu_that_ends_its_process(tmp_path, command_line, fmu, how):
    words = ["simulate", str(fmu), "-s", f"mode={MODES[how]}", "--timeout", "0.5"]
    done = command_line.run(words, tmp_path)
    assert done.returncode == 1
    assert f"error: Native: {ENDS[how]} Results up to then are in Native_out.csv." in done.stderr
    rows = (tmp_path / "Native_out.csv").read_text().splitlines()
    assert [row.partition(",")[0] for row in rows] == ["time", "0.0", "0.1", "0.2", "0.3"]


@pytest.mark.slow
def test_a_component_that_hangs_is_named_with_its_line(tmp_path, command_line):
    assert command_line.run(["new", "stuck"], tmp_path).returncode == 0
    model = tmp_path / "fmus" / "stuck" / "model.py"
    text = model.read_text()
    line = len(text.splitlines()) + 1
    model.write_text(f"{text}        while self.time_constant > 0.0:\n            pass\n")
    done = command_line.run(["test", "stuck", "--timeout", "1"], tmp_path)
    assert done.stdout.splitlines() == ["stuck: FAILED"]
    found = re.search(
        rf"^  outputs: did not return for 1 s, at {re.escape(str(model))}:(\d+)\. Correct it", done.stderr, re.MULTILINE
    )
    assert found
    assert int(found[1]) in (line, line + 1)


class Killed:
    """A run of two variants that is alive while the test runs; `worker` is the process that simulates."""

    def __init__(self, folder: Path, build: Path) -> None:
        (folder / "temporary").mkdir()
        (folder / "s.yaml").write_text(CLOCK)
        self.folder = folder
        self.environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(folder / "temporary")}
        self.words = [
            sys.executable,
            "-c",
            "from twin.cli import main; main()",
            "run",
            "s.yaml",
            "--no-report",
            "--build",
            str(build),
        ]
        self.task = subprocess.Popen(self.words, cwd=folder, env=self.environment, stderr=-1, text=True)
        while not (rows := list(folder.glob("runs/s/*/.recording/0.rows"))) or rows[0].stat().st_size < 1600:
            assert self.task.poll() is None
            time.sleep(0.005)
        self.worker = int(Path(f"/proc/{self.task.pid}/task/{self.task.pid}/children").read_text().split()[0])

    def kill(self, *pids: int) -> float:
        """Kill some, and wait for the death of all; the time."""
        death = time.time()
        for pid in pids:
            os.kill(pid, signal.SIGKILL)
        self.task.communicate(timeout=60)
        while Path(f"/proc/{self.worker}").exists() and " Z " not in Path(f"/proc/{self.worker}/stat").read_text():
            time.sleep(0.005)
        return death


needs_proc = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds processes in /proc")


@pytest.mark.slow
@needs_proc
def test_the_process_that_works_is_killed(tmp_path, build):
    run = Killed(tmp_path, build)
    death = run.kill(run.worker)
    assert run.task.returncode == 130
    summary, cases = results(tmp_path)
    assert summary["status"] == "interrupted"
    assert summary["reason"].startswith(
        "one, seed 0: the run was killed (SIGKILL) by another process, or by the system"
    )
    assert re.search(r"(in the step from|at) t = [\d.]+ ms(, clock at work in step)?\.$", summary["reason"])
    assert list(cases) == [("one", 0)]
    assert death - cases["one", 0].values["clock.now"][-1] < 1.0  # 0.1 s where the machine is not busy
    assert not list((tmp_path / "temporary").iterdir())


@pytest.mark.slow
@needs_proc
def test_the_process_that_watches_is_killed(tmp_path, build):
    run = Killed(tmp_path, build)
    run.kill(run.task.pid)
    summary, cases = results(tmp_path)
    assert (summary["status"], list(cases)) == ("interrupted", [("one", 0)])
    assert summary["reason"] == "interrupted in one, seed 0 because its supervisor was killed"


@pytest.mark.slow
@needs_proc
def test_all_processes_are_killed(tmp_path, build):
    run = Killed(tmp_path, build)
    (folder,) = tmp_path.glob("runs/s/2*")
    with pytest.raises(TwinError, match="the run is in progress"):
        recover(folder)
    death = run.kill(run.task.pid, run.worker)
    with (folder / ".recording" / "journal.jsonl").open("a") as file:
        file.write('{"cut o')
    with (folder / ".recording" / "0.rows").open("ab") as file:
        file.write(b"cut")

    # the next one finishes it
    (tmp_path / "s.yaml").write_text("{stop_time: 1 ms, members: {wall: {component: wall}}}")
    done = subprocess.run(run.words, cwd=tmp_path, env=run.environment, capture_output=True, text=True, check=True)
    assert (
        f"note: {folder.relative_to(tmp_path)}: recovered; interrupted: one, seed 0: the run was killed" in done.stderr
    )
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["status"] == "interrupted"
    signals = read_signals(folder / "signals.parquet")[0]["one", 0]
    assert death - signals.values["clock.now"][-1] < 1.0
    assert not list((tmp_path / "temporary").iterdir())
    with pytest.raises(TwinError, match="is complete: there is nothing to recover"):
        recover(folder)


@pytest.mark.slow
def test_a_recording_that_is_larger_than_memory(tmp_path, build, monkeypatch):
    reductions = "\n      ".join(f"{name}: {{signal: rail.velocity, reduce: {name}}}" for name in REDUCTIONS)
    scenario = parse_scenario(
        f"""
        stop_time: 50 ms
        members: {{wall: {{component: wall}}, rail: {{component: chirp}}}}
        connections: ["rail.position -> wall.tip_position"]
        record: {{variables: ["*.*"]}}
        metrics:
          {reductions.replace("      ", "          ")}
          late: {{signal: rail.position, reduce: mean, from: 20 ms, to: 30 ms, unit: mm}}
        expect:
          - {{signal: rail.position, at_most: -1 mm}}
          - {{signal: wall.force, from: 45.2 ms, to: 45.8 ms, at_most: 1 N}}
        plots:
          - {{title: Over time, signals: [rail.position]}}
          - {{title: A loop, xy: [rail.position, rail.velocity]}}
        """,
        tmp_path / "s.yaml",
    )
    whole = run_scenario(scenario, RunOptions(backend=Backend.compiled, root=tmp_path / "a", build=build))
    monkeypatch.setattr(stream, "LARGE_FILE", 0)
    monkeypatch.setattr(stream, "SLICE_SIZE", 700)
    monkeypatch.setattr(RowColumn, "__array__", None)  # nobody asks for a whole column
    read, readers = RowFile.read, set()

    def noted(rows, begin, end):
        readers.add(threading.current_thread())
        return read(rows, begin, end)

    monkeypatch.setattr(RowFile, "read", noted)
    parts = run_scenario(scenario, RunOptions(backend=Backend.compiled, root=tmp_path / "b", build=build))
    one, other = (read_signals(run.folder / "signals.parquet")[0]["base", 0] for run in (whole, parts))
    assert len(one.time) == 51
    assert len(readers) == 1, "two would take the slice at hand from each other, and read the file for each column"
    assert list(one.values) == list(other.values)
    assert all((one.values[name] == other.values[name]).all() for name in one.values)
    assert parts.evaluation.expectation_results == whole.evaluation.expectation_results
    assert [one.verdict for one in whole.evaluation.expectation_results] == ["fail", "fail"]
    for one, other in zip(whole.evaluation.metric_results, parts.evaluation.metric_results, strict=True):
        assert other.values == pytest.approx(one.values, rel=1e-13), one.metric.name
    assert (whole.folder / "report.html").read_text().count("<svg") == 3  # and the system
    assert (parts.folder / "report.html").read_text().count("<svg") == 3  # and the system
