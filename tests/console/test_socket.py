"""The socket of a page, without a server: who may open it, what is sent, when it is closed; the session of a console."""

import asyncio
import json
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("nicegui")

from starlette.websockets import WebSocketDisconnect

from tests.console.without_a_process import Recorder, Setting
from twin.console import session, websocket
from twin.console.session import Host, Panel
from twin.errors import TwinError


class Socket:
    """What a page sends, then it leaves; what it receives."""

    def __init__(self, *received, client="page"):
        self.query_params, self.received = {"client": client}, [*received]
        self.accepted, self.sent, self.closed = False, [], None

    async def accept(self):
        self.accepted = True

    async def receive_text(self):
        await asyncio.sleep(0.0)
        if not self.received:
            raise WebSocketDisconnect
        text = self.received.pop(0)
        if isinstance(text, Exception):
            raise text
        return text

    async def send_text(self, text):
        self.sent.append(json.loads(text))

    async def close(self, code):
        self.closed = code


PAGES = ("page", "other")


@pytest.fixture
def serve():
    """Serve sockets of a console at once; only `pages` are pages."""

    def run(console, *sockets, pages=PAGES):
        app = SimpleNamespace(router=SimpleNamespace(routes=[]))
        websocket.register(app, console, lambda client: client in pages)
        (route,) = app.router.routes
        assert route.path == "/wire"

        async def endpoints():
            await asyncio.wait_for(asyncio.gather(*map(route.endpoint, sockets)), 10.0)

        asyncio.run(endpoints())
        return sockets[0]

    return run


@pytest.mark.parametrize("client", ["stranger", ""])
def test_only_pages_of_this_server_have_a_socket(serve, client):
    console = Host()
    socket = serve(console, Socket("{}", client=client))
    assert (socket.accepted, socket.closed, console.operator_lock.pages) == (False, 1008, {})


def test_the_first_page_operates_until_it_leaves(serve):
    """Then all that it holds is released."""
    console, calls = Host(), []
    console.release_hold = lambda: calls.append(console.operator_lock.operator)
    socket = serve(console, Socket(json.dumps({"watch": []}), KeyError("text")))
    assert (socket.accepted, socket.closed, calls) == (True, None, ["page"])
    assert (console.operator_lock.operator, console.operator_lock.pages) == (None, {})
    assert [(tick["tick"], tick["operator"]) for tick in socket.sent] == [(1, True)]
    console.operator_lock.enter("other")
    socket = serve(console, Socket(json.dumps({"watch": []})))
    assert [tick["operator"] for tick in socket.sent] == [False]
    assert (calls, console.operator_lock.operator) == (["page"], "other")


def test_a_page_that_the_server_drops_operates_no_longer(serve, monkeypatch):
    """Its buttons are dead: another page may operate, and this one reloads itself. Its STOP still arrives."""
    monkeypatch.setattr(websocket, "PERIOD", 0.0)
    console, pages, calls = Host(), ["page"], []
    console.stop = lambda: calls.append(("stop", console.operator_lock.operator))
    console.release_hold = lambda: calls.append("release")
    watch, stop = json.dumps({"watch": []}), json.dumps({"stop": True})
    socket = Socket(*[watch] * 5, *[watch] * 20, stop)
    sent = socket.send_text

    async def send_text(text):
        await sent(text)
        pages.clear()

    socket.send_text = send_text
    serve(console, socket, pages=pages)
    assert [tick["dropped"] for tick in socket.sent][:2] == [False, True]
    assert [tick["operator"] for tick in socket.sent][:2] == [True, None]
    assert calls == ["release", ("stop", None)]


def test_a_page_that_reconnects_before_its_old_socket_ends_goes_on(serve):
    console, watch = Host(), json.dumps({"watch": []})
    after = Socket(*[watch] * 9)
    before, receive = Socket(), after.receive_text
    seen = []

    async def receive_text():
        seen.append(console.operator_lock.operator)
        return await receive()

    after.receive_text = receive_text
    serve(console, before, after)
    assert seen == ["page"] * 10
    assert console.operator_lock.pages == {}


@pytest.mark.parametrize(("wrong", "closed"), [(19, None), (20, 1008), (25, 1008)])
def test_a_page_that_sends_nonsense_is_closed(serve, wrong, closed):
    """After twenty messages; each is answered."""
    messages = [json.dumps({"watch": []}), *["{"] * wrong]
    socket = serve(Host(), Socket(*messages))
    refused = [message["refused"] for message in socket.sent if "refused" in message]
    assert (socket.closed, refused) == (closed, ["the message is not JSON."] * min(wrong, websocket.MAX_INVALID))
    assert websocket.MAX_INVALID == 20


def test_ticks_are_numbered_and_their_times_known(serve, monkeypatch):
    monkeypatch.setattr(websocket, "PERIOD", 0.0)
    setting = Setting("page")
    setting.console.operator_lock.leave("operator")
    hold = json.dumps({"hold": "speed", "at": 1.0, "press": 1, "tick": 2})
    watch = json.dumps({"watch": ["a.x"]})
    socket = serve(setting.console, Socket(*[watch] * 20, hold))
    ticks = [message["tick"] for message in socket.sent]
    assert ticks == list(range(1, len(ticks) + 1))
    assert len(ticks) > 2
    held = [call for call in setting.calls if call[1] == "hold"]
    assert [call[:5] for call in held] == [("live", "hold", "a.speed[1]", 0.02, 1)]


def live(calls, phase="running", **catalog):
    values = {"state": SimpleNamespace(phase=phase, epoch=1), "catalog": SimpleNamespace(signals={}, **catalog)}
    return Recorder("live", calls, values)


def test_a_session_begins_after_the_one_before(monkeypatch):
    """With what the command line gave; curves of the same scenario stay for comparison."""
    calls, begun = [], []
    one = Host(overrides=("a=1",), hardware=Path("b.yaml"), arm=True, rate=2.0, runs=Path("r"), build=Path("b"))
    one.backend, one.scenario, one.live, one._source = "compiled", Path("x.yaml"), live(calls, "stopped"), "curves"
    monkeypatch.setattr(
        session.LiveSession, "start", lambda *words, **options: begun.append((*words, options)) or "new"
    )
    one.begin(Path("x.yaml"), "PI", 3)
    assert calls == [("live", "stop"), ("live", "close")]
    options = {"overrides": ("a=1",), "rate": 2.0, "hardware": Path("b.yaml"), "arm": True, "runs": Path("r")}
    options |= {
        "build": Path("b"),
        "backend": "compiled",
        "report": True,
        "values": {},
        "wait": False,
        "variant": "PI",
        "seed": 3,
    }
    assert begun == [(Path("x.yaml"), options)]
    assert (one.live, one.scenario, one.variant, one.seed) == ("new", Path("x.yaml"), "PI", 3)
    assert (one._source, one._stopping) == ("curves", None)
    one.live = None
    one.begin(Path("y.yaml"))
    assert (one._source, begun[1][0], begun[1][1]["variant"], begun[1][1]["seed"]) == (None, Path("y.yaml"), None, None)
    assert begun[1][1]["overrides"] == ()  # those of the command line are for its scenario


@pytest.mark.parametrize(
    ("hardware", "phase", "refused"),
    [(None, "running", False), ("b.yaml", "stopped", False), ("b.yaml", "failed", False), ("b.yaml", "running", True)],
)
def test_a_restart_ends_the_session_unless_drives_run(monkeypatch, hardware, phase, refused):
    calls, begun = [], []
    one = Host(scenario=Path("x.yaml"), seed=3, hardware=hardware, live=live(calls, phase))
    one.live.values["changed_values"] = {"a.x": 1.0}
    monkeypatch.setattr(one, "begin", lambda *words: begun.append(words))
    if refused:
        with pytest.raises(TwinError, match=r"a session with drives is running\. Stop it first\."):
            one.restart("PI")
    else:
        one.restart("PI")
    assert (calls, begun) == (([], []) if refused else ([("live", "stop")], [(Path("x.yaml"), "PI", 3, {"a.x": 1.0})]))
    Host().restart("PI")  # nothing to repeat


def test_curves_are_made_for_each_run_of_a_session(monkeypatch):
    monkeypatch.setattr(
        session, "SessionCurves", lambda live, before: SimpleNamespace(live=live, epoch=live.state.epoch, before=before)
    )
    one = Host(live=live([]))
    first = one.source
    assert (one.source is first, first.before) == (True, None)
    one.live.state.epoch = 2
    second = one.source
    assert (second.before, one.source) == (first, second)
    one.live = live([])
    third = one.source
    assert (third.before, third.live) == (second, one.live)
    one.live.values["catalog"] = None
    assert one.source is None


def test_panels_are_entry_points(monkeypatch):
    panel = Panel("Drives", lambda *_: None, hardware=True)
    monkeypatch.setattr(
        "twin.installed.entry_points", lambda group: {"drives": SimpleNamespace(load=lambda: (panel, group))}
    )
    assert session.panels() == [(panel, "twin.console")]
