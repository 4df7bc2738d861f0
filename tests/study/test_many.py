"""Many cases: the same bits whoever runs them, in which order, and after whatever happens on the way."""

import os
from dataclasses import replace

import numpy as np
import pytest
from pyarrow import parquet

from tests.study.patients import FATAL, STUDY, study_file
from twin.errors import ScenarioError
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, load_scenario
from twin.study import load_study, resolve_case, run_study, single
from twin.study.design import StudyRequest
from twin.study.execution import Engine, Job
from twin.study.execution.process_pool import Process

CHANGING = ("seconds", "tries")


def table(outcome):
    return parquet.read_table(outcome.folder / "cases.parquet").drop_columns(list(CHANGING))


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return load_study(study_file(tmp_path_factory.mktemp("study")))


@pytest.fixture(scope="module")
def outcome(study, build, tmp_path_factory):
    return run_study(study, root=tmp_path_factory.mktemp("runs"), build=build, workers=2, report=False)


def engine(study, outcome, build):
    frozen = next(outcome.folder.glob("*_of_study.yaml"))
    return Engine(Job(frozen, (), study.all_factors, (), 50_000_000, build))


@pytest.mark.slow
def test_every_sample_meets_every_variant(study, outcome):
    found = table(outcome)
    assert found.num_rows == 12 == study.count
    assert found["case"].to_pylist() == list(range(1, 13))
    assert found["variant"].to_pylist() == ["plain", "soft"] * 6
    rates = found["heart.rate"].to_pylist()
    assert rates[::2] == rates[1::2]
    assert len(set(found["seed"].to_pylist())) == 6
    assert set(found["status"].to_pylist()) == {"done"}


@pytest.mark.slow
def test_a_case_is_what_a_run_of_it_is_to_the_bit(study, outcome, build, tmp_path):
    row = table(outcome).to_pylist()[8]
    one = single(*resolve_case(f"{outcome.folder}:9", tmp_path))
    ran = run_scenario(
        load_scenario(one.file, one.options),
        RunOptions(
            backend=Backend.fmu, variants=[one.variant], seeds=[one.seed], root=tmp_path, build=build, report=False
        ),
    )
    assert one.different(ran) == []
    assert {figure.metric.name: figure.values[one.seed] for figure in ran.evaluation.metric_results} == {
        name: row[name] for name in study.scenario.metrics
    }


@pytest.mark.slow
def test_a_case_does_not_see_those_before_it(study, outcome, build):
    """In another order, in this process: members go back entirely."""
    own = engine(study, outcome, build)
    try:
        rows = {request.number: own.row(request) for request in reversed(list(study.requests()))}
        assert own.cell("plain")._first is not None
    finally:
        own.close()
    for i, name in enumerate(study.scenario.metrics):
        assert [rows[n].metrics[i] for n in range(1, 13)] == table(outcome)[name].to_pylist()


@pytest.mark.slow
def test_the_number_of_workers_changes_nothing(study, outcome, build, tmp_path):
    other = run_study(study, root=tmp_path, build=build, workers=1, report=False)
    assert table(other).equals(table(outcome))
    bands = [parquet.read_table(one.folder / "bands.parquet") for one in (other, outcome)]
    assert bands[0].equals(bands[1])
    assert len(bands[0]["force"][0]) == 31


@pytest.mark.slow
def test_what_is_interrupted_goes_on(study, outcome, build, tmp_path):
    seen = []

    def stop(progress):
        is_first = progress.done == 5 and all(before.done < 5 for before in seen)  # a second one would end at once
        seen.append(progress)
        if is_first:
            raise KeyboardInterrupt

    first = run_study(study, root=tmp_path, build=build, workers=1, listen=stop, report=False)
    assert first.status == "interrupted"
    kept = table(first).num_rows
    assert 5 <= kept < 12
    assert seen[-1].left > 0.0
    journal = first.folder / "cases.jsonl"
    journal.write_bytes(journal.read_bytes() + b'{"number": 9, "sta')  # as a power cut leaves it
    second = run_study(study, build=build, workers=1, resume=first.folder, report=False)
    assert second.before == kept
    assert table(second).equals(table(outcome))
    assert not journal.exists()


@pytest.mark.slow
def test_what_has_changed_does_not_go_on(study, outcome, build):
    changed = replace(study, keys=study.keys.model_copy(update={"confidence": 0.9}))
    with pytest.raises(ScenarioError, match="study file changed"):
        run_study(changed, build=build, resume=outcome.folder)


def job_of(folder, build):
    (folder / "fatal.yaml").write_text(FATAL)
    text = "scenario: fatal.yaml\nvary:\n  one.way: {values: [0, 1, 2, 3], source: the test}\n"
    text += "  one.once: {values: [0, 1], source: the test}\nsamples: {method: grid}\n"
    (folder / "lost.yaml").write_text(text)
    study = load_study(folder / "lost.yaml")
    return Job(folder / "fatal.yaml", (), study.factors, (), 1_000_000, build)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("way", "told"),
    [
        (1.0, "killed by SIGKILL"),
        pytest.param(2.0, "hung: no end of the case within", marks=pytest.mark.slow),
        pytest.param(3.0, "out of memory", marks=pytest.mark.slow),
    ],
)
def test_a_lost_process_costs_its_case_a_retry(tmp_path, build, monkeypatch, way, told):
    if not hasattr(os, "fork"):
        pytest.skip("no signals here")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    process = Process(job_of(tmp_path, build), 4_000_000_000, 0.0)
    try:
        good = process.row(StudyRequest(1, "sample", 1, "base", 1, (0.0, 0.0)))
        process.timeout = 30.0 if way != 2.0 else 2.0
        again = process.row(StudyRequest(2, "sample", 2, "base", 1, (way, 1.0)))
        lost = process.row(StudyRequest(3, "sample", 3, "base", 1, (way, 0.0))) if way == 1.0 else None
        with pytest.raises(Exception, match=told):  # what the first try said
            process.run_request(StudyRequest(4, "sample", 4, "base", 1, (way, 0.0)))
    finally:
        process.close()
    assert (good.metrics, good.tries) == ((0.0,), 1)
    assert (again.metrics, again.tries, again.status) == ((2 * way,), 2, "done")
    if lost is not None:
        assert (lost.status, lost.tries) == ("failed", 2)
        assert told in lost.why


@pytest.mark.slow
def test_what_no_process_can_begin_is_told_once(tmp_path, build):
    process = Process(replace(job_of(tmp_path, build), scenario=tmp_path / "none.yaml"), 0)
    try:
        with pytest.raises(ScenarioError, match=r"none\.yaml: cannot be read"):
            process.row(StudyRequest(1, "sample", 1, "base", 1, ()))
    finally:
        process.close()


SEARCHED = (
    STUDY.replace("count: 6", "count: 4").replace("\nkeep:", "\nvariants: [plain]\nkeep:")
    + """
worst: {metric: force_max, evaluations: 48, inside: 90 %}
tune:
  knobs: {wall.free_length: {from: 40 mm, to: 60 mm}}
  metric: force_max
  of: max
  limits: [{metric: force_max, of: min, at_least: 15 mN}]
  trials: 12
"""
)


@pytest.mark.slow
def test_the_worst_case_is_worse_than_by_chance_and_the_tuned_better(build, tmp_path):
    study = load_study(study_file(tmp_path, SEARCHED))
    found = run_study(study, root=tmp_path, build=build, workers=2)
    worst, tuned = found.worst, found.tuned
    assert worst.value > worst.sampled
    scale = worst.values[1]
    assert scale == pytest.approx(1.45, abs=0.03)  # the largest motion within 90 %
    assert tuned.best.is_feasible
    assert tuned.best.objective < tuned.trials[0].objective
    assert tuned.unseen[1].objective < tuned.unseen[0].objective
    page = (found.folder / "report.html").read_text()
    assert "Worst case found by search" in page
    assert "Tuned:" in page
    cases = parquet.read_table(found.folder / "cases.parquet")
    assert cases["case"].to_pylist() == list(range(1, cases.num_rows + 1))
    # a case of the tuning again: knobs are told too
    number = cases.num_rows
    one = single(found.folder, number)
    assert any(option.startswith("wall.free_length=") for option in one.options)
    assert np.isfinite(one.row["wall.free_length"])
