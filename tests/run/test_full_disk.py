"""A disk that becomes full while a run goes on: what was recorded is kept, and the cause is told as it was."""

import json
import sys
from contextlib import contextmanager

import pytest

from twin.errors import SimulationError
from twin.files import write_atomically
from twin.results import Journal
from twin.results.recording import stream
from twin.run import RunCallbacks, RunOptions, recover, run_scenario
from twin.scenario import Backend, parse_scenario

resource = pytest.importorskip("resource")
CLOCK = "{stop_time: 2000 s, members: {rail: {component: chirp}}}"


@pytest.fixture(autouse=True)
def no_bytecode(monkeypatch):
    """Modules imported while files are limited would be cached truncated, for all later processes."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)


@contextmanager
def files_up_to(size):
    """No file gets larger: what a full disk does, for this process alone."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_file_is_there_whole_or_not_at_all(tmp_path):
    path = tmp_path / "a.txt"
    write_atomically(path, "before")
    with files_up_to(10), pytest.raises(OSError, match="File too large") as caught:
        write_atomically(path, b"x" * 100)
    assert caught.value.filename == str(path)
    assert [(one.name, one.read_text()) for one in tmp_path.iterdir()] == [("a.txt", "before")]


def test_no_half_line_stays_in_a_journal(tmp_path):
    journal = Journal(tmp_path)
    journal.create({"cases": []}, "1-2")
    file = tmp_path / ".recording" / "journal.jsonl"
    before = file.read_bytes()
    with files_up_to(len(before) + 10):
        journal.append_line(end=0, failure="a, seed 1: the disk is full.")
        assert file.read_bytes() == before
    assert journal.error is not None
    assert stream.read_failure_reason(tmp_path) == "a, seed 1: the disk is full."
    journal.append_line(start=1)
    assert [*map(json.loads, file.read_text().splitlines())][-1] == {"start": 1}


def test_nothing_stays_of_a_run_that_cannot_begin(tmp_path, build):
    scenario = parse_scenario(CLOCK, tmp_path / "s.yaml")
    with files_up_to(300), pytest.raises(OSError, match="File too large") as caught:
        run_scenario(scenario, RunOptions(backend=Backend.compiled, root=tmp_path / "runs", build=build))
    assert caught.value.filename.startswith(str(tmp_path / "runs" / "s"))
    assert [*tmp_path.glob("runs/s/2*")] == []


def test_a_full_disk_is_not_taken_for_a_kill(tmp_path, build):
    scenario = parse_scenario(CLOCK, tmp_path / "s.yaml")
    limits = []

    def progress(_case, _part):
        if (found := [*tmp_path.glob("runs/s/*/.recording/0.rows")]) and not limits:
            limits.append(files_up_to(found[0].with_name("journal.jsonl").stat().st_size + 10))
            limits[0].__enter__()

    try:
        with pytest.raises(SimulationError, match="cannot be finished") as caught:
            run_scenario(
                scenario,
                RunOptions(backend=Backend.compiled, root=tmp_path / "runs", build=build, report=False),
                callbacks=RunCallbacks(progress=progress),
            )
    finally:
        limits[0].__exit__(None, None, None)
    assert "cannot go on (File too large)" in str(caught.value)
    (folder,) = tmp_path.glob("runs/s/2*")
    outcome = recover(folder, report=False)
    assert outcome.run.reason.startswith("base, seed 0: the recording ")
    assert "cannot go on (File too large)" in outcome.run.reason
    assert "SIGKILL" not in outcome.run.reason
    assert len(outcome.tables["base", 0].time) > 10
