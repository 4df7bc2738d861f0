"""Studies that are stored: rows of their tables, what has changed since, names of cases, comparisons and archives."""

from __future__ import annotations

import io
import json
import re
import zipfile
from pathlib import Path
from types import SimpleNamespace

import pyarrow as pa
import pytest
from pyarrow import parquet

from tests.study.patients import study_file
from twin.errors import ScenarioError
from twin.store import LOCK
from twin.study import latest, load_study, resolve_case, stored_case_folder, stored_cases, study_of_run
from twin.study.design import Distribution, Factor
from twin.study.execution import case_table, manifest, study_archive
from twin.study.execution.case_engine import Job, Row
from twin.study.execution.stored_case import Single, factors_of


def test_a_single_row_of_the_table(tmp_path):
    with pytest.raises(ScenarioError, match=r"cases\.parquet: is not there"):
        case_table.single(tmp_path, 1)
    study = load_study(study_file(tmp_path))
    requests = list(study.requests())[:3]
    rows = [Row(one.number, "done", "", (0.5, None), (True, None), 0.1) for one in requests]
    case_table.write(tmp_path, case_table.CaseTable(study, requests, rows))
    row = case_table.single(tmp_path, 2)
    assert (row["case"], row["part"], row["sample"], row["variant"]) == (2, "sample", 1, "soft")
    assert row["heart.rate"] == requests[1].values[0]
    assert (row["force_max"], row["motion"], row["holds: gentle"]) == (0.5, None, True)
    assert row["margin: gentle"] == pytest.approx(0.09 - 0.5)  # SI; negative: violated
    assert "margin: softer is gentler" not in row
    assert (row["holds: softer is gentler"], row["status"], row["tries"], row["seconds"]) == (None, "done", 1, 0.1)
    with pytest.raises(ScenarioError, match=r"has no case 4\. The study has cases 1 to 3\."):
        case_table.single(tmp_path, 4)


@pytest.mark.parametrize(
    ("before", "now", "what"),
    [
        ({"a": 1}, {"a": 2}, "a changed"),
        ({"a": 1}, {"a": 1, "b": 2}, "b changed"),
        ({"a": 1, "b": 1, "c": 1}, {}, "a, b, c changed"),
        (dict.fromkeys("abcde", 1), {}, "a, b, c and 2 others changed"),
    ],
)
def test_a_study_of_something_else_does_not_go_on(tmp_path, before, now, what):
    manifest_file = tmp_path / manifest.NAME
    manifest_file.write_text(json.dumps({"inputs": before}))
    with pytest.raises(ScenarioError, match=re.escape(f"something else: {what}. Change that back")):
        manifest.refuse_changed(tmp_path, now)
    assert manifest.refuse_changed(tmp_path, before) == {"inputs": before}


def test_names_of_studies_and_their_cases(tmp_path):
    runs = tmp_path / "runs"
    for name in ("b", "a"):
        folder = runs / "patients" / name
        (folder / "cases" / "x" / "run").mkdir(parents=True)
        (folder / manifest.NAME).write_text(json.dumps({"runs": {"7": "cases/x/run"}}))
        parquet.write_table(pa.table({"case": range(1, 9)}), folder / case_table.NAME)
    newest = runs / "patients" / "b"
    (runs / "patients" / "latest").symlink_to("b")
    assert latest(runs, "patients") == newest
    for text in ("patients:7", "here/patients.yaml:7", "here/patients.yml:7", f"{newest}:7"):
        assert resolve_case(text, runs) == (newest, 7)
    assert resolve_case(f"{runs / 'patients' / 'a'}:12", runs) == (runs / "patients" / "a", 12)
    for text in ("patients", "patients:", ":7", "patients:x", "7"):
        with pytest.raises(ScenarioError, match=r"expected STUDY:NUMBER, such as"):
            resolve_case(text, runs)
    with pytest.raises(ScenarioError, match=r"no study others has run in"):
        resolve_case("others:7", runs)
    with pytest.raises(ScenarioError, match=r"there is no study to go on with"):
        latest(runs, "others")
    assert stored_cases(newest) == {7: newest / "cases/x/run"}
    assert stored_case_folder("patients:7", runs) == newest / "cases/x/run"
    with pytest.raises(ScenarioError, match=r"did not keep this case's signals\. Kept: 7\. Run it again"):
        stored_case_folder("patients:8", runs)
    with pytest.raises(ScenarioError, match=r"has no case 9\. The study has cases 1 to 8\."):
        stored_case_folder("patients:9", runs)
    assert study_of_run(newest / "cases" / "x" / "run") == newest
    assert study_of_run(newest) == newest
    assert study_of_run(newest / "cases" / "x" / "run" / "below") is None  # too far below
    assert study_of_run(runs) is None


def test_a_case_is_compared_with_the_study_to_the_bit():
    metric = SimpleNamespace(name="force", shown=lambda value: "-" if value is None else f"{value:g} N")

    def run(value, *, has=True):
        figure = SimpleNamespace(metric=metric, values={4: value})
        return SimpleNamespace(evaluation=SimpleNamespace(metric_results=[figure] if has else []))

    one = Single(7, Path("a.yaml"), (), "plain", 4, {"force": 0.25, "status": "done"})
    assert one.compared(run(0.25)) == "case 7: metrics as in the study, to the bit"
    assert one.compared(run(0.5)) == "case 7: not as in the study: force 0.5 N, in the study 0.25 N"
    assert one.compared(run(None)) == "case 7: not as in the study: force -, in the study 0.25 N"
    assert one.compared(run(0.0, has=False)) == "case 7: no metric, unlike in the study"
    failed = Single(7, Path("a.yaml"), (), "plain", 4, {"force": None, "status": "failed"})
    assert failed.compared(run(0.0, has=False)) == "case 7: metrics as in the study, to the bit"
    told = {"name": "rate", "sets": ["heart.rate"], "scales": [], "unit": "Hz", "source": "test"}
    assert factors_of({"factors": [told]}) == [
        Factor("rate", ("heart.rate",), (), Distribution("values", (0.0,)), "Hz", "", "test")
    ]


def test_files_that_a_scenario_names_travel_with_it(tmp_path):
    data = tmp_path / "data.csv"
    data.write_bytes(b"time,x\n0,1\n")
    inner = tmp_path / "inner.yaml"
    inner.write_text("stop_time: 1 s\nmembers: {heart: {component: heart}}\n")
    files: dict[str, bytes] = {}
    text = f"a: {data}\nb: [{data}, {inner}]\nc: /nowhere/data.csv\n"
    archived = study_archive.relative(text, files)
    assert archived.count("@HERE@/files/") == 3
    assert "c: /nowhere/data.csv" in archived
    assert sorted(Path(name).name for name in files) == ["data.csv", "inner.yaml"]
    (name,) = [one for one in files if one.endswith(".csv")]
    assert files[name] == data.read_bytes()
    assert f"a: @HERE@/{name}\n" in archived
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, content in {"scenario.yaml": archived.encode(), **files}.items():
            archive.writestr(name, content)
    there = tmp_path / "there"
    job = Job(Path("s.yaml"), (), (), (), 1, Path("b"))
    unpacked = study_archive.unpack(out.getvalue(), there, job)
    assert (unpacked.scenario, unpacked.build) == (there / "scenario.yaml", there / "build")
    assert "@HERE@" not in unpacked.scenario.read_text()
    named = Path(re.search(r"a: (.*)", unpacked.scenario.read_text())[1])
    assert named.is_relative_to(there)
    assert named.read_bytes() == data.read_bytes()
    with zipfile.ZipFile(out := io.BytesIO(), "w") as archive:
        archive.writestr("../out.txt", "x")
    with pytest.raises(ScenarioError, match=r"^\.\./out\.txt: would be unpacked outside of"):
        study_archive.unpack(out.getvalue(), there, job)


def test_an_archive_has_the_scenario_and_what_is_built_for_it(tmp_path, monkeypatch):
    """Without locks, folders and times: the same bytes every time."""
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text("a: 1\n")
    calls = []

    class Built:
        def __init__(self, job):
            self.folder = job.build
            assert job.build.parent == tmp_path / "build" / "studies"
            (job.build / "heart").mkdir(parents=True, exist_ok=True)
            (job.build / "heart" / "heart.so").write_bytes(b"native")
            (job.build / "heart" / LOCK).touch()

        def cell(self, variant):
            calls.append(variant)

        def close(self):
            calls.append("closed")

    monkeypatch.setattr(study_archive, "Engine", Built)
    job = Job(scenario, (), (), (), 1, tmp_path / "build")
    data = study_archive.pack(job, ("plain", "soft"))
    assert calls == ["plain", "soft", "closed"]
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert {name: archive.read(name) for name in archive.namelist()} == {
            "scenario.yaml": b"a: 1\n",
            "build/heart/heart.so": b"native",
        }
    assert study_archive.pack(job, ()) == data
