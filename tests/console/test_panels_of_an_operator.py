"""Sections of the operator's panel on a page without a server: what they show, and what the session is asked to do.

Over 400 lines: the panels of one session share its fixtures.
"""

from types import SimpleNamespace

import pytest

pytest.importorskip("nicegui")

from nicegui import ui

from tests.console.page_without_a_server import Page
from tests.console.without_a_process import Recorder
from twin.console import operator_panel, safety, targets
from twin.console.operator_panel import MAX_MATCHES
from twin.console.page import PageContext, changes
from twin.console.session import Host
from twin.errors import TwinError
from twin.live import ExecutedCommand, RefusedError
from twin.web.operator_lock import NO_OPERATOR


def signal(name, type="Float64", start=1.0, *, factor=1.0, offset=0.0, low=None, high=None, **more):  # noqa: A002
    values = {"kind": "parameter", "shape": (), "items": {}, "settable": True, "display_unit": "mm", "member": "a"}
    more = values | {"description": f"about {name}"} | more
    return SimpleNamespace(
        name=name, type=type, start=start, factor=factor, offset=offset, minimum=low, maximum=high, **more
    )


class Setting:
    """A page that operates a session, whose calls are noted."""

    def __init__(self, monkeypatch, *signals, **catalog):
        self.calls = []
        self.state = SimpleNamespace(phase="paused", values={}, overridden={}, time=0.0, epoch=1, hardware=None)
        defaults = {
            "controls": (),
            "start": 0.0,
            "events": (),
            "parameters": {},
            "scenario": "rig",
            "targets": None,
            "warnings": (),
        }
        self.catalog = SimpleNamespace(signals={one.name: one for one in signals}, **defaults | catalog)
        values = {"state": self.state, "catalog": self.catalog, "done": [], "changes": {}, "changed_values": {}}
        self.live = Recorder("live", self.calls, values)
        self.console = Host(live=self.live)
        self.page = Page(monkeypatch)
        monkeypatch.setattr(operator_panel, "write_text", lambda field, text, **_: field.set_value(text))
        self.context = PageContext(self.console, self.page.client)
        self.console.operator_lock.enter(self.page.client.id)


@pytest.fixture
def setting(monkeypatch):
    return lambda *signals, **catalog: Setting(monkeypatch, *signals, **catalog)


def test_a_number_is_entered_in_its_display_unit(setting):
    """It is set with Enter, or when the field is left with another value; the slider between the bounds follows."""
    one = setting()
    stiffness = signal("a.k", start=0.004, factor=1e3, offset=2.0, low=0.0, high=0.01)
    with one.page:
        operator_panel.row(one.context, one.live, "a.k", stiffness)
    (field,), (slider,) = one.page.elements(ui.input), one.page.elements(ui.slider)
    assert (field.value, field.props["suffix"], field.props["inputmode"]) == ("6", "mm", "decimal")
    assert (slider.value, slider.props["min"], slider.props["max"], slider.props["step"]) == (6.0, 2.0, 12.0, 0.05)
    one.page.send(field, "blur", "6.0")
    assert one.calls == []  # as it was
    one.page.send(field, "blur", "7")
    assert one.calls == [("live", "set", "a.k", pytest.approx(0.005))]
    assert (slider.value, field.props["bg-color"]) == (7.0, "positive")
    ((period, restore, once),) = one.page.timers
    assert (period, once) == (0.6, True)
    restore()
    assert "bg-color" not in field.props
    one.page.send(field, "keydown.enter", " 0.6 cm ")
    one.page.send(field, "blur", " 0.6 cm ")  # Enter takes the focus away
    assert one.calls[1:] == [("live", "set", "a.k", pytest.approx(0.004))]  # also back to where it began
    assert field.value == "6"
    one.page.change(slider, 2.0)
    one.page.send(slider, "change")
    assert one.calls[2:] == [("live", "set", "a.k", 0.0)]
    assert field.value == "2"


def test_nothing_is_written_into_a_field_with_the_focus(setting):
    """What the server sends between two keys would replace what is typed: -0.5 was executed as 0.5."""
    one = setting()
    with one.page:
        operator_panel.row(one.context, one.live, "a.k", signal("a.k", start=3.0))
    (field,) = one.page.elements(ui.input)
    sent = []
    field.update = lambda: sent.append(field.value)
    for partial in ("-", "-0", "-0.", "-0.5"):
        one.page.send(field, "update:value", partial)
    assert sent == []
    one.page.send(field, "keydown.enter", "-0.5")
    assert (one.calls, field.value) == ([("live", "set", "a.k", -0.5)], "-0.5")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("1.9", "1.9 is refused: at least 2 mm."),
        ("12.1", "12.1 is refused: at most 12 mm."),
        ("", "Expected a number."),
        ("4,5", "4,5: write a decimal point, not a comma."),
        ("ten", "`ten` is not a quantity. Write a number and a unit: 0.2 mm."),
        ("5 N", "`5 N` does not convert to mm."),
    ],
)
def test_a_number_that_is_refused_is_not_executed(setting, text, why):
    """Enter leaves it to be corrected; when the field is left, it has the value in force again, with the reason for a while."""
    one = setting()
    stiffness = signal("a.k", start=0.004, factor=1e3, offset=2.0, low=0.0, high=0.01)
    with one.page:
        operator_panel.row(one.context, one.live, "a.k", stiffness)
    (field,), (slider,) = one.page.elements(ui.input), one.page.elements(ui.slider)
    field.value = text
    one.page.send(field, "keydown.enter", text)
    assert (field.value, field.error, one.calls) == (text, f"{why} Still 6 mm.", [])
    one.page.send(field, "blur", text)
    assert (field.value, field.error, one.calls) == ("6", f"{why} Still 6 mm.", [])
    assert slider.value == 6.0  # what is in force
    one.page.tick()
    assert field.error is None
    field.value = text
    one.page.send(field, "keydown.escape")
    assert (field.value, one.calls) == ("6", [])


def test_a_number_that_the_session_refuses_goes_back(setting):
    one = setting()

    def refuse(*_):
        raise RefusedError("the log of this session is full.")

    one.live.values["set"] = refuse
    with one.page:
        operator_panel.row(one.context, one.live, "a.k", signal("a.k", low=0.0, high=4.0))
    (field,), (slider,) = one.page.elements(ui.input), one.page.elements(ui.slider)
    field.value = "3"
    one.page.send(field, "blur", "3")
    assert (field.value, slider.value, one.page.notes) == ("1", 1.0, ["the log of this session is full."])


def test_nothing_can_be_changed_after_the_end(setting):
    one = setting(signal("a.x"), events=())
    with one.page:
        operator_panel.panel(one.context, lambda: None)
    sections = {each.text: each for each in one.page.elements(ui.expansion)}
    one.page.tick()
    assert not any("inert" in each.props for each in sections.values())
    one.state.phase = "finishing"  # the results are written
    one.page.tick()
    locked = [text for text, each in sections.items() if "inert" in each.props]
    assert locked == ["Inputs and parameters", "Override outputs"]  # the commands can still be downloaded


def test_changed_values_are_marked_with_their_nominal_value(setting):
    """Also in the next variant, which begins with them; one button sets all of them back, while the session lasts."""
    one = setting(signal("a.k", factor=1e3), signal("a.b", type="Boolean", start=False), parameters={"a.k": None})
    with one.page:
        changes(one.context)
        operator_panel.values(one.context, one.live, one.catalog.signals)
    assert one.page.shown() == []
    one.live.values["changed_values"] = {"a.k": 2.5, "a.b": True}
    one.page.tick()
    line = "Changed by hand: a.k 2500 mm (nominal 1000); a.b true (nominal false)"
    assert one.page.shown() == [line, "nominal values", "nominal 1000 mm"]
    one.page.press("nominal values")
    assert one.calls == [("live", "set", "a.k", 1.0), ("live", "set", "a.b", False)]
    one.state.phase = "stopped"
    one.page.tick()
    assert one.page.shown() == [line, "nominal 1000 mm"]
    one.live.values["changed_values"] = {}
    one.page.tick()
    assert one.page.shown() == []


@pytest.mark.parametrize(
    ("name", "options", "ends", "shown"),
    [
        ("a.k", {}, None, None),
        ("a.k", {"low": 0.0}, None, None),
        ("a.k", {"high": 3.0}, None, None),
        ("a.k", {"low": 0.0, "high": 0.0}, None, None),
        ("a.k", {"low": 0.0, "high": 4.0}, None, (0.0, 4.0, 0.02, 1.0)),
        ("a.k", {"low": 0.0, "high": 4.0}, (2.0, 3.0), (2.0, 3.0, 0.005, 2.0)),
        ("a.k", {}, (0.0, 0.5), (0.0, 0.5, 0.0025, 0.5)),
        ("a.k[1]", {"low": 0.0, "high": 4.0, "start": [1.0]}, None, None),
    ],
)
def test_a_slider_needs_two_ends_and_a_scalar(setting, name, options, ends, shown):
    one = setting()
    with one.page:
        operator_panel.row(one.context, one.live, name, signal("a.k", **options), ends)
    sliders = [
        (*(each.props[key] for key in ("min", "max", "step")), each.value) for each in one.page.elements(ui.slider)
    ]
    assert sliders == ([shown] if shown else [])


@pytest.mark.parametrize(("kind", "value"), [("Int32", 3), ("UInt8", 3), ("Float64", 2.7)])
def test_whole_numbers_are_rounded(setting, kind, value):
    one = setting()
    one.state.values["a.n"] = 5
    with one.page:
        operator_panel.row(one.context, one.live, "a.n", signal("a.n", kind, 0))
    (field,) = one.page.elements(ui.input)
    assert field.value == "5"  # as it is now, not its start
    one.page.send(field, "keydown.enter", "2.7")
    ((*_, found),) = one.calls
    assert (found, type(found)) == (value, type(value))


def test_a_switch_and_a_choice(setting):
    one = setting()
    with one.page:
        operator_panel.row(one.context, one.live, "a.on", signal("a.on", "Boolean", True))
        operator_panel.row(one.context, one.live, "a.mode", signal("a.mode", "Int32", 2, items={"idle": 0, "run": 2}))
        operator_panel.row(one.context, one.live, "a.odd", signal("a.odd", "Int32", 9, items={"idle": 0}))
    (switch,), (mode, odd) = one.page.elements(ui.switch), one.page.elements(ui.select)
    assert (switch.value, mode.value, mode.options, odd.value) == (True, 2, {0: "idle", 2: "run"}, None)
    one.page.change(switch, False)
    one.page.change(mode, 0)
    one.page.change(switch, True)
    assert one.calls == [
        ("live", "set", "a.on", False),
        ("live", "set", "a.mode", 0),
        ("live", "set", "a.on", True),
    ]
    assert one.page.elements(ui.input) == []


def test_only_the_operator_sets_values_and_a_refusal_is_shown(setting):
    one = setting()

    def refuse(*_):
        raise RefusedError("not while it moves.")

    with one.page:
        operator_panel.row(one.context, one.live, "a.on", signal("a.on", "Boolean", True))
    (switch,) = one.page.elements(ui.switch)
    one.live.values["set"] = refuse
    one.page.change(switch, False)
    one.console.operator_lock.leave(one.page.client.id)
    one.page.change(switch, True)
    assert (one.calls, one.page.notes) == ([], ["not while it moves.", NO_OPERATOR])


def named_rows(page):
    """Names of the listed values, as one reads them, and what stands below."""
    names = [element.content for element in page.elements(ui.html)]
    assert all("_<wbr>" in name or "_" not in name for name in names)  # a long name does not break within a word
    return [*(name.replace("<wbr>", "") for name in names), *page.shown()]


def test_values_are_listed_and_found(setting):
    """At first those of the scenario, and what was changed; each word of a search counts, also in a description."""
    names = [f"a.p_{i:02}" for i in range(MAX_MATCHES + 2)]
    one = setting(parameters={"a.p_03": (0.0, 2.0), "a.gone": (0.0, 1.0)})
    one.state.values["a.p_01"] = 5.0
    settable = {name: signal(name, description="Spring" * (name == "a.p_02")) for name in names}
    with one.page:
        operator_panel.values(one.context, one.live, settable)
    assert named_rows(one.page) == ["a.p_03", "a.p_01"]
    assert len(one.page.elements(ui.slider)) == 1
    search = one.page.elements(ui.input)[0]
    assert search.props["placeholder"] == f"search {len(names)} inputs and parameters"
    for text, shown in (
        ("spring P_02", ["a.p_02"]),
        ("spring p_03", ["No value matches."]),
        ("a.p", [*names[:MAX_MATCHES], "and 2 more: refine the search"]),
        ("a.p_0", names[:10]),
        (None, ["a.p_03", "a.p_01"]),
    ):
        one.page.change(search, text)
        assert named_rows(one.page) == shown


def test_exactly_as_many_as_are_listed_need_no_further_search(setting):
    one = setting()
    with one.page:
        operator_panel.values(one.context, one.live, {f"a.p{i}": signal(f"a.p{i}") for i in range(MAX_MATCHES)})
        operator_panel.values(one.context, one.live, {})
    one.page.change(one.page.elements(ui.input)[0], "a.p")
    rows = named_rows(one.page)
    assert (len(rows), rows[-1]) == (MAX_MATCHES + 1, "No value can be set while the session runs.")


def test_outputs_are_overridden_and_released(setting):
    """Scalars only; a number is sent as such, a text with its unit."""
    outputs = [signal("a.x", kind="output", factor=1e3), signal("a.v", kind="output", shape=(2,)), signal("a.k")]
    one = setting(*outputs, signal("a.s", "String", kind="output"))
    with one.page:
        operator_panel.overrides(one.context, one.live)
    (choice,), (text,) = (
        one.page.elements(ui.select),
        [field for field in one.page.elements(ui.input) if "aria-label" in field.props],
    )
    assert choice.options == ["a.x"]
    for value in ("", "  ", None):
        one.page.change(text, value)
        one.page.press("override")
    one.page.change(text, "0.6 N")
    one.page.press("override")
    assert one.calls == []  # no output is chosen
    one.page.change(choice, "a.x")
    assert text.props["suffix"] == "mm"
    for value in ("0.6 cm", "2", "0,5", "TRUE", " "):
        one.page.change(text, value)
        one.page.press("override")
    assert one.calls == [("live", "override", "a.x", value) for value in (pytest.approx(6e-3), 2e-3, True)]
    assert one.page.notes == ["0,5: write a decimal point, not a comma."]
    one.page.tick()
    assert "release" not in one.page.shown()
    one.state.overridden["a.x"] = 2.0
    one.page.tick()
    assert one.page.shown()[-2:] == ["a.x = 2.0", "release"]
    one.page.press("release")
    assert one.calls[3:] == [("live", "release", "a.x")]
    (shown,) = [label for label in one.page.elements(ui.label) if label.text == "a.x = 2.0"]
    one.page.tick()
    assert shown in one.page.elements(ui.label)  # unchanged: not made anew
    one.state.overridden.clear()
    one.page.tick()
    assert "release" not in one.page.shown()


def test_commands_are_listed_the_latest_first(setting, monkeypatch):
    control = SimpleNamespace(input="a.x", along=(), rest=0.0, label="hand", factor=1e3, offset=0.0, display_unit="mm")
    one = setting(controls=(control,))
    with one.page:
        operator_panel.done(one.context, one.live)
    assert one.page.shown() == ["download as scenario", "No commands yet."]
    texts = ["set a.k = 3", "set a.x = 100 mm", "set a.x = 200 mm", "load"]
    one.live.done.extend(ExecutedCommand(i, 0.25 * i, "set", text, "", i != 3) for i, text in enumerate(texts))
    one.page.tick()
    shown = ["0.750 s", "load", "0.250 s", "hand: held at 100 mm", "0.000 s", "set a.k = 3"]
    assert one.page.shown()[1:] == shown
    soft = [label.text for label in one.page.elements(ui.label) if "twin-soft" in label.classes]
    assert [text for text in soft if not text.endswith(" s")] == ["load"]
    (first,) = [label for label in one.page.elements(ui.label) if label.text == "load"]
    one.page.tick()
    assert first in one.page.elements(ui.label)
    monkeypatch.setattr(operator_panel, "MAX_COMMANDS", 3)
    one.live.done.append(ExecutedCommand(9, 9.0, "set", "stop", ""))
    one.page.tick()
    assert one.page.shown()[2::2] == ["stop", "load", "hand: held at 100 mm"]


def test_a_session_is_downloaded_as_a_scenario(setting):
    one = setting()
    one.live.values["scenario_text"] = lambda: "title: T"
    with one.page:
        operator_panel.done(one.context, one.live)
    one.page.press("download as scenario")
    one.live.values["catalog"] = None
    one.page.press("download as scenario")

    def fail():
        raise TwinError("it is gone.")

    one.live.values["scenario_text"] = fail
    one.page.press("download as scenario")
    downloads = [("title: T", "rig_operated.yaml"), ("title: T", "session_operated.yaml")]
    assert (one.page.downloads, one.page.notes) == (downloads, ["it is gone."])


EVENTS = (
    SimpleNamespace(key="e1", text="set a.x = 2", description=""),
    SimpleNamespace(key="e2", text="set a.x = 3", description="pull"),
)


@pytest.mark.parametrize(("controls", "opened"), [((), True), ((SimpleNamespace(input="a.y", along=()),), False)])
@pytest.mark.parametrize("events", [(), EVENTS])
def test_sections_are_filled_when_they_are_opened(setting, controls, opened, events):
    """Values are open at first where there are no controls."""
    one = setting(signal("a.k"), signal("a.x", settable=False), controls=controls, events=events)
    with one.page:
        operator_panel.panel(one.context, lambda: ui.label("more"))
    titles = [
        "Inputs and parameters",
        *["Events of the scenario"] * bool(events),
        "Override outputs",
        "Executed commands",
    ]
    sections = one.page.elements(ui.expansion)
    assert [(each.text, each.value) for each in sections] == [
        (title, opened if title == titles[0] else title == titles[-1]) for title in titles
    ]
    shown = one.page.shown()
    assert (shown.index("more") > shown.index(titles[0]), "override" in shown) == (True, False)
    assert len(one.page.elements(ui.input)) == opened
    for each in sections:
        one.page.change(each, True)
        one.page.change(each, False)
        one.page.change(each, True)
    assert one.page.shown().count("override") == 1
    inputs = [field.props["placeholder"] for field in one.page.elements(ui.input) if "placeholder" in field.props]
    assert inputs[0] == "search 1 inputs and parameters"
    if events:
        one.page.press("set a.x = 3 (pull)")
        one.page.send(one.page.named("set a.x = 2", ui.button), "click")
        assert one.calls == [("live", "trigger", "e2"), ("live", "trigger", "e1")]


def test_the_safety_panel_shows_the_latest_status(setting, monkeypatch):
    for name in ("heading", "drives", "details"):
        monkeypatch.setattr(safety, name, lambda status, name=name: f"{name} {status}")
    one = setting()
    with one.page:
        safety.panel(one.context)
    elements = one.page.elements(ui.html)
    assert [each.content for each in elements] == ["", "", ""]
    for one.state.hardware in (1, 2, None):
        one.page.tick()
    assert [each.content for each in elements] == ["heading 2", "drives 2", "details 2"]


def test_the_score_follows_the_signal(setting):
    import numpy as np

    goal = {"signal": "a.tip[1]", "tolerance": 0.5, "points": {"A": 2.0, "B": 4.0}}
    scene = {"points": [{"signal": "a.tip[1]", "label": "tip"}]}
    one = setting(signal("a.tip", factor=1e3), targets=goal, scenes=[scene])
    one.catalog.signals["a.tip"].recorded = True
    marked, rows = [], SimpleNamespace(time=np.array([0.0, 1.0, 2.0]), values={"a.tip[1]": [0.0, 1.0, 2.0]})
    with one.page:
        targets.panel(one.context, SimpleNamespace(show_reached=marked.append))
    wide = "Tip: 0 of 2 targets, next: A; time starts with your first motion"
    assert one.page.shown() == [wide, "0/2 targets, next: A"]
    one.live.values["read"] = lambda names: rows if names == ["a.tip[1]"] else None
    one.page.tick()
    line = "Tip: 1 of 2 targets, next: B; 2.0 s since the first motion, path length 2000 mm"
    short = "1/2 targets, next: B; 2 s, 2000 mm"  # of a narrow page
    assert (one.page.shown(), marked) == ([line, short], [["A"]])

    def refuse(_):
        raise RefusedError("nothing was recorded.")

    for read in (refuse, lambda _: SimpleNamespace(time=np.array([]))):
        one.live.values["read"] = read
        one.page.tick()
    warning = {"signal": "a.tip", "above": 1.5, "text": "too far"}
    one.live.catalog.warnings, one.live.catalog.every = (warning,), 1.0
    rows.values["a.tip"] = np.array([[0.0], [1.0], [2.0]])
    one.live.values["read"] = lambda _: rows
    one.page.tick()
    past = "too far for 1.0 s, largest 2000 mm, limit 1500 mm"  # red is the row of a warning that lasts
    assert one.page.shown() == [line, short, past]
    assert all("twin-bad" not in label.classes for label in one.page.elements(ui.label))
    rows.time, goal["points"]["B"] = np.array([0.0, 1.0, 2.0, 3.0]), 2.2
    rows.values |= {"a.tip[1]": [0.0, 2.0, 2.0, 4.0], "a.tip": np.array([[0.0], [0.0], [2.0], [4.0]])}
    one.page.tick()  # both targets are reached: what follows is shown, and not judged
    past = "too far never, largest 0 mm, limit 1500 mm, after the last target, not judged: for 2.0 s, largest 4000 mm"
    line = "Tip: all 2 targets reached in 1.0 s since the first motion, path length 2000 mm; scoring has ended"
    short = "2/2 targets; scoring has ended; 1 s, 2000 mm"
    assert one.page.shown() == [line, short, past]
    marked.clear()
    marked.append(["A"])
    one.live.values["read"], one.console.live = lambda _: rows, None  # another session has begun
    one.page.tick()
    assert (one.page.shown(), marked) == ([line, short, past], [["A"]])
