"""The charts of a session on a page without a server: which curves are shown, what is followed, measured and marked."""

from types import SimpleNamespace

import pytest

pytest.importorskip("nicegui")

from tests.console.page_without_a_server import Page
from tests.console.without_a_process import signal
from twin import web
from twin.console import charts
from twin.console.charts import ChartPanel
from twin.console.session import Host
from twin.live import ExecutedCommand


@pytest.fixture
def chart(monkeypatch):
    """A chart with two signals of a pane, and the page around it."""
    live = SimpleNamespace(done=[])
    one = SimpleNamespace(
        live=live, page=Page(monkeypatch), console=Host(live=SimpleNamespace(done=live.done, catalog=None))
    )
    sent = []
    signals = {
        each.name: each
        for each in (signal("a.x", unit="mm"), signal("a.y", unit="mm"), signal("b.n", type="Int32", unit=""))
    }
    curves = SimpleNamespace(
        signals=signals, previous=lambda name: f"before {name}" * (name == "a.y"), previous_run=None
    )
    panes = [web.Pane("First", "mm", [web.ChartCurve("a.x")])]
    with one.page:
        made = ChartPanel(curves, panes)
        charts.show_commands(one.console, made)
    made.chart.run_method = lambda *words: sent.append(words)
    return one, made, sent


def shown_panes(panel):
    return [[(curve.name, curve.step, curve.faint) for curve in pane.curves] for pane in panel.chart.panes]


def test_curves_are_dropped_and_removed(chart):
    """A curve joins the pane it is dropped on, else one with its unit, else a new one."""
    one, panel, _ = chart
    x, y, n = ("a.x", False, ""), ("a.y", False, "before a.y"), ("b.n", True, "")
    height = lambda: panel.chart.style["height"]  # noqa: E731
    assert (shown_panes(panel), height()) == ([[x]], "195px")
    one.page.send(panel.chart, "drop", {"name": "b.n", "pane": 1})
    assert (shown_panes(panel), height()) == ([[x], [n]], "360px")
    one.page.send(panel.chart, "remove", {"name": "b.n"})
    assert (shown_panes(panel), height()) == ([[x]], "195px")
    for pane, panes in ((0, [[x, n]]), (None, [[x], [n]]), (-1, [[x], [n]]), ("0", [[x], [n]]), (1, [[x], [n]])):
        one.page.send(panel.chart, "drop", {"name": "b.n", "pane": pane})
        assert shown_panes(panel) == panes
        assert panel.tree._tree.props["ticked"] == ["a.x", "b.n"]
        one.page.send(panel.chart, "remove", {"name": "b.n"})
    one.page.send(panel.chart, "drop", {"name": "a.y"})
    assert shown_panes(panel) == [[x, y]]
    for name in ("none", 3, None, ["a.x"]):
        one.page.send(panel.chart, "drop", {"name": name, "pane": 0})
        one.page.send(panel.chart, "remove", {"name": name})
    one.page.send(panel.chart, "drop", "a.x")
    assert shown_panes(panel) == [[x, y]]


def test_curves_are_limited(chart, monkeypatch):
    _, panel, _ = chart
    monkeypatch.setattr(web.frames, "MAX_CURVES", 2)
    panel.select("a.y", True)
    panel.select("b.n", True)
    assert charts.curve_names(panel.chart) == ["a.x", "a.y"]
    panel.select("a.x", False)
    panel.select("b.n", True)
    assert charts.curve_names(panel.chart) == ["a.y", "b.n"]


def test_the_time_is_followed_or_not(chart):
    """The button has a color while it would do something."""
    one, panel, sent = chart
    one.page.send(panel.chart, "window", {"follow": False})
    assert panel.follow.props["color"] == "accent"
    one.page.change(panel.span, 30.0)
    assert (sent, panel.follow.props.get("color")) == ([("followed", 30.0)], None)
    for action in ({"follow": 1}, {}, None):
        one.page.send(panel.chart, "window", action)
        assert panel.follow.props["color"] == "accent"
        one.page.press("follow")
        assert "color" not in panel.follow.props
    assert sent == [("followed", 30.0)] * 4


@pytest.mark.parametrize(
    ("action", "text"),
    [
        ({"a": 1.5}, "t1: 1.5 s"),
        ({"a": 1.5, "b": 1.5}, "t1: 1.5 s"),
        ({"a": 1.5, "b": "x"}, "t1: 1.5 s"),
        ({"a": 1.5, "b": 2.0}, "from t1 to t2: 0.5 s, 2 Hz"),
        ({"a": 2, "b": 1}, "from t1 to t2: -1 s, 1 Hz"),
        ({"b": 1.0}, ""),
        ({"a": "x", "b": 1.0}, ""),
        (None, ""),
    ],
)
def test_cursors_measure(chart, action, text):
    one, panel, _ = chart
    panel.cursor_label.text = "before"
    one.page.send(panel.chart, "cursors", action)
    assert panel.cursor_label.text == text


def test_commands_are_marks_of_the_chart(chart, monkeypatch):
    """Holds once, at their begin; the latest, with short texts."""
    one, panel, _ = chart
    one.page.tick()
    assert panel.chart.props["marks"] == []
    texts = ["set a.k = 1", "load", "override " + "x" * charts.MARK_WIDTH]
    one.live.done.extend(ExecutedCommand(i, 0.5 * i, "set", text, "") for i, text in enumerate(texts))
    monkeypatch.setattr(charts, "MARKS", 2)
    one.page.tick()
    marks = [
        {"at": 0.5, "text": "load"},
        {"at": 1.0, "text": f"override {'x' * (charts.MARK_WIDTH - 10)}\N{HORIZONTAL ELLIPSIS}"},
    ]
    assert panel.chart.props["marks"] == marks
    one.console.live = None
    one.page.tick()
    assert panel.chart.props["marks"] == []


def test_at_the_end_the_whole_run_is_shown_and_the_selection_says_so(chart, monkeypatch):
    one, panel, sent = chart
    one.page.tick()
    assert sent == []
    monkeypatch.setattr(Host, "has_ended", True)
    one.page.tick()
    assert (sent, panel.span.options[panel.span.value]) == ([("show", None, None)], "whole run")
    one.page.change(panel.span, 30.0)
    assert sent[1:] == [("followed", 30.0)]


def test_leaves_of_the_tree(chart):
    _, panel, _ = chart
    assert panel.leaves()[0] == web.Leaf("a.x", ("a",), "x", "mm", "about a.x")
    assert [leaf.name for leaf in panel.leaves()] == ["a.x", "a.y", "b.n"]
