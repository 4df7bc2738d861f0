"""The course of a study: parts in order, numbers of cases, runs that are kept, what the manifest and the report say."""

import importlib
import json
import re
from dataclasses import replace
from types import SimpleNamespace

import pytest

from tests.every_case import every_case
from tests.study.patients import SCENARIO, STUDY, study_file
from twin.errors import SimulationError, TwinError
from twin.study import load_study
from twin.study.answers import PlotSet, page, plots, tables, write_report
from twin.study.execution import manifest, study_runner
from twin.study.execution.case_engine import Row
from twin.study.execution.case_table import CaseTable
from twin.study.execution.study_runner import (
    StudyOutcome,
    finish,
    initial_entries,
    keep_runs,
    progress_entries,
    run_parts,
    start_runner,
)

SEARCHES = """
worst: {metric: force_max, evaluations: 64}
tune:
  knobs: {wall.free_length: {from: 40 mm, to: 60 mm}}
  metric: force_max
  trials: 12
"""


def loaded(folder, text=STUDY):
    return load_study(study_file(folder, text))


def reporter_of(phases):
    return SimpleNamespace(update=phases.append)


def outcome_of(study, folder, forces=(0.02, 0.1, 0.04, None), status="completed"):
    requests = list(study.requests())[: len(forces)]
    rows = [
        Row(one.number, "failed", "lost", (), ())
        if force is None
        else Row(one.number, "done", "", (force, 0.01), (force <= 0.09, None))
        for one, force in zip(requests, forces, strict=True)
    ]
    return StudyOutcome(study, folder, CaseTable(study, requests, rows), status, 12.345)


@pytest.mark.parametrize(
    ("text", "parts"), [(STUDY, ["sample"]), (STUDY + SEARCHES, ["sample", "worst 12", "tune 76"])]
)
def test_searches_go_on_with_the_numbers_of_the_samples(tmp_path, monkeypatch, text, parts):
    study, seen = loaded(tmp_path, text), []
    cases = SimpleNamespace(run=lambda requests, part: seen.append(part) or list(requests))
    worst, tuned = SimpleNamespace(last=76), SimpleNamespace(last=99)
    monkeypatch.setattr(
        study_runner, "search_worst", lambda _study, _cases, number: seen.append(f"worst {number}") or worst
    )
    monkeypatch.setattr(study_runner, "tune", lambda _study, _cases, number: seen.append(f"tune {number}") or tuned)
    outcome = outcome_of(study, tmp_path)
    run_parts(outcome, cases)
    assert seen == parts
    assert (outcome.worst, outcome.tuned) == ((worst, tuned) if len(parts) > 1 else (None, None))
    assert study.total == 12 + (64 + 13 * 6 if len(parts) > 1 else 0)


def test_what_is_known_before_and_after_a_study(tmp_path):
    study = loaded(tmp_path)
    before = initial_entries(study, "twin study patients.yaml")
    assert {key: before[key] for key in ("study", "title", "frozen", "options", "command", "samples", "cases")} == {
        "study": "patients",
        "title": study.title,
        "frozen": "scenario_of_study.yaml",
        "options": [],
        "command": "twin study patients.yaml",
        "samples": 6,
        "cases": 12,
    }
    assert before["file"] == str((tmp_path / "patients.yaml").resolve())
    assert before["factors"][2] == {
        "name": "bent end",
        "sets": (),
        "scales": ("wall.bending_stiffness",),
        "unit": "",
        "source": "assumed",
        "at_ns": None,
        "display_unit": "",
    }  # as in the file
    assert {"study file", "scenario"} < before["inputs"].keys()
    outcome = outcome_of(study, tmp_path)
    after = {"status": "completed", "done": 4, "failed": 1, "seconds": 12.345, "engine": "3 processes"}
    outcome.engine = "3 processes"
    assert progress_entries(outcome) == after


ANALYSIS = """
from scaling_of_the_study import scaled

def tenfold(force):
    return {"force": 10.0 * scaled(force)}
tenfold.outputs = {"force": "N"}
"""


def test_what_decides_the_results_has_a_hash(tmp_path, monkeypatch):
    """Other samples of the same file, as of a changed estimate, and another analysis do not go on."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "of_the_study.py").write_text(ANALYSIS)
    (tmp_path / "scaling_of_the_study.py").write_text("def scaled(force):\n    return force\n")
    analyses = 'analyses: {more: {function: "of_the_study:tenfold", inputs: {force: sensor.measured_force}}}\n'
    study = load_study(study_file(tmp_path, STUDY, SCENARIO + analyses))
    before = manifest.inputs(study)
    moved = replace(study, design=replace(study.design, values=study.design.values * 1.01))
    assert [name for name, value in manifest.inputs(moved).items() if value != before[name]] == ["samples"]
    (tmp_path / "of_the_study.py").write_text(ANALYSIS.replace("10.0", "20.0"))
    assert [name for name, value in manifest.inputs(study).items() if value != before[name]] == ["analysis more"]
    (tmp_path / "of_the_study.py").write_text(ANALYSIS)
    assert manifest.inputs(study) == before
    (tmp_path / "scaling_of_the_study.py").write_text("def scaled(force):\n    return 2 * force\n")
    assert [name for name, value in manifest.inputs(study).items() if value != before[name]] == ["analysis more"]


def test_processes_here_or_a_cluster(tmp_path, monkeypatch):
    monkeypatch.setattr(study_runner, "Pool", lambda *arguments: arguments)
    study = loaded(tmp_path)
    *arguments, grouped = start_runner("job", study, "", 3, 100, 2.0)
    assert arguments == ["job", 3, 100, 2.0]
    assert [[one.number] for one in study.requests()] == [
        [one.number for one in group] for group in grouped(study.requests())
    ]


def kept(tmp_path, monkeypatch, ends, **fields):
    """Keep runs of cases 1 to 4, which end like this; numbers that were run, and the outcome."""
    outcome, seen = outcome_of(loaded(tmp_path), tmp_path), []
    outcome.runs.update(fields.get("before", {}))

    def repeat(folder, number, *, root, build):
        assert (folder, root) == (tmp_path, tmp_path / "cases")
        seen.append(number)
        if ends[number] == "error":
            raise TwinError("no space")
        run = root / f"run {number}"
        run.mkdir(parents=True)
        return SimpleNamespace(run=SimpleNamespace(status=ends[number]), folder=run)

    monkeypatch.setattr("twin.study.answers.noteworthy", lambda _cases, _keep: [1, 2, 3, 4])
    monkeypatch.setattr(importlib.import_module("twin.study.execution.stored_case"), "repeat", repeat)
    keep_runs(outcome, tmp_path, SimpleNamespace(number=fields.get("stop", 0)), reporter_of([]))
    return seen, outcome


def test_runs_of_noteworthy_cases_are_kept(tmp_path, monkeypatch):
    """One that was kept before is not run again; one that cannot be written is left out."""
    seen, outcome = kept(tmp_path, monkeypatch, {1: "completed", 3: "error", 4: "failed"}, before={2: "cases/old"})
    assert seen == [1, 3, 4]
    assert outcome.runs == {2: "cases/old", 1: "cases/run 1", 4: "cases/run 4"}
    assert outcome.status == "completed"


def test_an_interrupted_run_is_not_kept(tmp_path, monkeypatch):
    seen, outcome = kept(tmp_path, monkeypatch, {1: "completed", 2: "interrupted"})
    assert (seen, outcome.runs, outcome.status) == ([1, 2], {1: "cases/run 1"}, "interrupted")
    assert not (tmp_path / "cases/run 2").exists()


def test_after_a_stop_no_run_is_kept(tmp_path, monkeypatch):
    seen, outcome = kept(tmp_path, monkeypatch, {}, stop=2)
    assert (seen, outcome.runs, outcome.status) == ([], {}, "interrupted")


@pytest.mark.parametrize(
    ("status", "report", "steps"),
    [
        ("completed", True, ["tables", "keep", "report"]),
        ("interrupted", True, ["tables", "report without plots", "report"]),  # at once, then with plots
        ("completed", False, ["tables"]),
    ],
)
def test_a_study_ends_with_its_files(tmp_path, monkeypatch, status, report, steps):
    outcome, seen = outcome_of(loaded(tmp_path), tmp_path, status=status), []
    monkeypatch.setattr(study_runner, "write_tables", lambda *_: seen.append("tables"))
    monkeypatch.setattr(
        study_runner, "keep_runs", lambda own, *_: seen.append("keep") or own.runs.update({7: "cases/a"})
    )
    monkeypatch.setattr(
        "twin.study.answers.write_report",
        lambda _, plot_set=None: seen.append("report" if plot_set is None else "report without plots"),
    )
    phases = []
    journal = SimpleNamespace(rows={1: None, 2: None})
    finish(outcome, journal, {"status": status, "started": "now"}, tmp_path, None, report, reporter_of(phases))
    assert seen == steps
    assert phases == ["writing tables", *["drawing the plots of the report"] * report]
    assert manifest.read(tmp_path) == {"status": status, "started": "now"} | (
        {"runs": {"7": "cases/a"}} if "keep" in steps else {}
    )
    monkeypatch.setattr(study_runner, "write_tables", lambda *_: (_ for _ in ()).throw(OSError(28, "no space")))
    with pytest.raises(
        SimulationError, match=r"cannot be written \(No space left on device\)\. 2 cases are kept: free some space"
    ):
        finish(outcome, journal, {}, tmp_path, None, report, reporter_of([]))


def cells(row):
    return re.sub(r"\s+", " ", re.sub("<[^>]*>", " ", row)).strip()


@pytest.mark.slow
def test_the_report_of_a_study(tmp_path, monkeypatch):
    """Its tables, the links to cases, and the answers as plain data; nothing where no case was done."""
    monkeypatch.setattr(plots.figure_files, "render_svg", lambda _size, salt, *_, **__: f"<svg>{salt}</svg>")
    study = loaded(tmp_path)
    outcome = outcome_of(study, tmp_path)
    outcome.runs[2] = "cases/run"
    manifest.write(tmp_path, command="twin study patients.yaml", engine="3 processes", versions={"numpy": "9"})
    write_report(outcome)
    text = (tmp_path / page.PAGE).read_text()
    assert re.findall("<div><b>([^<]*)</b><span>([^<]*)</span>", text) == [
        ("4", "cases: 2 variants of each sample"),
        ("6", "samples, latin hypercube"),
        ("1", "did not finish"),
        ("12.3 s", "wall time, from building to report; 3 processes"),
    ]
    rows = [cells(row) for row in re.findall("<tr.*?</tr>", text, re.DOTALL)]
    first, second, third, last = rows[-4:]
    assert [one.split()[0] for one in (first, second, third, last)] == ["2", "4", "1", "3"]  # failures first
    assert first.startswith("2 report Copy gentle soft ")
    assert f'data-command="twin view {tmp_path}:2"' in text
    assert third.startswith("1 not kept Copy pass plain ")
    assert f'data-command="twin run --case {tmp_path}:3"' in text
    assert "did not finish: lost" in second
    assert (tmp_path / page.PAGE).read_text().count("navigator.clipboard.writeText") == 1
    assert rows[0] == "What fails Variant Cases Factors that differ Example"  # then what was varied
    assert rows[3:7] == [
        "Factor Variables Distribution Range in the cases Source",
        *(
            " ".join(one[key] for key in ("name", "targets", "kind", "span", "source"))
            for one in tables.factors(outcome)
        ),
    ]
    svgs = re.findall("<svg>(.*?)</svg>", text)
    assert svgs == [
        text
        for metric in ("force_max", "motion")
        for text in (
            *(f"histogram {metric} {variant}" for variant in ("plain", "soft")),
            *(f"scatter {metric} {variant}" for variant in ("plain", "soft") for _ in range(3)),  # over three factors
            *(f"parallel {metric} {variant}" for variant in ("plain", "soft")),
        )
    ]
    passed, missed = (
        text.split("with their variants</summary>")[1],
        text[text.index('id="shares"') :].split("rows of 100 %")[0],
    )
    assert ("<td>gentle</td><td>plain</td>" in passed, "<td>gentle</td><td>soft</td>" in missed) == (True, True)
    assert "<td>gentle</td><td>plain</td>" not in missed
    assert 'id="worst"' not in text
    assert 'id="tornados"' not in text
    answers = json.loads((tmp_path / page.ANSWERS).read_text())
    assert {key: answers[key] for key in ("cases", "failed", "drivers", "changes")} == {
        "cases": 4,
        "failed": 1,
        "drivers": [],
        "changes": [],
    }
    assert [
        (one["name"], one["variant"], one["met_count"], one["part"], one["failing"])
        for one in answers["expectations"][:2]
    ] == [
        ("gentle", "plain", 2, 1.0, []),
        ("gentle", "soft", 0, 0.0, [2, 4]),
    ]
    assert [(one["what"], one["cases"]) for one in answers["clusters"]] == [("gentle", [2]), ("lost", [4])]
    write_report(outcome_of(study, tmp_path, (), "running"), PlotSet())
    assert "0 of 12 cases: starting. This page reloads itself." in (tmp_path / page.PAGE).read_text()


@every_case(
    ("status", "top"),
    [
        ("running", r"As of \d\d:\d\d:\d\d, 3 of 12 cases\. This page reloads itself\."),
        (
            "interrupted",
            r"3 of 12 cases finished\. Continue \(this page follows within a minute\): twin study patients\.yaml --resume Copy",
        ),
    ],
)
def test_a_page_before_the_end_says_how_far_it_is(tmp_path, status, top):
    study = loaded(tmp_path)
    outcome = outcome_of(study, tmp_path, (0.03, 0.02, 0.04), status)
    manifest.write(tmp_path, command="twin study patients.yaml", engine="3 processes", versions={"numpy": "9"})
    write_report(outcome, PlotSet())
    text = cells((tmp_path / page.PAGE).read_text().partition("<header>")[2])
    assert re.search(top, text)
    seconds = {"running": 3, "interrupted": 60}[status]  # it notices --resume
    assert f'<meta http-equiv="refresh" content="{seconds}">' in (tmp_path / page.PAGE).read_text()
    assert "No requirement fails in the 3 of 12 cases that are done." in text
    assert "3 of 12 cases: 2 variants of each sample 6 samples planned" in text
    assert " hold" not in text.partition("cases: 2 variants")[0]


def test_one_at_a_time_has_tornados(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        plots, "tornado", lambda changes, unit, name, labels: drawn.append((len(changes), unit, labels)) or f"[{name}]"
    )
    text = """
scenario: scenario.yaml
samples: {method: one_at_a_time}
variants: [plain]
vary: {heart.rate: {values: [60 /min, 90 /min], source: assumed}}
"""
    study = loaded(tmp_path, text)
    answers = page.Answers(outcome_of(study, tmp_path, (0.01, 0.02, 0.03)).cases)
    assert page.tornados(answers) == [("force_max", "[force_max]"), ("motion", "[motion]")]
    assert drawn == [(2, unit, ["heart.rate 60 /min", "heart.rate 90 /min"]) for unit in ("mN", "mm")]
