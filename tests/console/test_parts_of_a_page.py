"""Parts of a page without a server: bar, operator menu, start page, requirements, summary.

Over 400 lines: the parts share one page without a server.
"""

import json
import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("nicegui")

from nicegui import ui

from tests.console.page_without_a_server import Page
from tests.console.without_a_process import Recorder
from twin.console import page, start_page, summary, targets
from twin.console.page import PageContext
from twin.console.session import Host, RunMetrics
from twin.console.verdicts import Row, headline, warning_rows
from twin.errors import TwinError
from twin.scenario.scenario_paths import Overview
from twin.web.operator_lock import NO_OPERATOR, NOT_OPERATOR


class Setting:
    """A page of a console with a session; the calls of both are noted."""

    def __init__(self, monkeypatch, **catalog):
        self.calls = []
        self.state = SimpleNamespace(phase="paused", time=0.0, epoch=1, rate=1.0, message="", folder="")
        defaults = {
            "title": "Rig: slow",
            "variant": "a",
            "variants": {"a": "slow"},
            "scenario": "rig",
            "description": "",
            "wall_clock": False,
            "step": 1e-3,
            "common_step": 5e-3,
            "stop": 10.0,
            "controls": (),
            "scenes": (),
            "start": 0.0,
            "targets": {},
            "warnings": (),
            "fastest_rate": math.inf,
            "judged_until": 10.0,
            "signals": {},
        }
        self.catalog = SimpleNamespace(**defaults | catalog)
        values = {"state": self.state, "catalog": self.catalog, "done": [], "changes": {}, "changed_values": {}}
        self.live = Recorder("live", self.calls, values)
        self.console = Host(live=self.live)
        for name in ("resume", "restart", "stop", "reset", "leave", "begin", "release_hold"):
            setattr(self.console, name, lambda *words, name=name: self.calls.append(("console", name, *words)))
        self.page = Page(monkeypatch)
        self.context = PageContext(self.console, self.page.client)
        self.lock = self.console.operator_lock
        self.lock.enter(self.page.client.id)

    def visible(self):
        return [one.text for one in self.page.elements(ui.button) if one.visible and one.text]


@pytest.fixture
def setting(monkeypatch):
    return lambda **catalog: Setting(monkeypatch, **catalog)


@pytest.mark.parametrize(
    ("phase", "wall_clock", "shown"),
    [
        ("paused", False, ["Run"]),
        ("running", False, ["Pause"]),
        ("running", True, []),
        ("paused", True, ["Run"]),
        ("stopped", False, []),
        ("failed", False, []),
    ],
)
def test_buttons_of_the_bar(setting, phase, wall_clock, shown):
    """A session on drives runs or ends, it is not paused or stepped."""
    one = setting(wall_clock=wall_clock)
    with one.page:
        page._bar(one.context)
    assert one.visible() == ["Run"]
    one.state.phase = phase
    one.page.tick()
    assert [text for text in one.visible() if text in ("Run", "Pause")] == shown
    assert one.page.shown()[len(shown)] == "Rig"  # without the title of the variant
    for label in [] if wall_clock else ["one step of 1 ms", "advance to the next sample of the slowest member (5 ms)"]:
        one.page.press(label)
    if not wall_clock:
        one.page.press("reset")
        one.page.change(one.page.named("pace", ui.select), 0.5)
        assert one.calls == [("live", "step"), ("live", "step_macro"), ("console", "reset"), ("live", "pace", 0.5)]
    one.page.press("run")
    one.page.press("pause")
    assert one.calls[-2:] == [("console", "resume"), ("live", "pause")]


@pytest.mark.parametrize(
    ("variants", "hardware", "options", "labels"),
    [
        ({"a": "slow"}, None, None, ["Rig"]),
        ({"a": "slow", "b": "b"}, None, {"a": "a: slow", "b": "b"}, ["Rig"]),
        ({"a": "slow", "b": "b"}, Path("bench.yaml"), None, ["Rig", "a (set by --variant)"]),
        ({"a": "slow"}, Path("bench.yaml"), None, ["Rig"]),
    ],
)
def test_variants_are_chosen_unless_drives_run(setting, variants, hardware, options, labels):
    one = setting(variants=variants)
    one.console.hardware = hardware
    with one.page:
        page._bar(one.context)
    assert [label.text for label in one.page.elements(ui.label) if label.text] == labels
    choices = [select for select in one.page.elements(ui.select) if select.props["aria-label"] == "variant"]
    assert [(choice.options, choice.value) for choice in choices] == ([(options, "a")] if options else [])
    if choices:
        one.page.change(choices[0], "b")
        assert one.calls == [("console", "restart", "b")]


def test_another_variant_ends_a_run_only_after_a_question(setting):
    """The bar names the loaded variant until the other one is loaded."""
    one = setting(variants={"a": "slow", "b": "b"})
    one.state.phase, one.state.time = "running", 3.0
    with one.page:
        page._bar(one.context)
    choice = one.page.named("variant", ui.select)
    for answer, calls in (("cancel", []), ("end and load", [("console", "restart", "b")])):
        one.page.change(choice, "b")
        assert (choice.value, one.calls) == ("a", [])
        assert "End this run and load b? Its results so far are written." in one.page.shown()  # no time: it goes on
        one.page.send([each for each in one.page.elements(ui.button) if each.text == answer][-1], "click")
        assert one.calls == calls


@pytest.mark.parametrize(("rate", "shown"), [(2.0, 2.0), (3.0, 1.0)])
def test_a_rate_that_is_not_listed_is_shown_as_real_time(setting, rate, shown):
    one = setting()
    one.state.rate = rate
    with one.page:
        page._bar(one.context)
    assert one.page.named("pace", ui.select).value == shown


def test_with_controls_nothing_is_faster_than_real_time(setting):
    """And a pace ends with its session: the next one has that of the command line."""
    one = setting(fastest_rate=1.0)
    with one.page:
        page._bar(one.context)
    pace = one.page.named("pace", ui.select)
    assert list(pace.options) == [0.1, 0.2, 0.5, 1.0]
    one.page.change(pace, 0.5)
    assert (one.calls, one.console.rate) == ([("live", "pace", 0.5)], 1.0)


@pytest.mark.parametrize("description", ["", "Two `rigs` follow a joystick."])
def test_a_description_is_behind_a_button(setting, description):
    """As a tooltip it covered the banner wherever the mouse rested."""
    one = setting(description=description)
    with one.page:
        page._bar(one.context)
    (title,) = [label for label in one.page.elements(ui.label) if label.text == "Rig"]
    assert not [child for slot in title.slots.values() for child in slot.children]
    assert [text.content for text in one.page.elements(ui.markdown)] == [description] * bool(description)


def test_a_command_says_whether_it_was_executed(setting):
    one, results = setting(), []

    def refuse():
        raise TwinError("not now.")

    async def run(what, *arguments):
        results.append(await one.context.run(what, *arguments))

    one.page.run(lambda: run(one.live.pace, 2.0), lambda: run(refuse))
    one.lock.leave(one.page.client.id)
    one.page.run(lambda: run(one.live.pace, 3.0))
    one.lock.operator = "other"
    one.page.run(lambda: run(one.live.pace, 3.0))
    assert (results, one.calls) == ([True, False, False, False], [("live", "pace", 2.0)])
    assert one.page.notes == ["not now.", NO_OPERATOR, NOT_OPERATOR]


def test_the_menu_of_operators(setting, monkeypatch):
    """Whoever operates hands over; a free console is taken."""
    removed = []
    monkeypatch.setattr("nicegui.Client.on_delete", lambda _, call: removed.append(call))
    one = setting()
    with one.page:
        page._top(one.context)
    own = one.page.client.id
    assert one.page.shown() == ["you operate", "This is page 1."]
    one.lock.enter("other")
    assert one.page.shown() == ["you operate", "This is page 1.", "hand over to page 2"]
    one.page.press("hand over to page 2")
    assert (one.lock.operator, one.calls) == ("other", [("console", "release_hold")])
    assert one.page.shown() == ["you watch", "This is page 1.", "The operator can hand over to this page."]
    one.lock.leave("other")
    assert one.page.shown() == ["operate here", "no operator", "This is page 1."]
    one.page.press("operate here")
    assert one.lock.operator == own
    one.lock.leave(own)
    assert one.page.shown() == ["no operator", "This page is not connected yet."]
    for call in removed:
        call()
    assert one.lock.changed == []


@pytest.mark.parametrize("late", [True, False])
def test_a_hand_over_fails_where_the_other_page_has_left(setting, late):
    one = setting()
    with one.page:
        page._top(one.context)
    one.lock.enter("other")
    button = one.page.named("hand over to page 2")
    if late:
        del one.lock.pages["other"]
    one.page.send(button, "click")
    assert one.page.notes == [NOT_OPERATOR] * late


def test_what_a_page_is_about(setting):
    """It is made anew when this changes: another session, a restart, the end of preparations."""
    one = setting()
    assert page._stage(one.console) == ("session", id(one.live), 1)
    one.live.values["catalog"] = None
    assert page._stage(one.console) == ("starting", id(one.live))
    one.console.live = None
    assert page._stage(one.console) == ("pick",)


def test_a_scenario_is_picked(setting, monkeypatch):
    one = setting()
    overviews = {
        "teleoperation": Overview("Robot", "operate", "30 s", True),
        "valve": Overview("Valve", "operate", "", True, "by hand"),
        "beat": Overview("Beat", "force", "2 s"),
    }
    paths = {name: Path(f"{name}.yaml") for name in overviews}
    monkeypatch.setattr(start_page, "recent_and_all", lambda runs: (["beat"], paths))
    monkeypatch.setattr("twin.scenario.scenario_paths.overview", lambda path: overviews[path.stem])
    with one.page:
        start_page.pick(one.context)
    held = "operate by keys or gamepad, until you end it"
    assert one.page.shown() == [
        "Select a scenario",
        *("Start here, and recent", "teleoperation", "Robot", held, "beat", "Beat", "2\N{NO-BREAK SPACE}s"),
        *("Operate", "valve", "Valve", held),
    ]
    pictures = [each.content for each in one.page.elements(ui.html)]
    assert pictures == [start_page.topic_pictures()[topic] for topic in ("operate", "force", "operate")]
    (topic,) = one.page.elements(ui.toggle)
    assert topic.options == ["All", "Operate", "Force on the beating heart"]
    (search,) = one.page.elements(ui.input)
    for text, count in (("valve", 1), (None, 3), ("none", 0), ("operate", 2)):
        one.page.change(search, text)
        cards = [each for each in one.page.elements() if "twin-pick" in each.classes]
        assert len(cards) == count
    one.page.send(cards[1], "click")
    assert one.calls == [("console", "begin", Path("valve.yaml"), "by hand")]
    for text, begun in (("operate", []), ("none", []), ("beat", ["beat.yaml"]), ("robot", ["teleoperation.yaml"])):
        one.calls.clear()
        one.page.change(search, text)
        one.page.send(search, "keydown.enter")  # one match, however often it is listed
        assert [str(path) for _, _, path, _ in one.calls] == begun


def test_recent_scenarios_are_the_last_that_ran(monkeypatch, tmp_path):
    import os

    names = [f"s{i}" for i in range(start_page.MAX_RECENT + 1)]
    monkeypatch.setattr("twin.scenario.scenario_paths.scenarios", lambda: dict.fromkeys(names, Path()))
    for i, name in enumerate([*names, "other"]):
        (tmp_path / name).mkdir()
        os.utime(tmp_path / name, (i, i))
    recent, every = start_page.recent_and_all(tmp_path)
    assert (recent, list(every)) == (names[:0:-1], names)
    assert start_page.recent_and_all(tmp_path / "none")[0] == []


def test_a_session_is_prepared_or_fails(setting):
    one = setting()
    one.console.scenario = Path("x/rig.yaml")
    with one.page:
        start_page.starting(one.context)
    (busy,) = one.page.elements(ui.spinner)
    assert (one.page.shown(), busy.visible) == (["rig", "starting a process for the session, 0 s"], True)
    one.state.message = "building pump (1 of 3)"
    one.page.tick()
    rig, message, note = one.page.shown()
    assert (rig, message, busy.visible) == ("rig", "building pump (1 of 3), 0 s", True)
    assert note.startswith("Only the first time")
    one.state.phase, one.state.message = "failed", "no compiler."
    one.page.tick()
    assert (one.page.shown(), busy.visible) == (["rig", "no compiler.", "another scenario"], False)
    one.page.press("another scenario")
    assert one.calls == [("console", "leave")]
    one.console.live = None
    one.page.tick()
    assert one.page.shown()[1] == "no compiler."


def test_requirements_are_judged_once_rows_are_there(setting, monkeypatch):
    one, judged = setting(), [[]]
    monkeypatch.setattr(summary, "JUDGE_PERIOD", 0.0)
    verdicts = SimpleNamespace(
        live=one.live,
        rows=lambda *_: judged[0],
        catalog=SimpleNamespace(start=0.0, judged_until=0.0, targets={}, controls=()),
    )
    one.state.epoch = 0
    one.console.latest_metrics = RunMetrics("earlier", {"mean; of ten seconds": 1.25}, "b, 10:15")
    with one.page:
        summary.judged(one.console, verdicts, failed := ui.label())
    force = SimpleNamespace(unit="N", is_difference=False)
    mean = Row("", "mean; of ten seconds", "1 N; reference 2 N", True, force, 1.0, 2.0)
    judged[0] = [Row("pass", "near", "3 mm"), Row("fail", "fast", "2 s"), mean]
    one.page.tick()
    assert one.page.shown() == ["Run to judge them."]
    one.state.epoch = 1
    one.page.tick()
    details = ["before: b, 10:15", "near", "3 mm", "fast", "2 s"]
    assert failed.text == "Not met: fast"
    assert one.console.latest_metrics.values == {mean.name: 1.0}
    assert one.page.shown() == [failed.text, "1 failed · 1 passed", *details]
    (table,) = one.page.elements(ui.html)
    cells = re.findall(r"<t[dh](?: [^>]*)?>([^<]*)", table.content)  # each row in one unit with equal decimals
    assert cells == ["", "now", "before", "reference", "mean [N]", "1.00", "1.25", "2.00"]
    icons = one.page.elements(ui.icon)
    assert [icon.props["aria-label"] for icon in icons] == ["pass", "fail"]
    assert [icon.props["name"] for icon in icons] == ["check_circle", "cancel"]
    one.page.tick()
    assert one.page.elements(ui.icon) == icons  # unchanged
    judged[0] = [Row("waiting", "near", "later")]
    one.page.tick()
    assert [icon.props["name"] for icon in one.page.elements(ui.icon)] == ["schedule"]
    assert not failed.visible
    shown = one.page.shown()
    for judged[0], verdicts.live in (
        ([], one.live),
        ([Row("pass", "x", "y")], SimpleNamespace(state=one.state, rows=None)),
    ):
        one.page.tick()
        assert one.page.shown() == shown


def test_a_row_of_metrics_has_equal_decimals():
    """Of a small number too: -7.809e-05 stood beside 0.0003701."""
    newton = SimpleNamespace(unit="N", is_difference=False)
    row = Row("", "mean", "", True, newton, -7.809e-05)
    assert summary.metric_texts(row, 0.0003701) == ["-0.0000781", "0.0003701", ""]
    assert summary.metric_texts(Row("", "late", "from 12 s", True, newton), 1.0) == ["from 12 s", "", ""]


def test_a_metric_is_compared_once_its_window_has_ended_and_the_run_before_stays_within_reach(setting):
    one, newton = setting(), SimpleNamespace(unit="N", is_difference=False)
    with one.page:
        for is_final in (False, True):
            row = Row("", "mean", "", True, newton, 1.0, is_final=is_final)
            summary.metric_table([row], before := RunMetrics("earlier", {"mean": 2.0}, "a, 10:15", "runs/rig/1"))
        summary.run_before(before)
    assert ["before" in table.content for table in one.page.elements(ui.html)] == [False, True]
    links = {link.text: link.props["href"] for link in one.page.elements(ui.link)}
    assert links == {"report of the run before": "/report?before", "its replay": "/signals?before"}


def test_the_new_run_comes_before_that_before_it_and_the_next_variant_is_offered(setting, tmp_path):
    one = setting(variants={"a": "slow", "b": "fast", "c": "by hand"})
    (tmp_path / "report.html").touch()
    one.state.phase, one.state.folder = "stopped", str(tmp_path)
    one.console.latest_metrics = RunMetrics("earlier", {"mean": 1.0}, "a, 10:15", "runs/rig/1")
    with one.page:
        summary.banner(one.context)
    one.page.tick()
    shown = one.page.shown()
    links = ["report", "replay and signals", "again with b", "report of the run before"]
    assert [text for text in shown if text in links] == links
    assert "again with c" not in shown
    one.page.press("again with b")
    assert one.calls == [("console", "restart", "b")]


def test_a_run_at_other_values_has_the_words_and_the_color_of_its_report(setting):
    """Passed was green, and two comparisons with the paper were in no count."""
    one, newton = setting(), SimpleNamespace(unit="N", is_difference=False)
    one.live.values["changes"][one.state.epoch] = {"controller.setpoint": 3.0}
    rows = [
        Row("pass", "near", "3 mm"),
        Row("not judged", "as the paper", "", is_outside=True),
        Row("not judged", "error", "", True, newton, 0.0355),
    ]
    one.context.verdicts = SimpleNamespace(rows=lambda *_: rows)
    one.state.phase = "stopped"
    with one.page:
        summary.banner(one.context)
    one.page.tick()
    text = "1 of 1 requirements met, 2 not judged, 1 of these outside of nominal limits"
    assert one.page.shown()[:3] == ["Passed", text, "not at the paper's settings"]
    for label in ("Passed", "not at the paper's settings"):
        assert "twin-warn" in one.page.named(label).classes


def test_the_end_is_judged_together_with_its_card(setting):
    """A judgment that takes long left the table of an earlier time beside the card."""
    one, calls = setting(), []
    catalog = SimpleNamespace(start=0.0, judged_until=10.0, targets={}, controls=())
    rows = lambda *_: [Row("pass", f"number {calls.append(1) or len(calls)}", "")]  # noqa: E731
    one.state.phase, one.state.time = "running", 5.0
    with one.page:
        summary.judged(one.console, SimpleNamespace(live=one.live, rows=rows, catalog=catalog), ui.label())
    one.page.tick()
    one.page.tick()
    assert len(calls) == 1
    one.state.phase, one.state.time = "paused", 10.0
    one.page.tick()
    one.page.tick()
    assert len(calls) == 2


@pytest.mark.parametrize("part", ["list", "card"])
def test_a_page_that_is_built_anew_while_it_judges_uses_no_deleted_element(setting, monkeypatch, part):
    """Else NiceGUI prints that the application has a bug, with a stack."""
    one, warned = setting(), []
    monkeypatch.setattr("nicegui.helpers.warn_once", lambda text, **_: warned.append(text))

    def rows(*_):
        one.page.client.layout.clear()
        return [Row("pass", "near", "3 mm")]

    catalog = SimpleNamespace(start=0.0, judged_until=0.0, targets={}, controls=())
    one.context.verdicts = SimpleNamespace(live=one.live, rows=rows, catalog=catalog)
    with one.page:
        if part == "list":
            summary.judged(one.console, one.context.verdicts, ui.label())
        else:
            summary.banner(one.context)
    one.state.phase = "stopped"
    one.page.tick()
    assert warned == []


def test_slow_judgments_leave_the_server_to_the_joysticks(setting, monkeypatch):
    """One of 0.2 s is followed by a pause of two seconds."""
    one, clock, calls = setting(), [100.0], []

    def rows():
        calls.append(clock[0])
        clock[0] += 0.2
        return [Row("pass", f"number {len(calls)}", "")]

    monkeypatch.setattr(summary.time, "monotonic", lambda: clock[0])
    one.state.epoch = 1
    verdicts = SimpleNamespace(
        live=one.live, rows=rows, catalog=SimpleNamespace(start=0.0, judged_until=0.0, targets={}, controls=())
    )
    with one.page:
        summary.judged(one.console, verdicts, ui.label())
    for clock[0] in (100.0, 101.0, 102.1, 103.0):
        one.page.tick()
    assert calls == [100.0, 103.0]


AGAIN, END = "again: change and compare", "End: replay and report"


@pytest.mark.parametrize(
    ("changes", "controls", "shown"),
    [
        ({"time": 9.9}, (), []),
        (
            {"time": 10.0},
            (),
            ["The scenario has reached its end, 10 s. Run continues beyond it.", END, AGAIN],
        ),
        ({"time": 10.0}, ("hand",), []),
        ({"time": 10.0, "phase": "running"}, (), []),
        ({"phase": "stopped"}, (), ["Ended at 0 s.", AGAIN, "another scenario"]),
        ({"phase": "failed", "message": "lost."}, (), ["Failed: lost.", AGAIN, "another scenario"]),
        (
            {"phase": "stopped", "folder": "runs/rig/1", "time": 10.0},
            ("hand",),
            [
                "Completed at 10 s.",
                "replay and signals",
                "again",
                "another scenario",
                "Results: runs/rig/1",
            ],
        ),
    ],
)
def test_the_end_of_a_session(setting, changes, controls, shown):
    one = setting(controls=controls)
    one.console.variant = "a"
    with one.page:
        summary.banner(one.context)
    (row,) = one.page.elements(ui.row)
    assert (one.page.shown(), row.visible) == ([], False)
    vars(one.state).update(changes)
    one.page.tick()
    assert (one.page.shown(), row.visible) == (shown, bool(shown))
    links = {each.text: each.props["href"] for each in one.page.elements(ui.button) if "href" in each.props}
    assert links == ({"replay and signals": "/signals"} if "folder" in changes else {})
    calls = {
        END: ("console", "stop"),
        AGAIN: ("console", "restart", "a") if "phase" in changes else ("console", "reset"),
        "again": ("console", "restart", "a"),
        "another scenario": ("console", "leave"),
    }
    pressed = [text for text in shown if text in calls]
    for text in pressed:
        one.page.press(text)
    assert one.calls == [calls[text] for text in pressed]
    labels = one.page.elements(ui.label)
    one.page.tick()
    assert one.page.elements(ui.label) == labels


def test_the_summary_of_a_session_that_was_left_is_not_filled(setting):
    """Its timer may be called while the next one starts, which has no catalog yet."""
    one = setting()
    with one.page:
        summary.banner(one.context)
    one.state.phase = "stopped"
    one.console.live = SimpleNamespace(state=one.state, catalog=None)
    one.page.tick()
    assert one.page.shown() == []


def test_values_that_were_set_by_hand_stay_unless_nominal_ones_are_chosen(setting):
    one = setting()
    one.live.values["changed_values"] = {"wall.stiffness": 2.0}
    one.state.phase = "stopped"
    with one.page:
        summary.banner(one.context)
    one.page.tick()
    for text in (AGAIN, "again with nominal values"):
        one.page.press(text)
    assert one.calls == [("console", "restart", None), ("console", "restart", None, True)]


FORCE = SimpleNamespace(factor=1.0, offset=0.0, display_unit="N", recorded=False)
TIP = SimpleNamespace(factor=1e3, offset=0.0, display_unit="mm", recorded=True)
GOALS = {"signal": "tip.x", "tolerance": 1e-3, "points": {"near": [0.01]}}
LOUD = {"signal": "wall.force", "above": 2.0, "below": -2.0, "text": "high force"}
BENT = {"signal": "wall.bent", "above": 0, "text": "it buckles"}


@pytest.mark.parametrize(
    ("force", "bent", "goal", "verdict", "kind", "rows"),
    [
        ([0.5, 1.0, 1.5], 0, 0.01, "pass", "Passed", []),
        ([0.5, 1.0, 1.5], 0, 0.03, "pass", "Targets left", []),
        ([0.5, 1.0, 1.5], 0, 0.01, "waiting", "Ended early", []),
        ([0.5, 4.891, 2.5], 0, 0.01, "pass", "Failed", []),
        ([0.5, -3.1, 1.5], 0, 0.01, "pass", "Failed", []),
        ([0.5, 1.0, 1.5], 1, 0.01, "pass", "Failed", []),
        ([0.5, 1.0, 1.5], 0, 0.01, "fail", "Failed", ["Not met: behind", "-45 mm"]),
    ],
)
def test_the_result_of_a_session_counts_safety(setting, force, bent, goal, verdict, kind, rows):
    """All targets reached with a high force is no success; the card has the peak, and how long it was exceeded."""
    one = setting(targets=GOALS | {"points": {"near": [goal]}}, warnings=(LOUD, BENT), every=0.5)
    one.catalog.signals = {"wall.force": FORCE, "wall.bent": FORCE, "tip.x": TIP}
    values = {"wall.force": np.array(force), "wall.bent": np.array([0, bent, 0]), "tip.x": np.array([0.0, 0.005, 0.01])}
    one.live.values["read"] = lambda names: SimpleNamespace(
        time=np.array([0.0, 0.5, 1.0]), values={name: values[name] for name in names}
    )
    one.context.verdicts = SimpleNamespace(
        rows=lambda *_: [Row(verdict, "behind", "-45 mm"), Row("", "mean", "1 N", True)]
    )
    with one.page:
        summary.banner(one.context)
    one.page.tick()
    assert one.page.shown() == []
    one.state.phase = "stopped"
    one.page.tick()
    shown = one.page.shown()
    card = shown[: shown.index("Ended at 0 s.")]  # first
    count = sum(abs(value) > 2.0 for value in force)
    loud = f"for {0.5 * count:.1f} s; largest {max(map(abs, force)):.4g} N, limit 2 N"
    state = (
        "All 1 targets reached in 1.0 s since the first motion, path length 10 mm"
        if goal == 0.01
        else "0 of 1 targets; 1.0 s since"
    )
    targets = (
        ["All 1 targets reached", "near at 1.0 s of the session"]
        if goal == 0.01
        else ["1 of 1 targets not reached: near", ""]
    )
    warned = ["Warning: high force", loud] * bool(count) + ["Warning: it buckles", "for 0.5 s"] * bool(bent)
    assert card[0] == kind
    assert card[1].startswith(state)
    assert card[2:] == [*filter(None, targets), *rows, *warned]  # what did not happen is no result


def test_a_warning_that_was_not_shown_is_no_requirement(setting, monkeypatch):
    """It is listed. A metric of a run that was changed by hand says so in the next run."""
    monkeypatch.setattr(summary, "JUDGE_PERIOD", 0.0)
    one = setting(warnings=(LOUD,), every=0.5)
    one.catalog.signals = {"wall.force": FORCE}
    one.live.values["read"] = lambda _: SimpleNamespace(
        time=np.array([0.0, 0.5]), values={"wall.force": np.array([0.0, 1.0])}
    )
    rows = [Row("pass", "near", "3 mm"), Row("not judged", "far", ""), Row("", "mean", "1 N", True, None, 1.0)]
    catalog = SimpleNamespace(start=0.0, judged_until=0.0, targets={}, controls=())
    one.live.values["changes"][one.state.epoch] = {"wall.stiffness": 0.0}
    with one.page:
        summary.judged(one.console, SimpleNamespace(live=one.live, rows=lambda *_: rows, catalog=catalog), ui.label())
    one.state.time = -1.0
    one.page.tick()
    assert one.page.elements(ui.icon)[-1].props["name"] == "schedule"  # no green tick before anything has moved
    one.state.time = 0.0
    one.page.tick()
    assert {"1 of 1 requirements met, 1 not judged", "No warning: high force"} <= set(one.page.shown())
    assert one.page.elements(ui.icon)[-1].props["name"] == "check_circle"
    assert one.console.latest_metrics.values == {"mean": 1.0}
    assert one.console.latest_metrics.title.startswith("a, changed by hand, ")


def test_warnings_count_until_the_last_target(setting):
    """Also in the line above the picture; what is shown later is added live, and to the card once the session is over."""
    one = setting(targets=GOALS, warnings=(LOUD,), every=0.5)
    one.catalog.signals = {"wall.force": FORCE, "tip.x": TIP}
    values = {"wall.force": np.array([0.5, 2.5, -1.0, 4.9, -4.0]), "tip.x": np.array([0.0, 0.005, 0.01, 0.01, 0.01])}
    one.live.values["read"] = lambda names: SimpleNamespace(
        time=0.5 * np.arange(5), values={name: values[name] for name in names}
    )
    detail = "for 0.5 s; largest 2.5 N, limit 2 N"
    end = targets.session_score(one.live).end
    assert end == 1.0
    later = "after the last target, not judged: for 1.0 s, largest 4.9 N"
    assert [row.detail for row in warning_rows(one.live, end)] == [f"{detail}; {later}"]  # of the live line
    assert [row.detail for row in summary.session_result(one.live, None).warnings] == [detail]  # of a card that stays
    one.state.phase = "stopped"
    (row,) = summary.session_result(one.live, None).warnings
    assert (row.verdict, row.detail, row.is_warned) == ("fail", f"{detail}; {later}", False)
    values["wall.force"][1] = 1.0  # then it is no failure, and amber on the card
    result = summary.session_result(one.live, None)
    (row,) = result.warnings
    assert (row.verdict, row.detail, row.is_warned) == ("pass", f"never; largest 1 N, limit 2 N; {later}", True)
    with one.page:
        summary.result_card(result, one.console.latest_metrics)
    assert {"Passed", "Warning: high force", row.detail} <= set(one.page.shown())


def test_the_last_target_is_announced_and_a_session_that_ended_early_has_not_passed(setting, tmp_path):
    """With the next steps, once no control is held; the folder says why a session ended early."""
    one = setting(targets=GOALS)
    one.catalog.signals = {"tip.x": TIP}
    one.live.values["read"] = lambda _: SimpleNamespace(
        time=np.array([0.0, 1.0]), values={"tip.x": np.array([0.0, 0.01])}
    )
    one.state.phase, one.context.score = "running", targets.Score({})
    with one.page:
        summary.banner(one.context)
    one.page.tick()
    assert one.page.shown() == []
    one.context.score = targets.session_score(one.live)
    one.state.held = {"command.speed": 0.04}
    one.page.tick()
    assert one.page.shown() == []  # it would move the joystick under the pointer
    one.state.held = {}
    one.context.verdicts = SimpleNamespace(
        rows=lambda *_: [Row("fail", "behind", "-45 mm"), Row("waiting", "late", "")]
    )
    one.page.tick()
    score = "All 1 targets reached in 1.0 s since the first motion, path length 10 mm"
    assert one.page.shown() == [
        *("Failed", score, "All 1 targets reached", "near at 1.0 s of the session", "Not met: behind", "-45 mm"),
        *(END, AGAIN),
    ]
    for text in (END, AGAIN):
        one.page.press(text)
        assert not one.page.named(text).enabled  # for the second click of a double click
    assert one.calls == [("console", "stop"), ("console", "reset")]
    reason = "a, seed 1: ended early, at 1 s: the operator ended it before the end of the scenario, 10 s."
    (tmp_path / "summary.json").write_text(json.dumps({"status": "interrupted", "reason": reason}))
    (tmp_path / "report.html").touch()
    one.context.verdicts = SimpleNamespace(rows=lambda *_: [Row("pass", "near", "3 mm")])
    one.state.phase, one.state.folder = "stopped", str(tmp_path)
    one.page.tick()
    shown = one.page.shown()
    assert "report" in shown
    assert shown[:5] == ["Ended early", score, reason, "All 1 targets reached", "near at 1.0 s of the session"]


def test_the_result_counts_what_the_list_counts(setting):
    """A metric far from its reference is no requirement, and is listed."""
    one = setting()
    rows = [
        Row("pass", "near", "3 mm"),
        Row("fail", "error", "9 mN; reference 5 mN", True),
        Row("", "mean", "1 N", True),
    ]
    one.context.verdicts = SimpleNamespace(rows=lambda *_: rows)
    one.state.phase = "stopped"
    with one.page:
        summary.banner(one.context)
    one.page.tick()
    assert one.page.shown()[:4] == [
        "Failed",
        headline(rows, True),
        "Far from its reference: error",
        "9 mN; reference 5 mN",
    ]


def test_a_scenario_without_an_end_does_not_reach_it(setting):
    one = setting(stop=0.0)
    with one.page:
        summary.banner(one.context)
    assert one.page.shown() == []
