"""Scenarios run from start to end: members of all kinds, what is recorded, and every way in which a run can end."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.fmi.third_party import native_fmu
from tests.matrix import some
from twin.errors import ScenarioError
from twin.results import Signals
from twin.results.recording.run_folder import read_signals
from twin.run import RunOptions, RunResult, run_scenario
from twin.scenario import Backend, parse_scenario

PARTS = "tests.run.pymunk_parts"
ROOT = Path(__file__).parents[2]


def run(
    text: str, tmp_path: Path, build: Path, form: Backend = Backend.compiled, **options: object
) -> tuple[RunResult, Signals]:
    """What the only case of a scenario gave, as its file has it."""
    scenario = parse_scenario(text, tmp_path / "s.yaml")
    outcome = run_scenario(
        scenario, RunOptions(backend=form, root=tmp_path / "runs", build=build, report=False, **options)
    )
    return outcome, next(iter(read_signals(outcome.folder / "signals.parquet")[0].values()))


def test_a_pymunk_body_is_pushed(tmp_path: Path, build: Path) -> None:
    outcome, signals = run(
        f"""
        stop_time: 1 s
        members: {{puck: {{component: "{PARTS}:Puck"}}}}
        events: [{{at: 0.5 s, set: {{puck.force: 2 N}}}}]
        """,
        tmp_path,
        build,
    )
    assert outcome.passed
    position = signals.values["puck.position"]
    assert position[500] == 0.0
    assert position[-1] == pytest.approx(0.5 * 2.0 / 0.5 * 0.5**2, rel=2e-2)


def test_a_member_that_fails_ends_the_run_and_keeps_what_was_recorded(tmp_path: Path, build: Path) -> None:
    outcome, signals = run(
        f"""
        stop_time: 1 s
        step: 100 ms
        members: {{motor: {{component: "{PARTS}:Burns"}}, load: {{component: chirp}}, other: {{component: "{PARTS}:BusGone"}}}}
        """,
        tmp_path,
        build,
    )
    assert outcome.summary["status"] == "failed"
    assert "motor: failed with ERROR in the step from t = 300 ms" in outcome.summary["reason"]
    assert "pymunk_parts.py" in outcome.summary["reason"]
    assert outcome.summary["reason"].endswith("RuntimeError: the motor burnt")
    assert signals.time.tolist() == [0.0, 0.1, 0.2, 0.3]


def test_an_expectation_without_a_sample_fails_the_run(tmp_path: Path, build: Path) -> None:
    outcome, _ = run(
        f"""
        stop_time: 1 s
        record: {{every: 100 ms}}
        members: {{puck: {{component: "{PARTS}:Puck"}}}}
        expect: [{{signal: puck.position, at_most: 1 m, from: 0.41 s, to: 0.49 s}}]
        """,
        tmp_path,
        build,
    )
    assert not outcome.passed
    assert outcome.summary["status"] == "completed"
    (one,) = outcome.evaluation.expectation_results
    assert one.detail.startswith("puck.position has no sample from 410 ms to 490 ms in base, seed 0; expected at most")


def test_a_member_that_cannot_be_closed_is_noted(tmp_path: Path, build: Path) -> None:
    outcome, _ = run(f'{{stop_time: 10 ms, members: {{b: {{component: "{PARTS}:BusGone"}}}}}}', tmp_path, build)
    assert outcome.passed
    assert "b: close failed" in outcome.summary["notes"][0]
    assert outcome.summary["notes"][0].endswith("OSError: bus gone")


def test_a_component_that_forgets_its_base_class(tmp_path: Path, build: Path) -> None:
    outcome, _ = run_without_signals(
        f'{{stop_time: 10 ms, members: {{b: {{component: "{PARTS}:Unmade"}}}}}}', tmp_path, build
    )
    assert "Unmade.__init__ has to call super().__init__(**values)" in outcome.summary["reason"]


def run_without_signals(text: str, tmp_path: Path, build: Path) -> tuple[RunResult, None]:
    """The same for a run that records nothing."""
    scenario = parse_scenario(text, tmp_path / "s.yaml")
    return run_scenario(
        scenario, RunOptions(backend=Backend.compiled, root=tmp_path / "runs", build=build, report=False)
    ), None


def test_structural_parameters_decide_the_shapes(tmp_path: Path, build: Path) -> None:
    native_fmu(tmp_path)
    outcome, signals = run(
        """
        stop_time: 1 s
        step: 100 ms
        members: {a: {component: Native.fmu, parameters: {n: 3, x: [1 m, 20 mm, 3], data: 00ff}}}
        record: {variables: ["a.y*"]}
        """,
        tmp_path,
        build,
    )
    assert outcome.passed
    last = [float(signals.values[f"a.y[{i}]"][-1]) for i in (1, 2, 3)]
    np.testing.assert_allclose(last, [1.0, 0.02, 3.0])
    with pytest.raises(ScenarioError, match=r"a.n: expected a whole number \(UInt64\), not 2.5"):
        run("{stop_time: 1 s, members: {a: {component: Native.fmu, parameters: {n: 2.5}}}}", tmp_path, build)


def test_a_member_that_ends_the_run_is_noted(tmp_path: Path, build: Path) -> None:
    native_fmu(tmp_path)
    outcome, _ = run(
        """
        stop_time: 1 s
        step: 100 ms
        members: {a: {component: Native.fmu, parameters: {limit: 0.25}}}
        """,
        tmp_path,
        build,
    )
    assert outcome.passed
    assert "a ended the simulation" in outcome.summary["notes"][0]


def test_derivatives_have_one_name_in_all_forms(tmp_path: Path, build: Path) -> None:
    text = '{stop_time: 20 ms, members: {wall: {component: wall}}, record: {variables: ["*.*"]}}'
    one, other = (run(text, tmp_path, build, form)[1] for form in (Backend.compiled, Backend.fmu))
    assert list(one.values) == list(other.values)
    assert np.array_equal(one.values["wall.der_indentation"], other.values["wall.der_indentation"])


def test_an_element_of_an_input_is_overridden_at_its_source(tmp_path: Path, build: Path) -> None:
    text = """
        stop_time: 20 ms
        members: {one: {component: "tests.coupling.element_parts:Source"}, two: {component: "tests.coupling.element_parts:Mirror"}}
        connections: [one.forces -> two.forces]
        events: [{at: 1 ms, override: {"two.forces[1]": 1 N}}]
        """
    with pytest.raises(ScenarioError, match=r"two.forces\[1\]: an element of an input cannot be overridden"):
        run(text, tmp_path, build)


ELEMENTS = """
    stop_time: 20 ms
    algorithm: ALGORITHM
    members: {one: {component: "tests.coupling.element_parts:Source"PERIOD}, two: {component: "tests.coupling.element_parts:Mirror"}}
    connections: [one.forces -> two.forces, one.valves -> two.valves]
    events:
      - {at: 4 ms, override: {"one.forces[2]": -1 N, "one.valves[3]": true}}
      - {at: 8 ms, override: {"one.forces[2]": -2 N, "one.forces[3]": -3 N}}
      - {at: 12 ms, release: ["one.forces[2]", "one.valves[3]"]}
    record: {variables: ["*.*"]}
"""


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("form", Backend)
@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel"])
@pytest.mark.parametrize("every", [1, 2])
def test_single_elements_are_overridden(tmp_path: Path, build: Path, every: int, algorithm: str, form: Backend) -> None:
    text = ELEMENTS.replace("ALGORITHM", algorithm).replace("PERIOD", f", period: {every} ms" if every > 1 else "")
    held, free = (
        run(one, tmp_path, build, form)[1].values for one in (text, re.sub(r" *events:(\n      - .*)+\n", "", text))
    )
    forces, valves = ({2: [], 3: []} for _ in range(2))
    for k in range(21):
        # the row of an event's own time was recorded before it
        forces[2].append(-1.0 if 4 < k <= 8 else -2.0 if 8 < k <= 12 else free["one.forces[2]"][k])
        forces[3].append(-3.0 if k > 8 else free["one.forces[3]"][k])
        valves[3].append(True if 4 < k <= 12 else free["one.valves[3]"][k])
    assert max(free["one.forces[2]"]) > 15.0
    assert not all(free["one.valves[3]"])
    for name in ("one.forces[1]", "one.valves[1]", "one.valves[2]"):
        assert held[name].tolist() == free[name].tolist()
    assert [held["one.forces[2]"].tolist(), held["one.forces[3]"].tolist()] == [forces[2], forces[3]]
    assert held["one.valves[3]"].tolist() == valves[3]

    # who reads it sees it: in the step after it was published, or in the same one
    late = 1 if algorithm == "jacobi" or every > 1 else 0
    for i in (1, 2, 3):
        seen, sent = held[f"two.seen[{i}]"], held[f"one.forces[{i}]"]
        if every == 1 and late:
            assert seen[6:9].tolist() == sent[5:8].tolist()
        assert (seen[5 + late] == -1.0) == (i == 2)


def test_seeds_from_the_command_line(tmp_path: Path) -> None:
    scenario = parse_scenario("{stop_time: 20 ms, members: {wall: {component: wall}}}", tmp_path / "s.yaml")
    assert [case.seed for case in scenario.cases(seeds=[3, 1, 3])] == [3, 1]
    with pytest.raises(ScenarioError, match="seed -1 is out of range"):
        scenario.cases(seeds=[-1])


@pytest.mark.slow
@pytest.mark.parametrize(
    "number", some((signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT), (signal.SIGINT,))
)
def test_interrupted_from_outside(tmp_path: Path, build: Path, number: signal.Signals) -> None:
    """What was recorded can be read, the summary says so, and no folder of an FMU stays behind."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    (tmp_path / "s.yaml").write_text("{stop_time: 1e5 s, members: {wall: {component: wall}}}")
    # also if the tests run in the background, where a shell lets SIGINT and SIGQUIT be ignored: of these SIGINT ends a run
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN); "
        "signal.signal(signal.SIGQUIT, signal.SIG_DFL); from twin.cli import main; main()"
    )
    command = [sys.executable, "-c", code, "run", "s.yaml", "--build", str(build)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(temporary)}
    with subprocess.Popen(
        [*command, "--no-report"], cwd=tmp_path, env=environment, stdout=-1, stderr=-1, text=True
    ) as task:
        assert task.stderr is not None
        lines = iter(task.stderr.readline, "")
        assert next(line for line in lines if not line.startswith("building ")) == "running base\n"
        while not (rows := [*tmp_path.glob("runs/s/*/.recording/0.rows")]) or rows[0].stat().st_size < 1600:
            assert task.poll() is None
            time.sleep(0.005)
        for _ in range(5):  # impatient
            task.send_signal(number)
            time.sleep(0.01)
        task.communicate(timeout=60)
        assert task.returncode == 130
    folder = next((tmp_path / "runs/s").glob("2*"))
    assert json.loads((folder / "summary.json").read_text())["status"] == "interrupted"
    assert len(read_signals(folder / "signals.parquet")[0]["base", 0].time) > 1
    assert not list(temporary.iterdir())
