"""Answers of the viewer's server, without a socket: pages, requests of any length, and what cannot be read."""

import asyncio
import json
from types import SimpleNamespace

import pytest

pytest.importorskip("nicegui")

from starlette.datastructures import QueryParams

from twin.errors import TwinError
from twin.viewer import requests, server


@pytest.fixture
def send(monkeypatch):
    """Send a request in parts; status, media type and body of the answer."""
    routes, answered = {}, []
    app = SimpleNamespace(add_route=lambda path, call, methods: routes.update({(path, methods[0]): call}))

    class Lock:
        used = 0

        def __enter__(self):
            Lock.used += 1

        def __exit__(self, *_):
            pass

    def find(number):
        if number == "9":
            raise requests.RequestError("case: '9' is not a kept case of a study.")
        if number == "8":
            raise TwinError("it is gone.")
        cache = SimpleNamespace(lock=Lock())
        return SimpleNamespace(
            text=lambda signals: " ".join(["page", number, *signals]),
            report=lambda run: f"report {number} {run}",
            runs=SimpleNamespace(cache=cache, growing=number == "1"),
        )

    def answer(request, viewed):
        answered.append(request)
        if request.get("fail"):
            raise OSError(5, "broken", request["fail"] if request["fail"] != "?" else None)
        return b"bytes" if request.get("binary") else {"ok": True}

    monkeypatch.setattr(server, "ANSWERS", {"/lines": answer})
    server.register(app, SimpleNamespace(find=find))

    def run(path, *parts, case=""):
        method = "POST" if parts else "GET"

        async def stream():
            for part in parts:
                yield part

        request = SimpleNamespace(query_params=QueryParams(f"case={case}" if case else ""), stream=stream)
        found = asyncio.run(routes[path, method](request))
        return found.status_code, found.media_type, bytes(found.body)

    run.answered, run.lock = answered, Lock
    return run


def test_a_page_of_each_case(send):
    assert send("/") == (200, "text/html", b"page ")
    assert send("/", case="713") == (200, "text/html", b"page 713")
    assert send("/", case="713&signal=a.x&signal=b") == (200, "text/html", b"page 713 a.x b")
    assert send("/report", case="713&run=1") == (200, "text/html", b"report 713 1")
    for path in ("/", "/report"):
        assert send(path, case="8") == (404, "text/plain", b"it is gone.")


def test_a_request_comes_in_parts(send):
    assert send("/lines", b'{"bin', b'ary": 1}') == (200, "application/octet-stream", b"bytes")
    status, kind, body = send("/lines", b"{}", case="2")
    assert (status, kind, json.loads(body)) == (200, "application/json", {"ok": True})
    assert (send.answered, send.lock.used) == ([{"binary": 1}, {}], 0)


def test_runs_that_grow_are_read_at_one_moment(send):
    assert send("/lines", b"{}", case="1")[0] == 200
    assert send.lock.used == 1


@pytest.mark.parametrize(
    ("parts", "case", "answer"),
    [
        ((b"[]",), "", (400, b"expected a JSON object.")),
        ((b"{}",), "9", (400, b"case: '9' is not a kept case of a study.")),
        ((b'{"fail": "/a/b"}',), "", (503, b"/a/b: cannot be read (broken).")),
        ((b'{"fail": "?"}',), "", (503, b"the run: cannot be read (broken).")),
    ],
)
def test_what_cannot_be_answered(send, parts, case, answer):
    status, kind, body = send("/lines", *parts, case=case)
    assert (status, kind, body) == (answer[0], "text/plain", answer[1])


def test_a_request_is_read_up_to_its_limit(send):
    """What is longer is not read to its end."""
    limit = requests.MAX_BODY
    assert send("/lines", b"{" + b" " * (limit - 2) + b"}")[0] == 200
    status, _, body = send("/lines", b"{" + b" " * (limit - 2), b"}}", b" " * limit)
    assert (status, body) == (400, f"a request of {limit + 1} bytes is too long.".encode())


def test_which_answer_is_whose(monkeypatch):
    for name in ("lines", "values", "statistics", "scene"):
        monkeypatch.setattr(requests, name, lambda request, what, name=name: (name, request, what))
    viewed = SimpleNamespace(runs=SimpleNamespace(progress=lambda: "progress"), scenes="scenes")
    found = {path: answer("request", viewed) for path, answer in server.ANSWERS.items()}
    assert found == {
        "/lines": ("lines", "request", viewed.runs),
        "/values": ("values", "request", viewed.runs),
        "/statistics": ("statistics", "request", viewed.runs),
        "/scene": ("scene", "request", "scenes"),
        "/progress": "progress",
    }
