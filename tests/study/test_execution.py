"""What surrounds the cases of a study: journal, progress, processes that are lost, samples and verdicts."""

from __future__ import annotations

import base64
import io
import json
import pickle
import signal
from contextlib import closing, nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from pyarrow import parquet

from tests.study.patients import study_file
from twin.errors import ScenarioError
from twin.results import Signals, Window, expression
from twin.study import load_study
from twin.study.design import StudyRequest
from twin.study.execution import case_table
from twin.study.execution.case_engine import Engine, Job, Row, extreme_samples
from twin.study.execution.journal import StudyJournal
from twin.study.execution.process_pool import LostError, NotReadyError, Pool, Process, memory_of_each
from twin.study.execution.progress import ProgressReporter, TimeEstimate, progress_text
from twin.study.execution.study_runner import PendingCases
from twin.study.execution.worker import NO_MEMORY, serve


def request(number):
    return StudyRequest(number, "sample", number, "plain", 1, (1.0,))


def text_of(*values):
    return base64.b64encode(np.array(values, np.float32).tobytes()).decode()


def test_a_journal_goes_on_after_half_a_line(tmp_path):
    rows = [
        Row(2, "done", "", (1.5, None), (True, None), 0.5, (text_of(1.0, 2.0),), 1),
        Row(1, "failed", "lost", (), (), 0.25, (), 2),
    ]
    with StudyJournal(tmp_path) as journal:
        for row in rows:
            journal.add(row)
    path = tmp_path / "cases.jsonl"
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"number": 3, "sta')
    with StudyJournal(tmp_path) as journal:
        assert list(journal.rows) == [2, 1]
        assert journal.rows[1] == rows[1]
        assert journal.rows[2] == Row(2, "done", "", (1.5, None), (True, None), 0.5, (), 1)  # samples stay in the file
        assert path.read_bytes() == whole
        journal.add(Row(3, "done", "", (2.0, 1.0), (True, True), 0.1, (text_of(3.0),)))
        assert list(journal.bands()) == [(1, ()), (2, (text_of(1.0, 2.0),)), (3, (text_of(3.0),))]
    case_table.write_bands(tmp_path, ["force"], journal)
    assert parquet.read_table(tmp_path / "bands.parquet").to_pylist() == [
        {"case": 1, "force": None},
        {"case": 2, "force": [1.0, 2.0]},
        {"case": 3, "force": [3.0]},
    ]
    path.write_bytes(whole + b'{"number": 3}\n')
    with pytest.raises(ScenarioError, match=r"cases\.jsonl: is damaged\. Remove the folder"):
        StudyJournal(tmp_path)


def test_a_row_is_written_whole_where_a_disk_takes_a_part_of_it(tmp_path):
    journal = StudyJournal(tmp_path)
    real, parts = journal._file, []

    def write(data):
        parts.append(bytes(data[:10]))
        return real.write(data[:10])

    journal._file = SimpleNamespace(write=write)
    for number in (1, 2):
        journal.add(Row(number, "done", "", (), ()))
    real.close()
    assert b"".join(parts) == (tmp_path / "cases.jsonl").read_bytes()
    assert [json.loads(line)["number"] for line in b"".join(parts).splitlines()] == [1, 2]
    assert [number for number, _ in journal.bands()] == [1, 2]


def test_bands_are_written_in_chunks(tmp_path, monkeypatch):
    monkeypatch.setattr(case_table, "CHUNK", 2)
    journal = SimpleNamespace(bands=lambda: ((n, (text_of(n),)) for n in range(1, 6)))
    case_table.write_bands(tmp_path, ["force"], journal)
    rows = parquet.read_table(tmp_path / "bands.parquet").to_pylist()
    assert rows == [{"case": n, "force": [float(n)]} for n in range(1, 6)]
    assert parquet.read_metadata(tmp_path / "bands.parquet").num_row_groups == 3


def test_progress_counts_and_estimates_what_is_left(monkeypatch):
    """The rate is that between cases: what precedes the first, such as building, does not count."""
    times = iter([100.0, 102.0, 104.0])
    monkeypatch.setattr("twin.study.execution.progress.time.perf_counter", lambda: next(times))
    journal, seen = SimpleNamespace(rows={1: Row(1, "failed", "", (), ()), 2: Row(2, "done", "", (), ())}), []
    reporter = ProgressReporter(journal, 6, seen.append)
    for number, status in ((3, "done"), (4, "failed"), (7, "done")):
        journal.rows[number] = row = Row(number, status, "", (), (number != 7, None))
        reporter.take(row)
    assert [(one.part, one.done, one.count, one.failed, one.missed) for one in seen] == [
        ("sample", 3, 6, 1, 0),
        ("sample", 4, 6, 2, 0),
        ("sample", 5, 6, 2, 1),
    ]
    assert all(np.isnan(one.left) for one in seen[:2])
    assert (seen[2].rate, seen[2].left) == (0.5, pytest.approx(2.0, abs=0.5))


def test_the_rate_follows_the_latest_cases(monkeypatch):
    """Cases of a tuning take another time than those before."""
    times = iter([*np.arange(100.0, 200.0, 1.0), *np.arange(200.0, 300.0, 2.0)])
    monkeypatch.setattr("twin.study.execution.progress.time.perf_counter", lambda: next(times))
    rates = []
    reporter = ProgressReporter(SimpleNamespace(rows={}), 150, lambda progress: rates.append(progress.rate))
    for number in range(150):
        reporter.take(Row(number, "done", "", (), ()))
    assert (rates[90], rates[149]) == (1.0, 0.5)


def test_first_cases_that_come_at_once_give_no_rate(monkeypatch):
    times = iter([100.0, 100.1, 100.2, 100.3, 102.0])
    monkeypatch.setattr("twin.study.execution.progress.time.perf_counter", lambda: next(times))
    rates = []
    reporter = ProgressReporter(SimpleNamespace(rows={}), 9, lambda progress: rates.append(progress.rate))
    for number in range(5):
        reporter.take(Row(number, "done", "", (), (), seconds=2.0))
    assert np.isnan(rates[:4]).all()
    assert rates[4] == 2.0


def test_the_time_of_a_study():
    estimate = TimeEstimate({"PI": 100, "FF": 50}, {"PI": 0.1, "FF": 0.4}, 5.0, 2)
    assert estimate.cases == (10.0 + 20.0) / 2


def test_time_and_bar_include_what_follows_the_last_case(monkeypatch):
    """The bar was full while cases were kept and plots drawn, which took longer than the cases."""
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr("twin.study.execution.progress.time.perf_counter", lambda: clock.now)
    monkeypatch.setattr("twin.study.execution.progress.time.monotonic", lambda: clock.now)
    journal, seen = SimpleNamespace(rows={}), []
    reporter = ProgressReporter(journal, 6, seen.append)
    reporter.finishing = lambda failing, seconds: 10.0 + failing
    reporter.update_build("building heart (1 of 2)", 0.5)
    for number in range(1, 7):
        clock.now = 10.0 + number
        journal.rows[number] = row = Row(number, "done", "", (), (number != 6,))
        reporter.take(row)
    clock.now += 2.0
    reporter.update("keeping case 6 (1 of 1)")
    assert [round(one.fraction, 2) for one in seen] == [0.05, 0.05, 0.05, 0.5, 0.54, 0.58, 0.59, 0.67]
    assert [one.left for one in seen[-3:]] == [11.0, 11.0, 9.0]
    assert progress_text(seen[-1]) == "6 of 6 cases, 9 s left; keeping case 6 (1 of 1)"


@pytest.mark.parametrize(("error", "ends"), [(OSError("closed"), False), (BrokenPipeError(), True)])
def test_a_terminal_that_is_gone_does_not_end_a_study(error, ends):
    def listen(_):
        raise error

    reporter = ProgressReporter(SimpleNamespace(rows={}), 0, listen)
    with pytest.raises(BrokenPipeError) if ends else nullcontext():
        reporter.take(Row(1, "done", "", (), ()))


def test_only_what_the_journal_lacks_is_run(tmp_path):
    ran = []

    def run(requests):
        for one in reversed(list(requests)):
            ran.append(one.number)
            yield Row(one.number, "done", "", (float(one.number),), ())

    with StudyJournal(tmp_path) as journal:
        journal.add(Row(2, "done", "", (20.0,), ()))
        reporter = ProgressReporter(journal, 3, lambda _: None)
        cases = PendingCases(SimpleNamespace(run=run), journal, reporter, SimpleNamespace(armed=nullcontext))
        rows = cases.run(iter([request(1), request(2), request(3)]), "worst")
        assert [row.metrics for row in rows] == [(1.0,), (20.0,), (3.0,)]
        assert ran == [3, 1]
        assert reporter.part == "worst"
        assert [one.number for one in cases.requests] == [1, 2, 3]
        assert cases.completed_row(request(3)).metrics == (3.0,)


@pytest.fixture
def own():
    """A process that is not started."""
    with closing(Process(SimpleNamespace(), 2_000_000_000)) as process:
        yield process


def test_time_limits_of_cases(own):
    assert own.time_limit == 600.0  # the first one builds
    own._longest = 2.9
    assert own.time_limit == 60.0
    own._longest = 3.5
    assert own.time_limit == 70.0
    own.timeout = 5.0
    assert own.time_limit == 5.0


@pytest.mark.parametrize(
    ("code", "hung", "said", "told"),
    [
        (1, True, b"", "hung: no end of the case within 7.5 s"),
        (NO_MEMORY, False, b"MemoryError", "ran out of memory (2 GB)"),
        (3, False, b"first\n  last word \n\n", "its process ended with exit code 3: last word"),
        (3, False, b"", "its process ended with exit code 3"),
        (0, False, b"x" * 500, "its process ended with exit code 0: " + "x" * 400),
        (-signal.SIGKILL, False, b"gone\n", "its process was killed by SIGKILL: gone"),
        (-250, False, b"", "its process ended with exit code -250"),
    ],
)
def test_how_a_process_ended(own, code, hung, said, told):
    closed = []
    pipe = SimpleNamespace(close=lambda: closed.append(1))
    own._process, own._hung = SimpleNamespace(wait=lambda: code, stdin=pipe, stdout=pipe), hung
    own._said.write(said)
    assert own._ended(7.5) == told
    assert own._process is None
    assert closed == [1, 1]


def lose(own, losses, monkeypatch):
    """Let a process be lost so many times before it runs its case; what is left of them."""
    left = [losses]

    def run_request(one):
        left[0] -= 1
        if left[0] >= 0:
            raise LostError(f"gone {losses - left[0]}")
        return Row(one.number, "done", "", (), ())

    monkeypatch.setattr(own, "run_request", run_request)
    return left


@pytest.mark.parametrize(
    ("losses", "status", "why", "tries"),
    [(0, "done", "", 1), (1, "done", "", 2), (2, "failed", "lost 2 times, last: gone 2", 2)],
)
def test_a_case_is_tried_twice(own, monkeypatch, losses, status, why, tries):
    lose(own, losses, monkeypatch)
    row = own.row(request(5))
    assert (row.number, row.status, row.why, row.tries) == (5, status, why, tries)


def test_a_case_of_a_closed_process_is_not_tried_again(own, monkeypatch):
    left = lose(own, 1, monkeypatch)
    own.stop()
    assert own.row(request(5)).status == "failed"
    assert left == [0]


def test_a_pool_takes_few_requests_ahead(monkeypatch):
    taken, ran = [], []

    def requests():
        for number in range(1, 12):
            taken.append(number)
            yield request(number)

    def row(self, one):
        ran.append(one.number)
        return Row(one.number, "done", "", (), ())

    monkeypatch.setattr(Process, "row", row)
    with Pool(SimpleNamespace(), 2, 0) as pool:
        rows = pool.run(requests())
        numbers = [next(rows).number]
        assert taken == [1, 2, 3, 4]  # two for each process
        numbers.append(next(rows).number)
        assert taken == [1, 2, 3, 4, 5]
        numbers += [one.number for one in rows]
        assert sorted(numbers) == sorted(ran) == list(range(1, 12))
        assert list(pool.run(iter(()))) == []
    pool.close()  # twice does no harm


def test_what_no_process_can_begin_ends_the_pool(monkeypatch):
    def row(*_):
        raise NotReadyError("no such file")

    monkeypatch.setattr(Process, "row", row)
    with Pool(SimpleNamespace(), 1, 0) as pool, pytest.raises(NotReadyError, match="no such file"):
        list(pool.run(iter([request(1)])))


def test_memory_is_shared_by_the_processes(monkeypatch):
    monkeypatch.setattr("os.sysconf", {"SC_PHYS_PAGES": 1000, "SC_PAGE_SIZE": 4096}.get)
    assert memory_of_each(3) == int(0.9 * 1000 * 4096 / 3)
    monkeypatch.delattr("os.sysconf")
    assert memory_of_each(3) == 0


@pytest.mark.parametrize("wrong", [False, True])
def test_a_worker_answers_its_job_and_each_request(tmp_path, build, wrong):
    (tmp_path / "one.yaml").write_text("stop_time: 10 ms\nmembers: {heart: {component: heart}}\n")
    job = Job(tmp_path / ("two.yaml" if wrong else "one.yaml"), (), (), (), 1_000_000, build)
    unknown = StudyRequest(7, "sample", 1, "base", 1, ())
    given, answers = io.BytesIO(pickle.dumps((job, 0)) + (b"" if wrong else pickle.dumps(unknown))), io.BytesIO()
    serve(given, answers)
    answers.seek(0)
    trouble = pickle.load(answers)
    assert bool(trouble) is wrong
    if wrong:
        assert "two.yaml: cannot be read" in trouble
        return
    row = pickle.load(answers)
    assert (row.number, row.status, row.metrics, row.holds) == (7, "done", (), ())
    assert 0.0 < row.seconds < 600.0
    assert answers.read() == b""


def engine(folder, build):
    study = load_study(study_file(folder))
    return Engine(
        Job(folder / "scenario.yaml", (), study.factors, (("force", "sensor.measured_force"),), 50_000_000, build)
    )


def recorded(time, values):
    signals = {"sensor.measured_force": values, "heart.position": np.zeros(len(time))}
    return Signals(np.asarray(time), signals, {"sensor.measured_force": "N", "heart.position": "m"})


@pytest.mark.parametrize(
    ("time", "samples"),
    [
        (np.arange(11) * 0.02, [0.0, 0.06, 0.1, 0.16, 0.2]),  # the next recorded value
        (np.arange(3) * 0.05, [0.0, 0.05, 0.1]),
        (0.01 + np.arange(4) * 0.05, [0.06, 0.11, 0.16]),  # from the first multiple of the period
        (np.array([0.0, 0.049]), [0.0]),
    ],
)
def test_samples_of_a_signal_are_at_multiples_of_the_period(tmp_path, build, time, samples):
    own = engine(tmp_path, build)
    text = own.sampled(expression.parse("sensor.measured_force"), recorded(time, np.asarray(time)))
    np.testing.assert_array_equal(case_table.decoded(text), np.array(samples, np.float32))
    assert own.sampled(expression.parse("sensor.nothing"), recorded(time, np.asarray(time))) == ""


def test_the_extremes_of_the_signal_of_an_expectation_are_stored():
    """In its window; none of an expectation of a metric, and none without a finite sample."""
    force = expression.parse("sensor.force")
    signals = Signals(np.array([0.0, 1.0, 2.0]), {"sensor.force": np.array([9.0, 0.1, 0.4])})
    of_signal = SimpleNamespace(signal=force, window=Window(1_000_000_000, None))
    assert extreme_samples(signals, of_signal) == (0.1, 0.4)
    assert extreme_samples(signals, SimpleNamespace(signal=None)) is None
    assert extreme_samples(signals, SimpleNamespace(signal=expression.parse("other.x"))) is None
    signals.values["sensor.force"][2] = np.nan
    assert extreme_samples(signals, of_signal) is None


def test_a_case_is_judged_by_metrics_and_the_expectations_that_it_has_alone(tmp_path, build):
    own = engine(tmp_path, build)
    time = np.arange(0.0, 1.5, 0.005)
    row = own.judged(
        StudyRequest(3, "sample", 1, "plain", 1, ()), recorded(time, 0.05 + 0.02 * (time > 1.0)), "done", ""
    )
    assert (row.number, row.status, row.why) == (3, "done", "")
    assert row.metrics == (0.07, 0.0)
    assert row.holds == (True, None)  # the order of variants is none of a case
    assert case_table.decoded(row.bands[0])[[0, -1]] == pytest.approx([0.05, 0.07])
    high = own.judged(StudyRequest(3, "sample", 1, "soft", 1, ()), recorded(time, 0.1 + 0.0 * time), "done", "")
    assert high.holds == (False, None)
    assert high.why.startswith("gentle: ")
    early = own.judged(StudyRequest(3, "sample", 1, "plain", 1, ()), recorded(time[:150], 0.0 * time[:150]), "done", "")
    assert (early.metrics[1], early.why) == (None, "Without a value: motion (no finite sample in their window).")
    lost = own.judged(StudyRequest(3, "sample", 1, "plain", 1, ()), None, "failed", "why")
    assert (lost.metrics, lost.holds, lost.why) == ((None, None), (False, None), "why")
