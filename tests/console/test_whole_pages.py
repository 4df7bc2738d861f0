"""Pages of a console as a whole, without a server: which parts they have, when they are made anew, and the pages at the end."""

import asyncio
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("nicegui")

from nicegui import ui
from starlette.datastructures import QueryParams

from tests.console.page_without_a_server import Page
from twin.console import page, summary
from twin.console.page import PageContext
from twin.console.session import Host, Panel
from twin.errors import TwinError


@pytest.fixture
def parts(monkeypatch):
    """Replace the parts of a page by labels; panels of other packages are those of the list."""
    added = []

    def picture(_, catalog, views):
        ui.label(f"picture {views} {catalog.warnings}")
        return SimpleNamespace(head=ui.row())

    monkeypatch.setattr(page, "panels", lambda: added)
    for module, name in (
        (page.start_page, "pick"),
        (page.start_page, "starting"),
        (page.safety, "panel"),
        (page.targets, "panel"),
        (page.charts, "panel"),
    ):
        label = f"{module.__name__.rpartition('.')[2]}.{name}"
        monkeypatch.setattr(module, name, lambda *_, label=label: ui.label(label))
    monkeypatch.setattr(page.operator_panel, "panel", lambda context, more: (ui.label("operator"), more()))
    monkeypatch.setattr(page.summary, "panel", lambda *_: ui.label("requirements"))
    monkeypatch.setattr(page, "_bar", lambda _: ui.label("bar"))
    monkeypatch.setattr(page, "_top", lambda _, attends=False: ui.label(f"top {attends}"))
    monkeypatch.setattr(page, "Desk", lambda controls, session, space_runs: ui.label(f"desk {controls}"))
    monkeypatch.setattr(page, "to_si", lambda catalog: catalog)
    monkeypatch.setattr(page, "Pictures", picture)
    monkeypatch.setattr(page, "controls", lambda catalog: "controls")

    @contextmanager
    def frame(title, links, here):
        ui.label(f"{title}: {links}, {here}")
        yield ui.row()

    monkeypatch.setattr(page.web, "page_frame", frame)
    monkeypatch.setattr(page.web, "build_views", lambda catalog: catalog.views)
    monkeypatch.setattr(ui, "add_head_html", lambda _: None)
    return added


def session(**catalog):
    defaults = {
        "controls": (),
        "variant": "",
        "hardware": False,
        "views": [],
        "warnings": ["w"],
        "targets": None,
        "spaces": (),
    }
    state = SimpleNamespace(phase="paused", epoch=1, folder="")
    return SimpleNamespace(catalog=SimpleNamespace(**defaults | catalog), state=state)


OWN = Panel("Shape", lambda console, is_operator: ui.label("own"))
DRIVES = Panel("Drives", lambda console, is_operator: ui.label("drives"), hardware=True)
BENCH = Panel("Bench", lambda console, is_operator: ui.label(f"bench {is_operator()}"), hardware=True, path="/bench")


@pytest.mark.parametrize(
    ("catalog", "shown"),
    [
        ({}, ["bar", "desk controls", "operator", "requirements", "charts.panel", "Shape"]),
        (
            {"views": [1], "hardware": True},
            [
                *("bar", "picture [1] ['w']", "desk controls", "safety.panel", "operator", "requirements"),
                *("charts.panel", "Shape", "Drives"),
            ],
        ),
        (
            {"controls": ("hand",), "variant": "recording", "variants": {"recording": "", "by hand": ""}},
            ["bar", "desk controls", page.NOT_OPERATED, "operator", "requirements", "charts.panel", "Shape"],
        ),
        (
            {"spaces": [1]},
            ["bar", "picture [] ['w']", "desk controls", "operator", "requirements", "charts.panel", "Shape"],
        ),
        (
            {"views": [1], "targets": {}},
            ["bar", "picture [1] ['w']", "desk controls", "operator", "requirements", "charts.panel", "Shape"],
        ),
        (
            {"views": [1], "targets": {"a": 1}},
            [
                *("bar", "targets.panel", "picture [1] ['w']", "desk controls", "operator", "requirements"),
                *("charts.panel", "Shape"),
            ],
        ),
        (
            {"targets": {"a": 1}},
            ["bar", "desk controls", "operator", "requirements", "charts.panel", "Shape"],
        ),
    ],
)
def test_parts_of_a_session(monkeypatch, parts, catalog, shown):
    """The picture where something is drawn, the score above it; drives and other packages have their panels."""
    parts.extend([OWN, DRIVES, BENCH])
    one = Page(monkeypatch)
    with one:
        page._session(PageContext(Host(live=session(**catalog)), one.client))
    assert one.shown() == shown


@pytest.fixture
def register(monkeypatch, parts):
    """Register a console; its pages by path."""
    pages = {}

    def add_page(path):
        return lambda build: pages.setdefault(path, build)

    monkeypatch.setattr(ui, "page", add_page)
    monkeypatch.setattr(page.pages, "add_static_files", lambda *_, **__: None)
    monkeypatch.setattr(page.web.frames, "route", lambda *_: None)
    monkeypatch.setattr(page.summary, "register", lambda *_: None)
    monkeypatch.setattr(page.websocket, "register", lambda *_: None)

    def run(console):
        page.register(None, console)
        return pages

    return run


def test_a_page_is_made_anew_when_its_subject_changes(monkeypatch, register):
    console, one = Host(), Page(monkeypatch)
    pages = register(console)
    assert list(pages) == ["/"]
    with one:
        pages["/"](one.client)
    top = ["Catheter twin: {}, Session", "top False"]
    assert one.shown() == [*top, "start_page.pick"]
    (period, *_), *_ = one.timers
    assert period == 0.2
    console.live = session()
    ready, console.live.catalog = console.live.catalog, None
    one.tick()
    assert one.shown() == [*top, "start_page.starting"]
    (label,) = [each for each in one.elements(ui.label) if each.text == "start_page.starting"]
    one.tick()
    assert label in one.elements(ui.label)  # unchanged
    console.live.catalog = ready
    one.tick()
    assert one.shown()[2] == "bar"
    (label,) = [each for each in one.elements(ui.label) if each.text == "bar"]
    console.live.state.epoch = 2
    one.tick()
    assert label not in one.elements(ui.label)
    console.live = None
    one.tick()
    assert one.shown() == [*top, "start_page.pick"]


@pytest.mark.parametrize(("hardware", "paths"), [(None, ["/"]), (Path("b.yaml"), ["/bench", "/"])])
def test_pages_of_other_packages(monkeypatch, register, parts, hardware, paths):
    """Those of drives only with drives. An activity is made at once, so that a wrong file is reported."""
    made = []
    bench = Panel(
        "Bench", BENCH.fill, hardware=True, path="/bench", activity=lambda console: made.append(console) or "activity"
    )
    parts.extend([OWN, bench])
    console = Host(hardware=hardware)
    pages = register(console)
    assert list(pages) == paths
    assert console.activities == ({"Bench": "activity"} if hardware else {})
    links = {"Session": "/", "Bench": "/bench"} if hardware else {}
    for path in paths:
        one = Page(monkeypatch)
        with one:
            pages[path](one.client)
        end = ["Catheter twin: " + f"{links}, Session", "top False", "start_page.pick"]
        if path == "/bench":
            end = [f"Catheter twin: {links}, Bench", "top True", "bench False"]
        assert one.shown() == end


def test_requirements_are_listed_where_there_are_some(monkeypatch):
    one, sections, made = Page(monkeypatch), [], []
    console = Host(live=session(), scenario=Path("x.yaml"))
    catalog = SimpleNamespace(controls=())

    def verdicts(path, live):
        assert (path, live) == (Path("x.yaml"), console.live)
        if made[0] is None:
            raise TwinError("it has changed.")
        return SimpleNamespace(expectations=made[0][0], metrics=made[0][1], catalog=catalog)

    monkeypatch.setattr(summary, "SessionVerdicts", verdicts)
    monkeypatch.setattr(
        summary.operator_panel,
        "section",
        lambda title, fill, opened, lazy: sections.append((title, opened)) if not lazy else None,
    )
    for made[:] in ([None], [((), ())]):
        summary.panel(PageContext(console, one.client), None)
    assert sections == []
    for made[:], catalog.controls in (([((1,), ())], ()), ([((), (1,))], ("hand",))):
        summary.panel(PageContext(console, one.client), None)
    assert sections == [("Requirements and metrics", True), ("Requirements and metrics", False)]


@pytest.mark.parametrize(
    ("phase", "folder", "problem", "answer"),
    [
        (None, "", "", (404, "The session is not over yet.")),
        ("running", "runs/1", "", (404, "The session is not over yet.")),
        ("stopped", "", "", (404, "The session is not over yet.")),
        ("stopped", "runs/1", "it failed.", (500, "it failed.")),
        ("failed", "runs/1", "", (200, "runs/1")),
    ],
)
def test_the_viewer_of_a_session_that_is_over(monkeypatch, tmp_path, phase, folder, problem, answer):
    routes = {}
    app = SimpleNamespace(add_route=lambda path, call, methods: routes.update({path: (call, methods)}))
    live = SimpleNamespace(state=SimpleNamespace(phase=phase, folder=folder)) if phase else None
    summary.register(app, Host(live=live))
    file = tmp_path / "page.html"

    def view_page(folder):
        file.write_text(str(folder))
        return file, problem

    monkeypatch.setattr(summary, "view_page", view_page)
    call, methods = routes["/signals"]
    written = asyncio.run(call(SimpleNamespace(query_params=QueryParams())))
    if answer[0] != 404:  # at once, a page that says so and loads the viewer
        assert b"url=?&wait=1" in written.body
        assert b"being written" in written.body
    found = asyncio.run(call(SimpleNamespace(query_params=QueryParams("wait=1"))))
    text = Path(found.path).read_text() if found.status_code == 200 else bytes(found.body).decode()
    assert (found.status_code, text, methods) == (answer[0], answer[1], ["GET"])


@pytest.mark.parametrize(("code", "problem"), [(0, ""), (1, "error: no.")])
def test_a_page_of_a_run_is_written_once(monkeypatch, tmp_path, code, problem):
    calls = []

    def run(words, **options):
        calls.append((words, options))
        return SimpleNamespace(returncode=code, stderr="error: no." if code else "a warning")

    monkeypatch.setattr(subprocess, "run", run)
    target = tmp_path / "signals.html"
    assert summary.view_page(tmp_path) == (target, problem)
    ((words, options),) = calls
    assert (words[0], words[3:]) == (sys.executable, ["view", str(tmp_path), "--output", str(target)])
    assert options == {"capture_output": True, "text": True, "check": False}
    target.touch()
    assert summary.view_page(tmp_path) == (target, "")
    assert len(calls) == 1
