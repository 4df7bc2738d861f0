"""A study and an identification that are interrupted, at any moment and several times: what was done is kept and goes on."""

import importlib
import json
import re
import signal
import sys
import threading

import numpy as np
import pytest
from pyarrow import parquet

from tests.study.patients import SCENARIO, STUDY, study_file
from tests.study.recordings import FILE, identify_file, recorded
from twin.errors import SimulationError
from twin.identify import identify, load
from twin.study import load_study, run_study
from twin.study.execution import study_runner


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return load_study(study_file(tmp_path_factory.mktemp("study")))


@pytest.fixture(autouse=True)
def interruptible():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
    yield
    signal.signal(signal.SIGINT, before)


def impatient():
    """Several signals one after the other: the first may interrupt."""
    for _ in range(3):
        signal.raise_signal(signal.SIGINT)


def test_before_the_first_case(study, build, tmp_path, monkeypatch):
    build_job = study_runner.build_job
    with monkeypatch.context() as patch:
        patch.setattr(study_runner, "build_job", lambda *given: (impatient(), build_job(*given)))
        outcome = run_study(study, root=tmp_path, build=build, workers=1)
    assert (outcome.status, outcome.cases.rows) == ("interrupted", [])
    assert outcome.cases.values.shape == (0, 3)
    manifest = json.loads((outcome.folder / "manifest.json").read_text())
    assert (manifest["status"], manifest["done"]) == ("interrupted", 0)
    assert not [*outcome.folder.glob(".*")]


@pytest.mark.slow
def test_a_study_is_watched_while_it_runs(study, build, tmp_path, monkeypatch):
    monkeypatch.setattr(study_runner, "REPORT_PERIOD", 0.0)
    monkeypatch.setattr(study_runner, "REPORT_SHARE", 1e3)
    seen = []

    def listen(progress):
        page = progress.folder / "report.html"  # from the first second: it was there after 15 s, or the last case
        seen.append((progress.done, page.read_text(), progress.folder))

    outcome = run_study(study, root=tmp_path, build=build, workers=1, listen=listen)
    pattern = rf"As of [\d:]+, (\d+) of {study.count} cases[.:]"
    assert seen[0][0] == 0
    assert f"0 of {study.count} cases: starting." in seen[0][1]
    done, text, folder = next(each for each in seen if each[0] > 1)
    assert 0 < int(re.search(pattern, text)[1]) <= done
    assert any(re.search(pattern, page) and re.search(pattern, page)[1] == "12" for _, page, _ in seen)  # the last one
    assert 'http-equiv="refresh"' in text
    assert f"twin run --case {folder}:" in text
    final = (outcome.folder / "report.html").read_text()
    assert not re.search(pattern, final)
    assert 'http-equiv="refresh"' not in final
    assert json.loads((folder / "manifest.json").read_text())["status"] == "completed"


@pytest.mark.slow
def test_while_cases_run(study, build, tmp_path):
    at = []

    def listen(progress):
        at.append(progress.done)
        if progress.done == 3:
            impatient()

    outcome = run_study(study, root=tmp_path, build=build, workers=1, listen=listen, report=False)
    assert (at[-1], outcome.status) == (3, "interrupted")
    assert parquet.read_table(outcome.folder / "cases.parquet").num_rows == 3
    outcome = run_study(study, build=build, workers=1, resume=outcome.folder, report=False)
    assert (outcome.before, len(outcome.cases.rows), outcome.status) == (3, 12, "completed")
    told = json.loads((outcome.folder / "manifest.json").read_text())
    assert told["seconds"] == outcome.seconds_before + outcome.seconds > outcome.seconds  # of both commands


@pytest.mark.slow
# Interrupted just after `open`, a file is closed by garbage collection.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_while_runs_are_kept(build, tmp_path, monkeypatch):
    """All cases are done: the study goes on with the runs that it has not kept yet."""
    text = STUDY.replace("keep: {", "keep: {failed: 6, ")
    study = load_study(study_file(tmp_path, text, SCENARIO.replace("at_most: 90 mN", "at_most: 1 mN")))
    module = importlib.import_module("twin.study.execution.stored_case")  # the package has a function of that name
    repeat, numbers = module.repeat, []

    def interrupted(folder, number, **more):
        numbers.append(number)
        if len(numbers) == 2:
            threading.Timer(0.02, signal.pthread_kill, [threading.get_ident(), signal.SIGINT]).start()
        return repeat(folder, number, **more)

    with monkeypatch.context() as patch:
        patch.setattr(module, "repeat", interrupted)
        first = run_study(study, root=tmp_path, build=build, workers=1)
    assert first.status == "interrupted"
    assert (first.folder / "report.html").exists()
    assert json.loads((first.folder / "manifest.json").read_text())["status"] == "interrupted"
    outcome = run_study(study, build=build, workers=1, resume=first.folder)
    assert (outcome.before, outcome.status) == (12, "completed")
    assert len(outcome.runs) > len(first.runs) >= 1
    assert {*first.runs.items()} <= {*outcome.runs.items()}, "what was kept before is not run again"
    assert not (outcome.folder / "cases.jsonl").exists()


@pytest.mark.slow
def test_a_terminal_that_is_gone_ends_no_study(study, build, tmp_path):
    def listen(_progress):
        raise OSError(5, "Input/output error")

    outcome = run_study(study, root=tmp_path, build=build, workers=1, listen=listen, report=False)
    assert outcome.status == "completed"


@pytest.mark.slow
def test_a_full_disk_says_what_is_kept(study, build, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # a module imported at the limit would be cached truncated
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)

    def listen(progress):
        if progress.done == 4:
            size = next(tmp_path.glob("*/*/cases.jsonl")).stat().st_size
            resource.setrlimit(resource.RLIMIT_FSIZE, (size + 10, hard))

    try:
        with pytest.raises(SimulationError) as caught:
            run_study(study, root=tmp_path, build=build, workers=1, listen=listen, report=False)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    (folder,) = tmp_path.glob("*/*")
    assert str(caught.value) == (
        f"{folder}: cannot be written (File too large). 4 cases are kept: free some space, then go on with --resume."
    )
    outcome = run_study(study, build=build, workers=1, resume=folder, report=False)
    assert (outcome.before, len(outcome.cases.rows), outcome.status) == (4, 12, "completed")


@pytest.mark.slow
@pytest.mark.parametrize("what", ["start 2 of 3", "noise", "covariance"])
def test_an_identification_keeps_the_best(tmp_path, build, what):
    recorded(tmp_path, build, "sheath.play=[0 mm, 0.7 mm, 0.3 mm]")
    problem = load(identify_file(tmp_path, FILE))
    told = []

    def progress(now, _part, _best):
        told.append(now)
        if now.startswith(what):
            impatient()

    result = identify(problem, starts=3, seed=1, build=build, progress=progress)
    assert any(one.startswith(what) for one in told)
    assert result.fit.interrupted
    assert np.isfinite(result.values).all()
    assert result.text(tmp_path)
