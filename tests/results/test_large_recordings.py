"""Rows of a recording that is read in slices, and what is known of a run that was killed."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from twin.process import CrashReport, process_identity
from twin.results import Signals, Window
from twin.results.evaluation import expression
from twin.results.recording import rows, stream

COUNT = 23
WIDTH = 5  # tick, two words of a vector, a Boolean, an unsigned integer
LAYOUT = {
    "begin": 4,
    "step": 2,
    "per_second": 100,
    "words": WIDTH,
    "columns": [
        ["a.x", 1, [2], "f", "mm", "m"],
        ["a.on", 3, [], "b", "", ""],
        ["a.n", 4, [], "u", "", ""],
    ],
    "calls": {"77": ["heart", "doStep"]},
}
TICKS = 3 * np.arange(COUNT)
X = np.stack([0.5 * np.arange(COUNT), -1.0 * np.arange(COUNT)], 1)
ON = np.arange(COUNT) % 3 == 0
N = 2**63 + np.arange(COUNT, dtype=np.uint64)
TIMES = (4 + 2 * TICKS) / 100


def write_rows(folder: Path, remainder: bytes = b"") -> Path:
    """Rows as the compiled loop writes them; a Boolean is any nonzero word."""
    words = np.zeros((COUNT, WIDTH), np.int64)
    words[:, 0], words[:, 1:3], words[:, 3], words[:, 4] = TICKS, X.view(np.int64), 5 * ON, N.view(np.int64)
    file = folder / "0.rows"
    file.write_bytes(words.tobytes() + remainder)
    return file


def read(folder: Path, *, large: bool, last: int | None = None, slice_rows: int = 4) -> tuple[rows.RowFile, Signals]:
    size = COUNT * WIDTH * rows.WORD
    file = rows.RowFile(folder / "0.rows", WIDTH, size - 1 if large else size, slice_rows * WIDTH * rows.WORD + 7, last)
    fields = {name: rows.RowField(first, tuple(shape), kind) for name, first, shape, kind, *_ in LAYOUT["columns"]}  # type: ignore[misc,attr-defined]
    time, values = rows.read_columns(file, fields, (4, 2, 100))
    return file, Signals(time, values, {"a.x": "mm"})


@pytest.mark.parametrize("large", [False, True])
def test_values_of_all_kinds(tmp_path: Path, large: bool) -> None:
    write_rows(tmp_path, b"1234567")  # a row of which a part was written does not count
    file, signals = read(tmp_path, large=large)
    assert (file.count, file.rows_per_slice, file.is_large, signals.is_large) == (COUNT, 4, large, large)
    np.testing.assert_array_equal(np.asarray(signals.time), TIMES)
    for name, expected in (("a.x", X), ("a.on", ON), ("a.n", N)):
        found = signals.values[name]
        assert (found.shape, found.dtype, found.ndim) == (expected.shape, expected.dtype, expected.ndim)
        assert len(found) == COUNT
        np.testing.assert_array_equal(np.asarray(found), expected)


@pytest.mark.parametrize("last", [-1, 0, 2, 3, 3 * COUNT - 4, 3 * COUNT - 3, 1000])
def test_rows_up_to_a_tick(tmp_path: Path, last: int) -> None:
    write_rows(tmp_path)
    _, signals = read(tmp_path, large=False, last=last)
    np.testing.assert_array_equal(signals.time, TIMES[last >= TICKS])


@pytest.mark.parametrize(
    "key",
    [
        0,
        5,
        -1,
        COUNT - 1,
        np.int64(7),
        *(
            slice(*ends)
            for ends in (
                (None,),
                (0, 0),
                (3, 4),
                (3, 9),
                (5, 100),
                (-6, None),
                (None, None, 2),
                (1, None, 3),
                (2, 20, 4),
                (2, 20, 5),
                (0, None, 9),
                (0, None, 22),
                (0, None, 23),
                (None, None, -1),
                (9, 2, -2),
            )
        ),
        np.array([1, 22, 4]),
        (slice(2, 5), 1),
    ],
)
def test_a_lazy_column_is_indexed_as_an_array(tmp_path: Path, key: Any) -> None:
    write_rows(tmp_path)
    _, signals = read(tmp_path, large=True)
    np.testing.assert_array_equal(signals.values["a.x"][key], X[key])
    if not isinstance(key, tuple):
        np.testing.assert_array_equal(signals.time[key], TIMES[key])


def test_a_row_that_does_not_exist(tmp_path: Path) -> None:
    write_rows(tmp_path)
    _, signals = read(tmp_path, large=True)
    for index in (COUNT, -COUNT - 1):
        with pytest.raises(IndexError):
            signals.time[index]
    assert rows.RowFile(tmp_path / "none.rows", WIDTH, 1, 1).count == 0


@pytest.mark.parametrize("slice_rows", [1, 4, 22, 23, 50])
def test_a_large_recording_part_by_part(tmp_path: Path, slice_rows: int) -> None:
    write_rows(tmp_path)
    _, signals = read(tmp_path, large=True, slice_rows=slice_rows)
    parts = list(signals.parts())
    assert [len(part.time) for part in parts] == [
        min(slice_rows, COUNT - begin) for begin in range(0, COUNT, slice_rows)
    ]
    for name, expected in (("a.x", X), ("a.on", ON)):
        np.testing.assert_array_equal(np.concatenate([part.values[name] for part in parts]), expected)
    assert (list(parts[0].values), len(parts[0].values)) == (["a.x", "a.on", "a.n"], 3)
    second, window = expression.parse("a.x[2] - 1"), Window(160_000_000, 400_000_000)
    whole = read(tmp_path, large=False)[1].evaluate(second, window)
    assert whole is not None
    times, values = (np.concatenate(each) for each in zip(*signals.evaluate_parts(second, window), strict=True))
    np.testing.assert_array_equal(times, whole[0])
    np.testing.assert_array_equal(values, whole[1])
    assert signals.scale(second) == 1.022
    assert list(signals.evaluate_parts(expression.parse("a.x"))) == []


@pytest.mark.parametrize(("most", "stride"), [(1, 23), (5, 5), (11, 3), (12, 2), (22, 2), (23, 1), (100, 1)])
def test_a_sample_of_the_rows(tmp_path: Path, most: int, stride: int) -> None:
    write_rows(tmp_path)
    few = read(tmp_path, large=True)[1].subsample(most)
    assert len(few.time) <= most
    np.testing.assert_array_equal(few.time, TIMES[::stride])
    np.testing.assert_array_equal(few.values["a.x"], X[::stride])
    small = read(tmp_path, large=False)[1]
    assert small.subsample(1) is small


def journal(run: Path, *lines: dict[str, object]) -> stream.RunRecording:
    folder = run / stream.FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    head = {"format": stream.FORMAT, "run": {"cases": [["PI", 1], ["FF", 2], ["FF", 3]]}}
    (folder / stream.JOURNAL).write_text("".join(json.dumps(line) + "\n" for line in (head, *lines)))
    return stream.read_recording(run)


def test_signals_of_finished_and_unfinished_cases(tmp_path: Path) -> None:
    layout = {"rows": 0, **LAYOUT}
    (tmp_path / stream.FOLDER).mkdir()
    write_rows(tmp_path / stream.FOLDER)
    recording = journal(tmp_path, {"start": 0}, layout, {"end": 0, "complete": True, "last": 9}, {"start": 1})
    assert recording.cases == [("PI", 1), ("FF", 2), ("FF", 3)]
    finished = recording.signals(0)
    assert finished.complete
    np.testing.assert_array_equal(finished.time, TIMES[:4])
    np.testing.assert_array_equal(finished.values["a.x"], X[:4])
    assert finished.units == {"a.x": "mm", "a.on": "", "a.n": ""}
    assert finished.display_units == {"a.x": "m"}
    unfinished = recording.signals(1)
    assert (unfinished.complete, len(unfinished.time), unfinished.values) == (False, 0, {})
    running = journal(tmp_path, {"start": 0}, layout).signals(0)
    assert not running.complete
    np.testing.assert_array_equal(running.time, TIMES)


@pytest.mark.parametrize(
    ("position", "report", "expected"),
    [
        (
            "6 77 \nrest",
            None,
            {"signal": 9, "tick": 6, "member": "heart", "function": "doStep", "time_ns": 160_000_000},
        ),
        ("6 78 wall: reset", None, {"tick": 6, "member": "wall", "function": "reset", "time_ns": 160_000_000}),
        ("0 0 reading", None, {"note": "reading", "member": "", "function": "", "time_ns": 40_000_000}),
        ("damaged", None, {"signal": 9, "tick": 0, "at": 0, "note": ""}),
        ("6 77 ", CrashReport(signal=11, tick=1, at=77), {"signal": 11, "member": "heart", "time_ns": 60_000_000}),
    ],
)
def test_where_a_run_ended(
    tmp_path: Path, position: str, report: CrashReport | None, expected: dict[str, object]
) -> None:
    recording = journal(tmp_path, {"start": 0}, {"rows": 0, **LAYOUT}, {"start": 1})
    (recording.folder / "0.position").write_text(position)
    crash = recording.locate_crash(0, report)
    assert {name: getattr(crash, name) for name in expected} == expected
    assert recording.locate_crash(1, None) == CrashReport(signal=9)


def test_a_journal_is_complete_or_tells_why_not(tmp_path: Path) -> None:
    writer = stream.Journal(tmp_path)
    assert not stream.has_journal(tmp_path)
    assert stream.read_failure_reason(tmp_path) == ""
    writer.create({"cases": [["PI", 1]]}, "17-4")
    assert stream.has_journal(tmp_path)
    assert (writer.folder / stream.OWNER).read_text() == "17-4"
    assert stream.read_failure_reason(tmp_path) == ""
    writer.start_case(0)
    writer.append_line(end=0, failure="µ")
    found = stream.read_recording(tmp_path)
    assert (found.cases, found.case_recordings[0].end) == ([("PI", 1)], {"end": 0, "failure": "µ"})
    (writer.folder / stream.JOURNAL).unlink()
    (writer.folder / stream.JOURNAL).mkdir()
    writer.append_line(end=1)
    first = writer.error
    assert isinstance(first, IsADirectoryError)
    file = writer.folder / stream.JOURNAL
    assert stream.read_failure_reason(tmp_path) == f"{file}: cannot be written (Is a directory)"
    writer.append_line(end=1, failure="x" * (stream.RESERVE_SIZE + 1))
    assert writer.error is first
    assert stream.read_failure_reason(tmp_path) == "x" * stream.RESERVE_SIZE
    assert (writer.folder / stream.RESERVE).stat().st_size == stream.RESERVE_SIZE
    writer.append_line(end=1, failure="short")
    assert stream.read_failure_reason(tmp_path) == "short"
    writer.remove()
    assert not writer.folder.exists()


def test_runs_whose_owners_have_ended(tmp_path: Path) -> None:
    own = process_identity(os.getpid())
    for name, owners in (("b", "999999999-1"), ("a", ""), ("running", f"999999999-1 {own}"), ("none", None)):
        folder = tmp_path / "scenario" / name / stream.FOLDER
        folder.mkdir(parents=True)
        if owners is not None:
            (folder / stream.OWNER).write_text(owners)
    (tmp_path / "scenario" / "finished").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "scenario")
    (tmp_path / "file").touch()
    assert [run.name for run in stream.find_unfinished_runs(tmp_path)] == ["a", "b", "none"]
    assert stream.find_unfinished_runs(tmp_path / "missing") == []


def test_a_column_survives_json() -> None:
    from twin.results.recording.run_folder import RecordedVariable

    column = RecordedVariable("a.x", np.dtype(np.int32), (2, 3), "N")
    data = json.loads(json.dumps(stream.column_to_dict(column)))
    assert stream.column_from_dict(data) == column
