"""The folder of a run: what is written can be read, whatever happened."""

from __future__ import annotations

import json
import platform
from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np
import pytest
from pyarrow import parquet

from twin.errors import CouplingError, TwinError
from twin.results import Expectation, Metric, Signals, evaluate
from twin.results.evaluation import expression
from twin.results.recording import run_folder as results
from twin.results.recording.run_folder import RecordedVariable, RunInfo, SignalFile

if TYPE_CHECKING:
    from pathlib import Path

TIME = np.arange(100) * 0.01
COLUMNS = [
    RecordedVariable("a.force", unit="N", display_unit="mN", description="contact force"),
    RecordedVariable("a.x", shape=(2,), unit="m"),
    RecordedVariable("b.count", np.dtype(np.int32)),
    RecordedVariable("b.on", np.dtype(bool)),
]
FIRST = Signals(TIME, {"a.force": np.sin(TIME), "a.x": np.stack([TIME, 2 * TIME], 1)}, {"a.force": "N", "a.x": "m"})
SECOND = Signals(
    TIME[:50],
    {"a.force": TIME[:50], "b.count": np.arange(50, dtype=np.int32), "b.on": TIME[:50] > 0.2},
    {"a.force": "mN"},
)


def test_folders_are_unique(tmp_path: Path) -> None:
    now = datetime(2026, 11, 21, 0, 41, 32)  # noqa: DTZ001
    names = [results.make_run_folder(tmp_path, "heart wall/force", now).relative_to(tmp_path) for _ in range(3)]
    assert [str(name) for name in names] == [f"heart_wall_force/2026-11-21_00-41-32{end}" for end in ("", "_2", "_3")]
    (tmp_path / "file").touch()
    with pytest.raises(TwinError, match="cannot be made"):
        results.make_run_folder(tmp_path / "file", "x")


def write(path: Path) -> None:
    with SignalFile(path, COLUMNS, {"scenario": "contact"}) as file:
        file.write("PI", 1, FIRST)
        file.write("PI+FF", 2, SECOND)


def test_signals(tmp_path: Path) -> None:
    write(tmp_path / "signals.parquet")
    table = parquet.read_table(tmp_path / "signals.parquet")
    assert table.column_names == ["variant", "seed", "time", "a.force", "a.x[1]", "a.x[2]", "b.count", "b.on"]
    assert [str(kind) for kind in table.schema.types] == [
        "dictionary<values=string, indices=int32, ordered=0>",
        "int64",
        "double",
        "double",
        "double",
        "double",
        "int32",
        "bool",
    ]
    frame = table.to_pydict()
    assert frame["variant"] == ["PI"] * 100 + ["PI+FF"] * 50
    assert frame["seed"] == [1] * 100 + [2] * 50
    assert frame["a.force"][:100] == np.sin(TIME).tolist()
    assert frame["a.x[2]"] == [*(2 * TIME).tolist(), *[None] * 50]
    assert frame["b.count"] == [*[None] * 100, *range(50)]
    assert frame["a.force"][149] == pytest.approx(TIME[49] / 1000)  # this variant's component has it in mN
    assert table.schema.field("a.force").metadata == {
        b"unit": b"N",
        b"display_unit": b"mN",
        b"description": b"contact force",
    }
    assert table.schema.metadata[b"scenario"] == b"contact"
    assert table.schema.metadata[b"project"].startswith(b"catheter-twin ")


def test_signals_can_be_read_back(tmp_path: Path) -> None:
    write(tmp_path / "signals.parquet")
    cases, about = results.read_signals(tmp_path / "signals.parquet")
    assert list(cases) == [("PI", 1), ("PI+FF", 2)]
    assert about["scenario"] == "contact"
    assert cases["PI", 1].units["a.force"] == "N"
    np.testing.assert_array_equal(cases["PI", 1].values["a.x[2]"], 2 * TIME)


def test_what_was_written_survives_an_interruption(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), SignalFile(tmp_path / "s.parquet", COLUMNS, {}) as file:
        file.write("PI", 1, FIRST)
        raise KeyboardInterrupt
    assert parquet.read_table(tmp_path / "s.parquet").num_rows == 100


def test_columns_of_two_variants_are_joined() -> None:
    flat = results.flatten_columns(
        [
            RecordedVariable("a.n", np.dtype(np.int32)),
            RecordedVariable("a.n"),
            RecordedVariable("a.m", shape=(2, 2)),
            RecordedVariable("a.m", shape=(1, 2)),
        ]
    )
    assert [(one.label, one.dtype.name) for one in flat] == [
        ("a.n", "float64"),
        ("a.m[1,1]", "float64"),
        ("a.m[1,2]", "float64"),
        ("a.m[2,1]", "float64"),
        ("a.m[2,2]", "float64"),
    ]


def test_columns_of_two_kinds_are_refused_before_anything_runs() -> None:
    with pytest.raises(
        CouplingError, match=r"a\.x, which two variants have in different units: N does not convert to m"
    ):
        results.flatten_columns([RecordedVariable("a.x", unit="N"), RecordedVariable("a.x", unit="m")])


def test_summary(tmp_path: Path) -> None:
    metric = Metric("error", expression.parse("a.force - 0.2"), "std", unit="mN", paper={"PI": 0.25}, tolerance=0.2)
    tables = {("PI", 1): FIRST, ("PI", 2): FIRST}
    evaluation = evaluate({"error": metric}, [Expectation("limit", metric="error", at_most=1.0)], tables)
    run = RunInfo(
        "contact", wall_time=0.5, simulated_time=2.0, members={"a": {"hash": "1"}}, extra={"overruns": np.int64(3)}
    )
    results.write_summary(tmp_path / "summary.json", results.build_summary(run, evaluation, tables))
    found = json.loads((tmp_path / "summary.json").read_text())
    expected = float(np.std(np.sin(TIME))) * 1000
    error = found["metrics"]["error"]["variants"]["PI"]
    assert error["mean"] == pytest.approx(expected)
    assert error["values"] == {"1": error["mean"], "2": error["mean"]}
    assert (error["paper"], error["verdict"]) == (250.0, "pass")
    assert (found["status"], found["passed"], found["real_time_factor"], found["overruns"]) == (
        "completed",
        True,
        4.0,
        3,
    )
    assert found["expectations"][0]["verdict"] == "pass"
    assert found["versions"]["python"]
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]


def test_json_has_no_nan(tmp_path: Path) -> None:
    data = {"a": float("nan"), "b": np.array([1.0, np.inf]), 3: (np.float32(2), None, True), "p": tmp_path}
    results.write_summary(tmp_path / "s.json", data)
    assert json.loads((tmp_path / "s.json").read_text()) == {
        "a": None,
        "b": [1.0, None],
        "3": [2.0, None, True],
        "p": str(tmp_path),
    }


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    results.write_text(path, "old")
    with pytest.raises(UnicodeEncodeError):
        results.write_text(path, "\ud800")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_run_that_failed_has_not_passed() -> None:
    summary = results.build_summary(RunInfo("x", status="failed", reason="servo: NaN"), evaluate({}, [], {}), {})
    assert (summary["passed"], summary["reason"]) == (False, "servo: NaN")


def test_revision_outside_a_checkout(tmp_path: Path) -> None:
    assert results.checkout(tmp_path) == ""


def test_the_file_is_that_of_the_public_writer(tmp_path: Path) -> None:
    """`SignalFile` imports less than `pyarrow.parquet` does, and writes the same bytes."""
    rows = Signals(np.arange(3.0), {one.name: np.ones((3, *one.shape), one.dtype) for one in COLUMNS})
    files = [SignalFile(tmp_path / name, COLUMNS, {"scenario": "x"}) for name in ("ours", "theirs")]
    files[1].writer.close()
    files[1].writer = parquet.ParquetWriter(
        tmp_path / "theirs", files[1].schema, compression="zstd", use_dictionary=["variant"]
    )
    for file in files:
        file.write("a", 1, rows)
        file.close()
    assert (tmp_path / "ours").read_bytes() == (tmp_path / "theirs").read_bytes()


def test_the_system_as_python_names_it() -> None:
    assert results.platform_name() == platform.platform()
