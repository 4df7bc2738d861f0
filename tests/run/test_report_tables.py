"""Tables of a report: order of metrics and members, links of failures, scripts and data, from results that a test chooses."""

import json
from types import SimpleNamespace

import pytest

from twin.run import report_page
from twin.run.report_page import group_by_member, link_failures, metric_groups, page_scripts
from twin.run.report_plots import ReportFigure
from twin.web import PackedArrays


def figure(*violations, panels=()):
    return ReportFigure("title", "<svg/>", panels=panels, marks=["mark"] if panels else (), violations=violations)


def test_failures_lead_to_the_first_plot_that_shows_them(monkeypatch):
    """Else to none; metrics beside their reference to the table of metrics."""
    results = [
        SimpleNamespace(name=name, verdict=verdict)
        for name, verdict in (("a", "fail"), ("fine", "pass"), ("b", "fail"), ("c", "fail"), ("odd", "skipped"))
    ]
    monkeypatch.setattr(report_page, "list_failures", lambda _: ["line a", "line b", "line c", "a metric", "another"])
    found = link_failures(
        SimpleNamespace(expectation_results=results), [figure("x"), figure("a", "b"), figure("b", "fine")]
    )
    assert found == [
        ("line a", "plot-2"),
        ("line b", "plot-2"),
        ("line c", ""),
        ("a metric", "metrics"),
        ("another", "metrics"),
    ]
    monkeypatch.setattr(report_page, "list_failures", lambda _: [])
    assert link_failures(SimpleNamespace(expectation_results=results[1:2]), []) == []


def test_metrics_with_a_failure_come_first(monkeypatch):
    """Each with all of its rows; the others keep their order."""
    rows = [
        {"metric": name, "fails": fails}
        for name, fails in (("a", False), ("b", False), ("a", False), ("b", True), ("c", False))
    ]
    monkeypatch.setattr(report_page, "metric_rows", lambda results: rows if results == "results" else [])
    monkeypatch.setattr(report_page, "is_failure", lambda row: row["fails"])
    found = metric_groups(SimpleNamespace(metric_results="results"))
    assert [(name, len(group)) for name, group in found.items()] == [("b", 2), ("a", 2), ("c", 1)]


def test_members_with_set_parameters_come_first():
    rows = [
        SimpleNamespace(member=member, name=name, given=given, source="")
        for member, name, given in (("a", "k", False), ("b", "m", False), ("b", "k", True), ("c", "x", True))
    ]
    found = group_by_member(rows)
    assert [(member, [row.name for row in group]) for member, group in found.items()] == [
        ("b", ["k", "m"]),
        ("c", ["x"]),
        ("a", ["k"]),
    ]


@pytest.mark.parametrize(
    ("figures", "films", "has_script", "panels"),
    [
        ([], [], False, "{}"),
        ([figure()], [], False, "{}"),
        (
            [figure(), figure(panels=[[1]])],
            [],
            True,
            '{"plot-2": {"panels": [[1]], "marks": ["mark"]}}',
        ),
        ([], [{"name": "film"}], True, "{}"),
    ],
)
def test_scripts_are_there_where_something_needs_them(monkeypatch, figures, films, has_script, panels):
    monkeypatch.setattr(report_page, "embed_json", json.dumps)
    monkeypatch.setattr(report_page, "chart_script", lambda files, views: files[-1].name * views)
    found = page_scripts(figures, films, PackedArrays())
    assert (found["script"], bool(found["player_style"])) == ("report.js" * has_script, bool(films))
    assert (found["panels"], found["names"]) == (panels, ["film"] * bool(films))
