"""Events with a condition: when they happen, in all forms of members, algorithms, checkpoints and studies."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.run.test_checkpoint import assert_equal_bits, continued
from tests.run.test_checkpoint import run as run_with_checkpoints
from tests.study.patients import study_file
from tests.study.test_many import table
from twin.coupling import Algorithm
from twin.results.recording.run_folder import read_signals
from twin.run import RunOptions, RunResult, run_scenario
from twin.scenario import Backend, load_scenario, parse_scenario
from twin.study import load_study, resolve_case, run_study, single

MS = 1_000_000
PARTS = "tests.run.checkpoint_parts"
RAMP, END = "tests.run.condition_parts:Ramp", "tests.run.condition_parts:End"
SCENARIO = f"""
    stop_time: 0.4 s
    step: 1 ms
    algorithm: {{name: ALGORITHM}}
    seeds: [1, 2]
    members:
      walk: {{component: "{PARTS}:RandomWalk"}}
      mass: {{component: "{PARTS}:Oscillator"}}
      other: {{component: "{PARTS}:Oscillator", parameters: {{gain: 700}}}}
    connections: [walk.y -> mass.u, mass.y -> other.u, other.y -> mass.w]
    events:
      - {{when: mass.y > 0.02 and not other.y > 0.035, set: {{mass.gain: 500}}, description: stiff}}
      - {{at: 50 ms, set: {{other.gain: 650}}}}
      - {{when: abs(mass.y - other.y) > 0.01, for: 3.5 ms, repeat: true, override: {{walk.y: 2}}}}
      - {{when: mass.y < -0.01, after: 149.5 ms, repeat: true, release: walk.y}}
      - {{when: mass.y > 1, set: {{mass.gain: 300}}}}
      - {{when: walk.y >= 2, repeat: true}}
    record: {{variables: ["*.*"]}}
"""
STOP = "      - {when: mass.y < -0.03 or other.y < -0.03, after: 0.2 s, stop: true, description: far below}\n"


def run(text: str, folder: Path, build: Path, backend: Backend = Backend.compiled, **options: object) -> RunResult:
    """A run without checkpoints."""
    scenario = parse_scenario(text, folder / "s.yaml")
    return run_scenario(
        scenario, RunOptions(backend=backend, root=folder / "runs", build=build, report=False, **options)
    )


def occurrences(outcome: RunResult) -> list[tuple[int, float, str]]:
    return [(item["seed"], item["time"], item["when"]) for item in outcome.summary["conditions"]]


ONCE = "mass.y > 0.02 and not other.y > 0.035"
TESTS = {  # of values at a communication point; for how many points it must hold, the first one at which it counts
    ONCE: (lambda v: v["mass.y"] > 0.02 and not v["other.y"] > 0.035, 0, 0),
    "abs(mass.y - other.y) > 0.01": (lambda v: abs(v["mass.y"] - v["other.y"]) > 0.01, 4, 0),
    "mass.y < -0.01": (lambda v: v["mass.y"] < -0.01, 0, 150),
    "walk.y >= 2": (lambda v: v["walk.y"] >= 2, 0, 0),
}


def expected_occurrences(outcome: RunResult) -> list[tuple[int, float, str]]:
    """The same from what was recorded, row by row."""
    found = []
    for (_, seed), signals in read_signals(outcome.folder / "signals.parquet")[0].items():
        lengths, armed = dict.fromkeys(TESTS, 0), dict.fromkeys(TESTS, True)
        for i, time in enumerate(signals.time[:-1]):
            values = {name: column[i] for name, column in signals.values.items()}
            for when, (test, hold, first) in TESTS.items():
                is_true = i >= first and test(values)
                lengths[when] = lengths[when] + 1 if is_true else 0
                if armed[when] and lengths[when] > hold:
                    armed[when] = False
                    found.append((seed, float(time), when))
                elif not is_true and when != ONCE:
                    armed[when] = True
    return found


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("algorithm", [algorithm.name for algorithm in Algorithm])
def test_conditions_happen_when_the_recording_says_so(tmp_path, build, algorithm):
    outcome = run(SCENARIO.replace("ALGORITHM", algorithm), tmp_path, build)
    assert outcome.run.status == "completed", outcome.run.reason
    found = occurrences(outcome)
    assert found == expected_occurrences(outcome)
    assert {when for _, _, when in found} == set(TESTS)
    assert "base: condition `mass.y > 1` was never met" in outcome.summary["notes"]


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ["jacobi", "step_doubling"])
def test_the_same_bits_in_all_forms_and_from_checkpoints(tmp_path, build, algorithm):
    text = SCENARIO.replace("ALGORITHM", algorithm)
    plain = run(text, tmp_path, build)
    for backend in Backend:
        assert_equal_bits(plain, run(text, tmp_path, build, backend))
        outcome = run_with_checkpoints(text, tmp_path, build, backend, every=23 * MS)
        assert_equal_bits(plain, outcome)
        for at in (46, 161, 230):
            other = continued(outcome, build, at * MS)
            assert_equal_bits(plain, other)
            assert occurrences(plain) == occurrences(other)


@pytest.mark.slow
def test_a_condition_ends_a_run(tmp_path, build):
    text = SCENARIO.replace("ALGORITHM", "jacobi").replace("    record:", STOP + "    record:")
    outcome = run(text, tmp_path, build)
    ends = [(seed, time) for seed, time, when in occurrences(outcome) if when.endswith("other.y < -0.03")]
    assert [seed for seed, _ in ends] == [1, 2]
    tables = read_signals(outcome.folder / "signals.parquet")[0]
    for (seed, end), ((_, other), signals) in zip(ends, tables.items(), strict=True):
        assert (seed, end) == (other, signals.time[-1])
        assert 0.2 <= end < 0.4
        assert signals.complete
    notes = "\n".join(outcome.summary["notes"])
    assert "`mass.y < -0.03 or other.y < -0.03` ended the run at" in notes
    assert notes.count(": far below") == 2
    assert outcome.run.status == "completed"


@pytest.mark.slow
@pytest.mark.parametrize("backend", Backend)
def test_types_units_elements_and_slow_members(tmp_path, build, backend):
    """A member with a period publishes late: y = t [s] in mm at its own points, 5 ms apart."""
    events = {
        "ramp.y >= 0": 0.0,
        "ramp.y > 21 mm": 0.025,
        "ramp.on": 0.03,
        "ramp.count == 9 and ramp.y < 1": 0.045,
        "ramp.p[3] > 0.059": 0.02,
        "norm(ramp.p) > 100 mm": 0.03,
        "ramp.p[2] - ramp.p[1] > 49e-3": 0.05,
    }
    lines = "".join(f"  - {{when: '{when}', override: {{'ramp.q[1]': 3}}}}\n" for when in events)
    text = f"stop_time: 0.1 s\nmembers: {{ramp: {{component: '{RAMP}', period: 5 ms}}, end: {{component: '{END}'}}}}\n"
    text += f"connections: [ramp.q -> end.q]\nevents:\n{lines}"
    outcome = run(text, tmp_path, build, backend)
    assert {when: time for _, time, when in occurrences(outcome)} == events


STUDY = """
scenario: scenario.yaml
samples: {method: latin_hypercube, count: 4, seed: 3}
vary:
  mass.gain: {uniform: [300, 500], source: assumed}
"""


@pytest.mark.slow
def test_a_study_runs_conditions_and_a_stop_is_no_failure(tmp_path, build):
    text = SCENARIO.replace("ALGORITHM", "jacobi").replace("    record:", STOP + "    record:")
    metrics = "    metrics: {last: {signal: mass.y, reduce: final}, top: {signal: other.y, reduce: max}}\n"
    study = load_study(study_file(tmp_path, STUDY, text + metrics))
    outcome = run_study(study, root=tmp_path / "runs", build=build, workers=1, report=False)
    rows = table(outcome).to_pylist()
    assert {row["status"] for row in rows} == {"done"}
    one = single(*resolve_case(f"{outcome.folder}:3", tmp_path))
    options = RunOptions(variants=[one.variant], seeds=[one.seed], root=tmp_path, build=build, report=False)
    ran = run_scenario(load_scenario(one.file, one.options), options)
    assert one.different(ran) == []
    assert len(ran.summary["conditions"]) > 3
