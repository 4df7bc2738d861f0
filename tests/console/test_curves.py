"""Curves, panes and controls of a page."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.console.without_a_process import CONTROL, SIGNALS, Setting, signal
from twin import web
from twin.console import charts
from twin.console.curves import MAX_ELEMENTS, PREVIOUS, SessionCurves, elements
from twin.console.joysticks import control, controls
from twin.live import RefusedError


def test_scalars_of_a_signal():
    """Indices count from 1; of what is large or a text there is none."""
    assert list(elements(SIGNALS["a.x"])) == ["a.x"]
    assert list(elements(SIGNALS["a.m"])) == ["a.m[1,1]", "a.m[1,2]", "a.m[2,1]", "a.m[2,2]"]
    assert list(elements(SIGNALS["b.text"])) == []
    assert len(list(elements(signal("a.v", shape=(MAX_ELEMENTS,))))) == MAX_ELEMENTS
    assert list(elements(signal("a.v", shape=(MAX_ELEMENTS + 1,)))) == []


def reader(time, values):
    """Rows that are recorded."""

    def read(names, since, until):
        chosen = (time > since) & (time <= until)
        return SimpleNamespace(time=time[chosen], values={name: values[name][chosen] for name in names})

    return SimpleNamespace(read=read, latest=lambda names: SimpleNamespace(time=time[-1:]))


def test_curves_of_a_session():
    """In display units, with the row before the window; those of the run before it are there under another name."""
    setting = Setting()
    time = 1.0 + 0.5 * np.arange(5)
    rows = {"a.x": np.arange(5.0), "b.n": np.arange(5)}
    setting.live.values["reader"] = lambda: reader(time, rows)
    first = SessionCurves(setting.live)
    assert list(first.names()) == ["a.x", *elements(SIGNALS["a.m"]), "b.n"]
    assert (first.span(), first.previous("a.x")) == ((1.0, 3.0), "")
    times, values = first.read("a.x", 2.0, 2.5, 100)
    assert (times.tolist(), values.tolist()) == ([2.0, 2.5], [2000.0, 3000.0])
    times, values = first.read("a.x", 2.1, 2.5, 100)
    assert (times.tolist(), values.tolist()) == ([2.0, 2.5], [2000.0, 3000.0])
    assert [array.size for array in first.read("a.x", 7.0, 8.0, 100)] == [0, 0]
    setting.live.values["state"].epoch = 4
    setting.live.values["reader"] = lambda: reader(time, {name: -values for name, values in rows.items()})
    second = SessionCurves(setting.live, first)
    assert f"{PREVIOUS}b.n" in second.names()
    times, values = second.read(f"{PREVIOUS}a.x", 2.0, 2.5, 100)
    assert (times.tolist(), values.tolist()) == ([2.0, 2.5], [2000.0, 3000.0])  # also far from the present run
    assert second.read(f"{PREVIOUS}a.x", 0.9, 1.1, 100)[1].tolist() == [0.0]
    assert second.read("a.x", 2.0, 2.5, 100)[1].tolist() == [-2000.0, -3000.0]
    late = SessionCurves(setting.live, replace(setting.console) and None)
    setting.live.values["state"].epoch = 5
    with pytest.raises(RefusedError, match="nothing was recorded"):
        late.reader()
    assert late.span() == (1.0, 1.0)
    assert [array.size for array in late.read("a.x", 0.0, 9.0, 10)] == [0, 0]
    assert SessionCurves(setting.live, late).previous_run is None  # it never had a row


def test_a_run_that_stays_at_its_start_is_no_run_to_compare_with():
    """The run before it is; its name says variant and time of day."""
    setting, runs = Setting(), []
    for length in (5, 1, 5):
        time = 1.0 + 0.5 * np.arange(length)
        setting.live.values["state"].epoch += 1
        setting.live.values["reader"] = lambda time=time: reader(time, {"a.x": np.arange(float(len(time)))})
        runs.append(SessionCurves(setting.live, runs[-1] if runs else None))
        runs[-1].span()
    full, _, third = runs
    assert third.previous_run is full
    assert third.read(f"{PREVIOUS}a.x", 0.0, 9.0, 100)[1].size == 5
    assert re.fullmatch(r"quiet, \d\d:\d\d", full.title)
    setting.live.catalog.controls = ()
    setting.live.values["changes"][full.epoch] = {"a.x": 0.0}
    assert re.fullmatch(r"quiet, changed by hand, \d\d:\d\d", full.title)


def test_the_first_panes_of_a_chart():
    """Those of the scenario's plots, with bands in display units; else the first two outputs."""
    curves = SessionCurves(Setting().live)
    catalog = SimpleNamespace(
        labels={},
        plots=(
            ("One", "m", ("a.x", "a.gone", "b.n")),
            ("None", "m", ("a.gone",)),
            ("Two", "N", ("b.n",)),
            ("Three", "m", ("a.x",)),
            ("Four", "m", ("a.x",)),
        ),
        bands={"One": (0.001, 0.002)},
        lines={"One": (0.0015,)},
        warnings=({"signal": "a.x", "above": 0.003, "below": -0.003},),
        start=0.0,
    )
    panes = charts.first_panes(catalog, curves)
    assert [(pane.title, pane.unit, pane.band) for pane in panes] == [
        ("One", "mm", (1.0, 2.0)),
        ("Two", "N", None),
        ("Three", "mm", None),
    ]
    assert [pane.lines for pane in panes] == [[1.5], [], []]
    assert [[limit["y"] for limit in pane.limits] for pane in panes] == [[3.0], [], [3.0]]  # a force has two
    assert [[(curve.name, curve.color, curve.step) for curve in pane.curves] for pane in panes] == [
        [("a.x", 0, False), ("b.n", 1, True)],
        [("b.n", 1, True)],
        [("a.x", 0, False)],  # the same signal, the same color
    ]
    none = {"bands": {}, "lines": {}, "warnings": (), "start": 0.0}
    many = SimpleNamespace(plots=(("One", "m", ("a.x",) * 7), ("Two", "m", ("b.n",) * 3)), labels={}, **none)
    assert [len(pane.curves) for pane in charts.first_panes(many, curves)] == [7, 1]
    own = charts.first_panes(SimpleNamespace(plots=(), labels={}, **none), curves)
    assert [(pane.unit, [(curve.name, curve.color) for curve in pane.curves]) for pane in own] == [
        ("mm", [("a.x", 0)]),
        ("m", [("a.m[1,1]", 1)]),
    ]
    assert isinstance(own[0], web.Pane)
    plots = (("Speeds", "m", ("b.n", "a.x")), ("Force", "N", ("a.m[1,1]",)), ("Tips", "m", ("a.m[1,2]", "a.m[2,1]")))
    labels = {"b.n": "catheter", "a.x": "guidewire", "a.m[1,2]": "catheter", "a.m[2,1]": "guidewire"}
    panes = charts.first_panes(SimpleNamespace(plots=plots, labels=labels, **none), curves)
    assert [[curve.color for curve in pane.curves] for pane in panes] == [[0, 1], [2], [0, 1]]  # of an instrument


def test_labels_of_commands():
    assert charts.mark_text("set a.b = 1") == "a.b = 1"
    assert charts.mark_text(f"speed{charts.HELD}") == "speed"
    exact, longer = "x" * charts.MARK_WIDTH, "x" * (charts.MARK_WIDTH + 1)
    assert (charts.mark_text(exact), charts.mark_text(longer)) == (exact, exact[:-1] + "…")


def test_controls_of_a_page():
    """Limits in the display unit."""
    (item,) = controls(SimpleNamespace(controls=[CONTROL]))
    assert item == {
        "name": "speed",
        "input": "a.speed[1]",
        "label": "catheter",
        "about": "d",
        "kind": "hold",
        "stick": "y",
        "keys": ["ArrowUp", "ArrowDown"],
        "axis": 1,
        "reverse": True,
        "buttons": [None, 2],
        "dead": 0.1,
        "unit": "mm/s",
        "low": -19.0,
        "high": 21.0,
        "factor": 1e3,
        "offset": 1.0,
    }
    jog = control("jog", "Jog", "about", ("a", "b"), "mm/s", 5.0)
    assert {key: jog[key] for key in ("input", "low", "high", "factor", "offset", "dead", "reverse", "keys")} == {
        "input": "jog",
        "low": -5.0,
        "high": 5.0,
        "factor": 5.0,
        "offset": 0.0,
        "dead": 0.0,
        "reverse": False,
        "keys": ["a", "b"],
    }
