"""Cases that differ from a time on share the run until then; their results are those of whole runs, to the bit."""

import itertools
import re
import threading
from collections import defaultdict
from contextlib import closing
from dataclasses import replace

import pytest
from pyarrow import parquet

from tests.study import patients
from tests.study.patients import study_file
from twin.coupling import CoSimulation
from twin.errors import ScenarioError
from twin.fmi import fmu_cache
from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario
from twin.study import Answers, headline, load_study, resolve_case, run_study, single
from twin.study.answers.sentences import lowest_pass_rate
from twin.study.design import CommonPrefixes, StudyRequest, VariantInputs
from twin.study.execution import Engine, Job
from twin.study.execution.case_engine import Row
from twin.study.execution.case_table import CaseTable
from twin.study.execution.process_pool import Pool, Process

SCENARIO = """
step: 1 ms
stop_time: 0.3 s
members:
  heart:  {component: heart}
  wall:   {component: wall, parameters: {tip_position: -17 mm}}
  sensor: {component: force_sensor}
connections:
  - heart.position -> wall.heart_position
  - wall.force -> sensor.force
events:
  - {at: 50 ms, override: {heart.position: 5 mm}}
  - {at: 100 ms, release: [heart.position]}
  - {when: sensor.measured_force > 20 mN, set: {sensor.zero_offset: 1 mN}}
variants:
  plain: {}
  late: {events: [{at: 250 ms, set: {wall.tip_position: -12 mm}}]}
  soft: {members: {wall: {parameters: {wall_modulus: 50 kPa}}}}
record: {every: 5 ms, variables: [sensor.measured_force, wall.force]}
metrics:
  force_max: {signal: sensor.measured_force, reduce: max, unit: mN}
  force_end: {signal: wall.force, reduce: final, unit: mN}
"""
STUDY = """
scenario: scenario.yaml
samples: {method: grid, seeds: [1, 2]}
vary:
  heart.scale: {values: [0.8, 1.2], source: the test}
  wall.tip_position: {values: [-15 mm, -14 mm, -13 mm], at: 150 ms, source: the test}
  offset: {scales: wall.tip_position, values: [1, 0.9], at: 200 ms, source: the test}
keep: {bands: {force: sensor.measured_force}}
"""
MS = 1_000_000
PARTS = "tests.run.checkpoint_parts"


def study_of(folder, text=STUDY, scenario=SCENARIO):
    return load_study(study_file(folder, text, scenario))


def engine_of(study, build):
    bands = tuple((name, one.text) for name, one in study.bands.items())
    return Engine(Job(study.path.parent / "scenario.yaml", (), study.factors, bands, 50 * MS, build))


def results(row):
    return row.status, row.why, row.metrics, row.holds, row.bands


def spied(monkeypatch):
    """Return a list that grows by the steps of all cases that are run from now on."""
    steps, advance = [], CoSimulation.advance

    def counted(self, until, progress=None):
        before = self.time
        advance(self, until, progress)
        steps.append((self.time - before) // MS)

    monkeypatch.setattr(CoSimulation, "advance", counted)
    return steps


def rows_of(own, requests):
    """Results of cases by number, in this order."""
    return {request.number: results(own.row(request)) for request in requests}


def whole_rows(study, build, requests):
    """Results of cases that are run from their start."""
    own = engine_of(study, build)
    own.prefixes.times = ()
    with closing(own):
        return rows_of(own, requests)


def test_two_cases_share_what_they_have_in_common(tmp_path, build, monkeypatch):
    study = study_of(tmp_path, STUDY.replace("[0.8, 1.2]", "[1]").replace("-15 mm, ", "").replace("[1, 0.9]", "[1]"))
    requests = [request for request in study.requests() if request.variant == "soft" and request.seed == 1]
    with closing(engine_of(study, build)) as own:
        steps = spied(monkeypatch)
        shared = rows_of(own, requests)
    assert sum(steps) == 150 + 2 * 150
    assert shared == whole_rows(study, build, requests)
    assert len(set(shared.values())) == 2


@pytest.mark.slow
def test_cases_share_what_they_have_in_common_to_the_bit(tmp_path, build, monkeypatch):
    study = study_of(tmp_path)
    requests = list(study.requests())
    with closing(engine_of(study, build)) as own:
        assert own.prefixes.times == (150 * MS, 200 * MS, 250 * MS)
        inputs = {name: own.cell(name).inputs for name in study.variants}
        groups = list(own.prefixes.groups(requests, inputs))
        assert sorted(map(len, groups)) == [6] * 4 + [12] * 4  # of `plain` and `late` together, for each seed and scale
        steps = spied(monkeypatch)
        shared = rows_of(own, itertools.chain(*groups))
        # what cases have in common is computed once: to 150 ms, to 200 ms, to 250 ms of `plain` and `late`
        assert sum(steps) == 8 * 150 + 8 * 3 * 50 + 4 * 6 * 50 + 4 * 12 * 50 + 4 * 6 * 100
        assert rows_of(own, reversed(requests)) == shared
    assert whole_rows(study, build, requests) == shared
    assert len(set(shared.values())) == len(requests)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "is_shared"), [("fmu", True), ("isolated", True), ("python", False)])
def test_fmus_share_too_and_python_side_members_run_whole(tmp_path, build, monkeypatch, kind, is_shared):
    """Members that are made anew for each case; what cannot be saved is run from its start."""
    from tests.run.checkpoint_parts import Oscillator

    walk, mass = f'"{PARTS}:RandomWalk"', f'"{PARTS}:Oscillator"'
    if kind != "python":
        mass = f"{fmu_cache.build(Oscillator, '3.0', build)}, isolate: {str(kind == 'isolated').lower()}"
    remembers = f"other: {{component: '{PARTS}:Remembers'}}" if kind == "python" else ""
    scenario = f"""
stop_time: 0.1 s
members:
  walk: {{component: {walk}}}
  mass: {{component: {mass}}}
  {remembers}
connections: [walk.y -> mass.u]
metrics: {{y: {{signal: mass.y, reduce: final}}, far: {{signal: mass.y, reduce: max_abs}}}}
"""
    study = study_of(
        tmp_path,
        """
scenario: scenario.yaml
samples: {method: grid, seeds: [1, 2]}
vary: {mass.gain: {values: [100, 300, 900], at: 60 ms, source: the test}}
""",
        scenario,
    )
    requests = sorted(study.requests(), key=lambda request: request.seed)
    with closing(engine_of(study, build)) as own:
        steps = spied(monkeypatch)
        rows = rows_of(own, requests)
    assert sum(steps) == (2 * 60 + 6 * 40 if is_shared else 6 * 100)
    assert rows == whole_rows(study, build, requests)
    assert len(set(rows.values())) == len(requests)
    assert {row[0] for row in rows.values()} == {"done"}


@pytest.mark.parametrize(("old", "new", "count"), [("seeds: [1, 2]", "seeds: own", 24), ("at: 1", "from: 1", 48)])
def test_where_nothing_is_shared_requests_keep_their_order(tmp_path, old, new, count):
    """With a seed of its own for each sample, or where all factors take effect at the start."""
    text = re.sub(r", at: \d+ ms", "", STUDY) if "at" in old else STUDY.replace(old, new)
    study = study_of(tmp_path, text.replace("scenario.yaml", "scenario.yaml\nvariants: [plain, soft]"))
    cases = [case for case in study.scenario.variants if case.variant != "late"]
    inputs = {case.variant: VariantInputs(case, study.catalogs[case.variant], study.factors) for case in cases}
    groups = CommonPrefixes(cases, study.factors).groups(study.requests(), inputs)
    assert [[request.number for request in group] for group in groups] == [[n] for n in range(1, count + 1)]


def test_a_value_out_of_bounds_fails_its_case_alone(tmp_path, build):
    text = STUDY.replace("wall.tip_position: {values: [-15 mm, -14 mm, -13 mm]", "wall.gel_drag: {values: [0.05, 0.5]")
    study = study_of(
        tmp_path, text.replace("scales: wall.tip_position, values: [1, 0.9]", "scales: wall.gel_drag, values: [0.1, 1]")
    )
    first, second = list(study.requests())[:12:6]
    assert first.values[1:] == (0.05, 0.1)
    with closing(engine_of(study, build)) as own:
        inputs = {name: own.cell(name).inputs for name in study.variants}
        assert [first] in own.prefixes.groups([second, first], inputs)
        failed, done = own.row(first), own.row(second)
    assert failed.status == "failed"
    assert "gel_drag" in failed.why
    assert done.status == "done"


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        (
            "wall.tip_position: {values: [0 mm], at: 1 s",
            "wall.tip_position.at: event at 1 s is outside the run, 0 s to 300 ms.",
        ),
        ("wall.tip_position: {values: [0 mm], at: 1.5 ms", "event at 1.5 ms is no multiple of step 1 ms. Move it."),
        ("wall.force_of: {sets: wall.force, values: [0 N], at: 10 ms", "wall.force is no parameter"),
        (
            "wall.heart_position: {values: [0 mm], at: 10 ms",
            "wall.heart_position is connected and would be written over.",
        ),
        ("heart.wander: {values: [0.1], at: 10 ms", "heart.wander is fixed. Set it in members. Or leave `at` out."),
        (
            "tip: {scales: wall.tip_position, values: [2], at: 260 ms",
            "is changed by an event of the scenario before. Use `sets`.",
        ),
        ("wall.tip_position: {values: [0 mm], at: soon", "at: soon is not a time."),
    ],
)
def test_what_cannot_take_effect_at_a_time_is_refused(tmp_path, line, problem):
    with pytest.raises(ScenarioError) as error:
        study_of(tmp_path, f"scenario: scenario.yaml\nvary:\n  {line}, source: the test}}\n")
    (told,) = error.value.problems
    assert "patients.yaml:4: " in told or "patients.yaml:3: " in told
    assert problem in told


def test_processes_run_groups_and_take_half_of_what_others_have_left(monkeypatch):
    ran = defaultdict(list)
    both, has_taken = threading.Barrier(2, timeout=60.0), threading.Event()

    def row(self, request):
        ran[id(self)].append(request.number)
        if request.number in (1, 101):
            both.wait()
        if request.number > 132:
            has_taken.set()
        elif request.number > 101:
            assert has_taken.wait(60.0)
        return Row(request.number, "done", "", (), ())

    def grouped(requests):
        for _, members in itertools.groupby(requests, lambda request: request.number // 100):
            yield list(members)

    requests = [StudyRequest(n, "sample", n, "plain", 1, ()) for n in (*range(1, 10), *range(101, 164))]
    monkeypatch.setattr(Process, "row", row)
    with Pool(None, 2, 0, grouped=grouped) as pool:
        assert sorted(row.number for row in pool.run(requests)) == [request.number for request in requests]
    first, second = sorted(ran.values())
    assert first[:9] == list(range(1, 10))
    assert (first[9], second[:2]) == (133, [101, 102])  # the half behind it, in order: neighbors share most


@pytest.mark.slow
def test_a_study_in_processes_gives_what_runs_of_its_cases_give(tmp_path, build):
    study = study_of(tmp_path, STUDY.replace("[0.8, 1.2]", "[1]"))
    outcomes = [run_study(study, root=tmp_path / str(n), build=build, workers=n, report=n == 1) for n in (1, 2)]
    tables = [parquet.read_table(one.folder / "cases.parquet").drop_columns(["seconds"]) for one in outcomes]
    assert tables[0].equals(tables[1])
    folder = outcomes[0].folder
    assert "wall.tip_position at 150 ms" in (folder / "report.html").read_text()
    for number in (8, 29):
        case = single(*resolve_case(f"{folder}:{number}", tmp_path))
        assert list(case.events) == [150 * MS, 200 * MS]
        options = RunOptions(variants=[case.variant], seeds=[case.seed], root=tmp_path, build=build, report=False)
        ran = run_scenario(case.applied_to(load_scenario(case.file, case.options)), options)
        assert case.different(ran) == []
        again = load_scenario(ran.folder / "scenario.yaml")  # the run's own file has the events
        assert case.different(run_scenario(again, options)) == []


@pytest.mark.parametrize(("stop", "ends"), [("", "0.8 s"), ("stop", "1.5 s")])
def test_a_metric_whose_window_a_stopped_case_does_not_reach_has_no_value(tmp_path, build, stop, ends):
    """Neither if a condition stops it, nor if the stop time of the study is shorter."""
    metric = "early: {signal: heart.position, reduce: max_abs, from: 0.5 s, to: 1.2 s, unit: mm}"
    scenario = patients.SCENARIO.replace("metrics:\n", f"metrics:\n  {metric}\n")
    scenario = scenario.replace("  motion: {signal: heart.position, reduce: max_abs, from: 1 s, unit: mm}\n", "")
    scenario = scenario.replace("stop_time: 1.5 s", f"stop_time: {ends}")
    scenario += (
        "  - {name: rest, metric: early, at_most: 0 mm}\n  - {name: still, metric: early, ordered: [plain, soft]}\n"
    )
    if stop:
        scenario += "events: [{when: heart.position > -1 m, after: 0.8 s, stop: true}]\n"
    study = study_of(tmp_path, patients.STUDY, scenario)
    requests = list(study.requests())[:2]
    with closing(engine_of(study, build)) as own:
        rows = list(map(own.row, requests))
    assert [dict(zip(study.scenario.metrics, row.metrics, strict=True))["early"] for row in rows] == [None, None]
    assert [row.status for row in rows] == ["done", "done"]
    answers = Answers(CaseTable(study, requests, rows))
    is_judged = {rate.name for rate in answers.shares} >= {"rest", "still"}
    left_out = [(one["kind"], one["name"], one["why"]) for one in answers.plain()["left_out"]]
    told = [sentence.text for sentence in headline(answers) if sentence.topic == "Left out"]
    if ends == "1.5 s":  # of a stopped case what is broken stays broken
        assert (is_judged, left_out, told) == (bool(stop), [], [])
        return
    why = "the cases end at 800 ms, before the end of the window, 1.2 s"
    assert left_out == [("metric", "early", why), ("expectation", "rest", why), ("expectation", "still", why)]
    assert told == [f"Early has no value and rest and still are not judged: {why}."]
    assert not is_judged
    passing = Answers(CaseTable(study, requests, [replace(row, holds=(True, None, None, None)) for row in rows]))
    assert lowest_pass_rate(passing) == ("pass", "✓ every case passes, 2 requirements not judged")
    assert not any(spread.metric == "early" for spread in answers.spreads)
    assert not any(pair.metric == "early" for pair in answers.pairs)
