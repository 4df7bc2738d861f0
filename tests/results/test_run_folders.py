"""Folders of runs: their names, the latest of them, and the numbers that a summary keeps."""

from __future__ import annotations

import math
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from twin.errors import TwinError
from twin.results import HardwareTermination
from twin.results.recording import latest_run
from twin.results.recording.run_folder import (
    RecordedVariable,
    RunInfo,
    count_not_judged,
    count_verdicts,
    flatten_columns,
    make_run_folder,
    platform_name,
    software_versions,
    termination_to_dict,
    to_json_value,
)

NOW = datetime(2026, 11, 21, 0, 41, 32)  # noqa: DTZ001 - local time, as in the name
STAMP = "2026-11-21_00-41-32"


@pytest.mark.parametrize(
    ("name", "folder"),
    [("force", "force"), ("a b/c", "a_b_c"), ("PI+FF-1.2_x", "PI+FF-1.2_x"), ("..", "run"), (".a.", "a"), ("", "run")],
)
def test_names_of_folders(tmp_path: Path, name: str, folder: str) -> None:
    assert make_run_folder(tmp_path, name, NOW) == tmp_path / folder / STAMP
    assert make_run_folder(tmp_path, name, NOW) == tmp_path / folder / f"{STAMP}_2"
    assert make_run_folder(tmp_path, name, NOW) == tmp_path / folder / f"{STAMP}_3"


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(TwinError, match=r"file/a/.*: cannot be made \(Not a directory\)\. Choose another folder"):
        make_run_folder(tmp_path / "file", "a", NOW)


def run(folder: Path, finished: bool = True) -> Path:
    folder.mkdir(parents=True)
    if finished:
        (folder / "summary.json").write_text("{}")
    return folder


def test_the_latest_finished_run(tmp_path: Path) -> None:
    """By the time in its name, then by its number in this second; what is no run does not count."""
    first = run(tmp_path / "a" / STAMP)
    tenth = run(tmp_path / "a" / f"{STAMP}_10")
    second = run(tmp_path / "a" / f"{STAMP}_2")
    other = run(tmp_path / "b" / "2026-11-20_23-59-59")
    run(tmp_path / "a" / "2026-12-01_00-00-00", finished=False)
    run(tmp_path / "a" / "zzz")
    assert latest_run.finished_runs(tmp_path) == [tenth, second, first, other]
    assert latest_run.latest_run(tmp_path / "a") == tenth
    assert latest_run.resolve_latest(tmp_path / "a" / "latest") == tenth
    assert latest_run.resolve_latest(first) == first
    assert latest_run.run_order(first) == (STAMP, 1)
    assert latest_run.run_order(tmp_path / "zzz") == ("", 0)
    own = tmp_path / "b" / "latest"
    own.mkdir()
    assert latest_run.resolve_latest(own) == own
    with pytest.raises(TwinError, match=r"/c: holds no finished run\. Looked in .*\. Known: a, b"):
        latest_run.latest_run(tmp_path / "c")
    (tmp_path / "d").mkdir()
    with pytest.raises(TwinError, match=r"/d: holds no finished run\. Run the scenario first\.$"):
        latest_run.latest_run(tmp_path / "d")


def test_a_run_without_signals_is_not_the_latest(tmp_path: Path) -> None:
    """Neither by name nor by the link; it is, if there is no other. A note says which run was passed over."""
    good, bad = run(tmp_path / STAMP), run(tmp_path / f"{STAMP}_2")
    (bad / "summary.json").write_text('{"cases": []}')
    for folder in (good, bad):
        latest_run.link_latest(folder)
    assert latest_run.linked(tmp_path / "latest") == good
    assert latest_run.latest_run(tmp_path) == latest_run.resolve_latest(tmp_path / "latest") == good
    note = f"{bad.name} is newer, but failed before it recorded anything; this is {good.name}."
    assert latest_run.newer_note(tmp_path / "latest") == latest_run.newer_note(good) == note
    (good / "summary.json").unlink()
    assert latest_run.latest_run(tmp_path) == bad
    assert latest_run.newer_note(bad) == ""


def test_the_link_to_the_latest_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second, third = (run(tmp_path / f"{STAMP}{end}") for end in ("", "_2", "_3"))
    link = tmp_path / "latest"
    latest_run.link_latest(run(tmp_path / "zzz"))
    assert not link.is_symlink()
    for folder, linked in ((second, second), (first, second), (third, third)):
        latest_run.link_latest(folder)
        assert link.is_symlink()
        assert latest_run.linked(link) == linked
    link.unlink()

    def refuse(*_: Any, **__: Any) -> None:
        raise OSError

    monkeypatch.setattr(type(link), "symlink_to", refuse)
    latest_run.link_latest(second)  # where links cannot be made
    assert link.read_text() == f"{second.name}\n"
    assert latest_run.linked(link) == second
    latest_run.link_latest(first)
    assert latest_run.linked(link) == second
    link.unlink()
    link.mkdir()
    latest_run.link_latest(third)
    assert list(link.iterdir()) == []


@pytest.mark.parametrize(
    ("termination", "entries"),
    [
        (HardwareTermination(), {}),
        (HardwareTermination(unsafe="axis moves"), {"unsafe": "axis moves"}),
        (HardwareTermination(1_500_000_000, "hot"), {"stopped": 1.5, "reason": "hot"}),
        (HardwareTermination(0, "hot", "axis moves"), {"unsafe": "axis moves", "stopped": 0.0, "reason": "hot"}),
    ],
)
def test_a_stop_by_hardware_in_a_summary(termination: HardwareTermination, entries: dict[str, Any]) -> None:
    assert termination_to_dict(termination) == entries


def test_requirements_of_a_summary() -> None:
    """Verdicts other than pass, fail and none were not judged."""
    verdicts = {"PI": "pass", "FF": "fail", "off": "skipped", "odd": "none", "new": ""}
    metrics = {"m": {"variants": {name: {"verdict": verdict} for name, verdict in verdicts.items()}}}
    expectations = [{"verdict": "pass"}, {"verdict": "skipped"}]
    assert count_verdicts({"metrics": metrics, "expectations": expectations}) == (2, 4)
    assert count_verdicts({"metrics": {}, "expectations": []}) == (0, 0)


@pytest.mark.parametrize(("tolerance", "count"), [(0.2, 3), (None, 1)])
def test_the_papers_values_are_counted_also_at_other_settings(tolerance: float | None, count: int) -> None:
    """They vanished: 12 requirements were 6 met and 4 not judged after a change."""
    variants = {name: {"verdict": "other"} for name in ("PI", "FF")}
    metrics = {"m": {"tolerance": tolerance, "variants": variants}}
    assert count_not_judged({"metrics": metrics, "expectations": [{"verdict": "skipped"}]}) == (count, 0)


def test_values_of_a_summary_are_json() -> None:
    value = {1: (1, {2}), "a": np.array([1.5, np.nan]), "b": np.float64(np.inf), "c": None, "d": True, "e": -math.inf}
    assert to_json_value(value) == {"1": [1, [2]], "a": [1.5, None], "b": None, "c": None, "d": True, "e": None}
    assert to_json_value({"x": NOW, "y": np.int32(3)}) == {"x": str(NOW), "y": 3}


@pytest.mark.parametrize(("wall", "factor"), [(2.0, 5.0), (20.0, 0.5), (0.0, None)])
def test_simulated_time_over_wall_time(wall: float, factor: float | None) -> None:
    assert RunInfo("x", simulated_time=10.0, wall_time=wall).real_time_factor == factor


def test_columns_are_scalars_each_once() -> None:
    columns = [
        RecordedVariable("a.x", np.dtype(np.int32), (2,), unit="m"),
        RecordedVariable("a.x", np.dtype(np.int32), (3,), unit="m"),
        RecordedVariable("a.n", np.dtype(bool)),
        RecordedVariable("a.n", np.dtype(np.int32)),
    ]
    assert [(column.label, column.dtype.name) for column in flatten_columns(columns)] == [
        ("a.x[1]", "int32"),
        ("a.x[2]", "int32"),
        ("a.x[3]", "int32"),
        ("a.n", "float64"),
    ]
    assert columns[0].columns == ("a.x[1]", "a.x[2]")


def test_versions_name_what_computed_a_run() -> None:
    import platform

    import twin

    versions = software_versions()
    assert versions["catheter-twin"] == twin.__version__
    assert versions["python"] == platform.python_version()
    assert versions["numpy"] == np.__version__
    assert versions["platform"] == platform_name()
    assert platform_name().startswith(platform.system())


def test_latest_alone_is_the_last_run_of_all_scenarios(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """For each command that takes a run: `twin compare latest RUN` as `twin view latest`."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TwinError, match=r"^runs: holds no finished run\. Run a scenario first"):
        latest_run.find_results(Path("latest"), "summary.json", "run", "x")
    for name in ("a/2026-01-02_00-00-00", "b/2026-01-01_00-00-00"):
        (tmp_path / "runs" / name).mkdir(parents=True)
        (tmp_path / "runs" / name / "summary.json").write_text("{}")
    assert latest_run.find_results(Path("latest"), "summary.json", "run", "x") == Path("runs/a/2026-01-02_00-00-00")
