"""Checkpoints: a run that is continued equals one without interruption, to the bit; what cannot be continued is refused."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.fmi.third_party import native_fmu
from twin.coupling import Algorithm
from twin.errors import ScenarioError, TwinError
from twin.fmi import fmu_cache
from twin.results.recording.run_folder import read_signals
from twin.run import RunOptions, RunResult, continue_run, run_scenario
from twin.run.checkpoint import list_checkpoints
from twin.scenario import Backend, ScenarioSpec, load_scenario, parse_scenario

MS = 1_000_000
ROOT = Path(__file__).parents[2]
PARTS = "tests.run.checkpoint_parts"
SCENARIO = f"""
    stop_time: 0.1 s
    step: 1 ms
    algorithm: {{name: ALGORITHM}}
    seeds: [1, 2]
    members:
      walk: {{component: "{PARTS}:RandomWalk"}}
      mass: {{component: "{PARTS}:Oscillator"}}
      other: {{component: "{PARTS}:Oscillator", parameters: {{gain: 700}}}}
    connections: [walk.y -> mass.u, mass.y -> other.u, other.y -> mass.w]
    events:
      - {{at: 20 ms, override: {{walk.y: 2}}}}
      - {{at: 40 ms, release: [walk.y]}}
      - {{at: 50 ms, set: {{mass.gain: 300}}}}
    record: {{every: 2 ms, variables: ["*.*"]}}
"""


def run(
    text: str | ScenarioSpec,
    folder: Path,
    build: Path,
    backend: Backend = Backend.interpreted,
    every: int = 30 * MS,
    **more,
) -> RunResult:
    """A run with checkpoints."""
    scenario = parse_scenario(text, folder / "s.yaml") if isinstance(text, str) else text
    options = RunOptions(backend=backend, root=folder / "runs", build=build, report=False, checkpoint_ns=every, **more)
    return run_scenario(scenario, options)


def continued(outcome: RunResult, build: Path, at_ns: int | None = None, *overrides: str) -> RunResult:
    options = RunOptions(root=outcome.folder.parents[1], build=build, report=False)
    return continue_run(outcome.folder, options, at_ns=at_ns, overrides=overrides)


def assert_equal_bits(one: RunResult, other: RunResult) -> None:
    first, second = (read_signals(outcome.folder / "signals.parquet")[0] for outcome in (one, other))
    assert first.keys() == second.keys()
    for case, signals in first.items():
        assert signals.time.tobytes() == second[case].time.tobytes()
        assert signals.values.keys() == second[case].values.keys()
        for name, values in signals.values.items():
            assert values.tobytes() == second[case].values[name].tobytes(), (case, name)
    assert one.summary["metrics"] == other.summary["metrics"]


def starts(outcome: RunResult) -> list[str]:
    """Times at which the cases of a run were continued."""
    return [note.rpartition(" t = ")[2] for note in outcome.summary.get("notes", []) if "continues" in note]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("at", [25, 0, 45, 70])
def test_a_continued_run_equals_one_without_interruption(tmp_path, build, at):
    outcome = run(SCENARIO.replace("ALGORITHM", "jacobi"), tmp_path, build, every=5 * MS)
    other = continued(outcome, build, at * MS)
    assert_equal_bits(outcome, other)
    assert starts(other) == ([f"{at} ms"] * 2 if at else [])
    assert [checkpoint.time_ns for checkpoint in list_checkpoints(other.folder)] == sorted(
        2 * list(range((at + 5) * MS, 101 * MS, 5 * MS))
    )


@pytest.mark.slow
@pytest.mark.parametrize("backend", [Backend.compiled, Backend.fmu])
@pytest.mark.parametrize("algorithm", [algorithm.name for algorithm in Algorithm])
def test_algorithms(tmp_path, build, algorithm, backend):
    text = SCENARIO.replace("ALGORITHM", algorithm)
    outcome = run(text, tmp_path, build, backend, every=11 * MS)
    assert_equal_bits(outcome, continued(outcome, build, 35 * MS))


@pytest.mark.slow
def test_fmus_of_both_versions_and_isolated_members(tmp_path, build):
    from tests.run.checkpoint_parts import Oscillator, RandomWalk

    fmus = [fmu_cache.build(cls, version, build) for cls, version in ((RandomWalk, "3.0"), (Oscillator, "2.0"))]
    text = SCENARIO.replace("ALGORITHM", "jacobi")
    for name, file in zip(("RandomWalk", "Oscillator"), fmus, strict=True):
        text = text.replace(f'"{PARTS}:{name}"', f"{file}, isolate: {'true' if name == 'Oscillator' else 'false'}")
    outcome = run(text, tmp_path, build, Backend.fmu, every=11 * MS)
    assert outcome.run.status == "completed", outcome.run.reason
    assert_equal_bits(outcome, continued(outcome, build, 35 * MS))


SHIPPED = sorted(path.stem for path in (ROOT / "scenarios").glob("*.yaml"))
PYTHON_SIDE = {"bench_buckling", "bench_force", "bench_hysteresis", "bench_wall"}  # their bodies are Python objects


def test_a_continued_run_with_changed_values_is_not_compared_with_published_ones():
    """Its frozen scenario has no overrides, so that every variant would look unchanged."""
    from twin.run.recovery import with_texts

    frozen = load_scenario(ROOT / "scenarios" / "heart_wall_force.yaml")
    data = {"name": "a", "title": "", "description": "", "source": "", "path": "a.yaml"}
    restored = with_texts(frozen, {**data, "overrides": ["heart.rate=1.2 Hz"], "paper_applies": False})
    assert frozen.unchanged_variants
    assert (restored.paper_applies, restored.unchanged_variants) == (False, ())


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenarios_at_random_times(tmp_path, build, name):
    scenario = load_scenario(ROOT / "scenarios" / f"{name}.yaml")
    case = min(scenario.variants, key=lambda case: case.stop_ns)
    steps = (case.stop_ns - case.start_ns) // case.step_ns
    every = int(np.random.default_rng(sum(name.encode())).integers(steps // 4, steps // 3)) * case.step_ns
    chosen = {"variants": [case.variant], "seeds": [scenario.seeds[0]]}
    if name in PYTHON_SIDE:
        with pytest.raises(ScenarioError, match=r"cannot be saved in a checkpoint: it is Python-side"):
            run(scenario, tmp_path, build, Backend.fmu, every, **chosen)
        return
    outcome = run(scenario, tmp_path, build, Backend.fmu, every, **chosen)
    assert outcome.run.status == "completed", outcome.run.reason
    for count in (1, 2, 3):
        other = continued(outcome, build, case.start_ns + count * every)
        assert len(starts(other)) == 1
        assert_equal_bits(outcome, other)


def test_a_branch_equals_a_run_with_events(tmp_path, build):
    text = SCENARIO.replace("ALGORITHM", "jacobi")
    branch = continued(run(text, tmp_path, build), build, 70 * MS, "mass.gain=500")
    assert starts(branch) == ["60 ms", "60 ms"]
    event = "      - {at: 70 ms, set: {mass.gain: 500}}\n"
    whole = run(text.replace("    record:", event + "    record:"), tmp_path, build)
    assert_equal_bits(branch, whole)
    again = run(load_scenario(branch.folder / "scenario.yaml"), tmp_path, build)
    assert_equal_bits(branch, again)


def test_a_variant_with_other_units_is_continued_in_its_own(tmp_path, build):
    """The recording has the unit of the first variant; the rows of the others go on in theirs."""
    (tmp_path / "m.csv").write_text("time,u [m],t [K]\n0,0.001,300\n0.1,0.0137,317.3\n")
    (tmp_path / "mm.csv").write_text("time,u [mm],t [degC]\n0,1,26.85\n0.1,13.7,44.15\n")
    text = """
        stop_time: 0.1 s
        step: 1 ms
        members: {table: {component: m.csv}}
        variants: {first: {}, second: {members: {table: {component: mm.csv}}}}
        record: ["*.*"]
        metrics: {u: {signal: table.u, reduce: max}}
    """
    outcome = run(text, tmp_path, build)
    assert_equal_bits(outcome, continued(outcome, build, 70 * MS))


def test_values_that_a_branch_cannot_set(tmp_path, build):
    outcome = run(SCENARIO.replace("ALGORITHM", "jacobi"), tmp_path, build)
    for override, expected in {
        "walk.seed=3": "--set walk.seed=3: walk.seed is fixed. Set it in members.",
        "mass.gian=3": "--set mass.gian=3: mass has no variable `gian`",
        "mass.u=3": "is connected",
    }.items():
        with pytest.raises(ScenarioError) as error:
            continued(outcome, build, 70 * MS, override)
        assert expected in str(error.value)
    with pytest.raises(ScenarioError) as error:
        continued(outcome, build, 700 * MS, "mass.gain=3")
    assert "event at 700 ms is outside the run, 0 s to 100 ms" in str(error.value)


def test_members_that_cannot_be_saved_are_named_before_the_run(tmp_path, build):
    text = f"""
        stop_time: 0.1 s
        members: {{one: {{component: "{PARTS}:Remembers"}}, walk: {{component: "{PARTS}:RandomWalk"}}}}
        variants: {{first: {{members: {{one: null}}}}, second: {{}}}}
    """
    with pytest.raises(TwinError) as error:
        run(text, tmp_path, build)
    assert str(error.value) == (
        "one: cannot be saved in a checkpoint: it is Python-side, and its state lies in Python objects. "
        "Run without --checkpoint."
    )


@pytest.mark.slow
def test_fmus_that_cannot_be_saved_are_named_before_the_run(tmp_path, build):
    native_fmu(tmp_path)
    text = f"""
        stop_time: 0.1 s
        members:
          foreign: {{component: Native.fmu}}
          mass: {{component: "{PARTS}:Oscillator", interface: model_exchange}}
          walk: {{component: "{PARTS}:RandomWalk"}}
    """
    with pytest.raises(TwinError) as error:
        run(text, tmp_path, build)
    assert [line.partition(" Run without")[0] for line in error.value.problems] == [
        "foreign: cannot be saved in a checkpoint: its FMU cannot (canSerializeFMUState).",
        "mass: cannot be saved in a checkpoint: it is integrated here (Model Exchange), and the state of its solver cannot be written.",
    ]


def test_an_interval_between_communication_points(tmp_path, build):
    with pytest.raises(ScenarioError) as error:
        run(SCENARIO.replace("ALGORITHM", "jacobi"), tmp_path, build, every=2_500_000)
    assert str(error.value) == (
        "--checkpoint 2.5 ms: is no multiple of the communication step 1 ms of variant `base`. Use 2 ms."
    )


def rewrite(path: Path, **changes: object) -> None:
    """Change the header of a checkpoint."""
    with zipfile.ZipFile(path) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    entries["checkpoint.json"] = json.dumps(json.loads(entries["checkpoint.json"]) | changes).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in entries.items():
            archive.writestr(name, data)


def test_what_has_changed_is_refused(tmp_path, build):
    outcome = run(SCENARIO.replace("ALGORITHM", "jacobi"), tmp_path, build, every=50 * MS, seeds=[1])
    folder = outcome.folder
    with pytest.raises(TwinError, match="is complete: there is nothing to resume"):
        continued(outcome, build)
    first, last = list_checkpoints(folder)
    members = dict(first.header["members"])
    rewrite(first.path, members=members | {"mass": "0"})
    assert (
        "0_50.zip: the model of mass has changed since. Use revision" in continued(outcome, build, 60 * MS).run.reason
    )
    rewrite(first.path, members=members)
    rewrite(last.path, versions=last.header["versions"] | {"engine": "another"})
    with pytest.raises(TwinError, match="were written by another state of the engine \\(version 0"):
        continued(outcome, build, 60 * MS)
    rewrite(last.path, versions=last.header["versions"], format=7)
    with pytest.raises(TwinError, match="has format 7; this version reads 1"):
        continued(outcome, build, 60 * MS)
    last.path.write_bytes(last.path.read_bytes()[:-40])
    with pytest.raises(TwinError, match="is damaged, or no checkpoint"):
        continued(outcome, build, 60 * MS)
    last.path.unlink()
    scenario = folder / "scenario.yaml"
    scenario.write_text(scenario.read_text().replace("300", "301"))
    with pytest.raises(TwinError, match=r"scenario\.yaml: was changed after the checkpoints"):
        continued(outcome, build, 60 * MS)
    first.path.unlink()
    with pytest.raises(TwinError, match=r"has no checkpoint\. Run the scenario with `--checkpoint 10s`"):
        continued(outcome, build, 60 * MS)


@pytest.mark.slow
def test_a_killed_run_is_resumed(tmp_path, build, command_line):
    """After `kill -9` of all processes at any moment."""
    text = SCENARIO.replace("ALGORITHM", "jacobi").replace("0.1 s", "0.4 s")
    (tmp_path / "s.yaml").write_text(
        text.replace("    connections", f'      slow: {{component: "{PARTS}:Slow"}}\n    connections')
    )
    words = ["run", "s.yaml", "--no-report", "--build", str(build), "--backend", "interpreted", "--checkpoint", "20 ms"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    program = [sys.executable, "-c", "from twin.cli import main; main()"]
    task = subprocess.Popen(
        [*program, *words], cwd=tmp_path, env=environment, stderr=subprocess.DEVNULL, start_new_session=True
    )
    while not list(tmp_path.glob("runs/s/*/checkpoints/1_1*.zip")):  # the second case is at 0.1 s
        assert task.poll() is None
        time.sleep(0.003)
    os.killpg(task.pid, signal.SIGKILL)
    task.wait()
    (killed,) = tmp_path.glob("runs/s/2*")
    done = command_line.run(["resume", str(killed), "--no-report", "--build", str(build)], tmp_path)
    assert done.returncode == 0, done.stderr
    resumed = next(run for run in tmp_path.glob("runs/s/2*") if run != killed)
    notes = json.loads((resumed / "summary.json").read_text())["notes"]
    assert [note.rpartition(" t = ")[2] for note in notes][:1] == ["400 ms"]
    done = command_line.run([*words[:-2], "--runs", "whole"], tmp_path)
    assert done.returncode == 0, done.stderr
    (whole,) = tmp_path.glob("whole/s/2*")
    done = command_line.run(["compare", str(resumed), str(whole), "--tolerance", "0"], tmp_path)
    assert done.returncode == 0, done.stdout
