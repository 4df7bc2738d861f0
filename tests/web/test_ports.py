"""Ports of a page's server, and requests that are none of the usual ones."""

import asyncio
import logging
import socket

import pytest

from twin.errors import TwinError
from twin.web import server
from twin.web.server import listening, silence_shutdown
from twin.web.token_auth import TokenAuth, token


def test_the_first_free_port(monkeypatch):
    """On the loopback interface; a port that is named and taken is an error, as are all that are tried."""
    with listening(None) as first, listening(None) as second:
        assert first.getsockname()[0] == "127.0.0.1"
        taken, other = first.getsockname()[1], second.getsockname()[1]
        assert taken in server.PORTS
        assert other > taken
        with pytest.raises(TwinError) as caught:
            listening(taken)
        assert str(caught.value) == (
            f"--port {taken}: Address already in use. Take another, or none: a free one is found."
        )
        monkeypatch.setattr(server, "PORTS", range(taken, taken + 1))
        with pytest.raises(TwinError, match=rf"ports {taken} to {taken}: all are taken\. Name another with --port\."):
            listening(None)
    with listening(taken) as again, socket.create_connection(again.getsockname(), 5):
        assert again.getsockname()[1] == taken


def asked(scope):
    """What an application behind the token is asked, and what is sent."""
    inner, sent = [], []

    async def app(scope, receive, send):
        inner.append(scope["type"])
        await send({"type": "http.response.start", "status": 200, "headers": [(b"a", b"b")]})
        await send({"type": "http.response.body"})

    async def send(message):
        sent.append(message)

    asyncio.run(TokenAuth(app, "secret", 8300)(scope, None, send))
    return inner, sent


def request(query=b"", kind="http", **headers):
    names = {"host": "127.0.0.1:8300", **headers}
    return {
        "type": kind,
        "query_string": query,
        "headers": [(name.encode(), text.encode()) for name, text in names.items()],
    }


def test_answers_hold_the_cookie_and_forbid_others_content():
    inner, (start, body) = asked(request(b"token=secret"))
    assert (inner, body) == (["http"], {"type": "http.response.body"})
    headers = dict(start["headers"])
    assert headers[b"a"] == b"b"
    assert headers[b"set-cookie"] == b"twin_8300=secret; Path=/; HttpOnly; SameSite=Strict"
    assert b"default-src 'self'" in headers[b"content-security-policy"]
    assert asked({"type": "lifespan"})[0] == ["lifespan"]
    refused = asked(request(b"token=other"))
    assert (refused[0], refused[1][0]["status"]) == ([], 403)
    assert asked(request(kind="websocket")) == ([], [{"type": "websocket.close", "code": 1008}])
    assert asked(request(b"token=secret", cookie="a=\x01;;[="))[0] == ["http"]  # a cookie that cannot be read
    assert asked(request(cookie="twin_8300=secret"))[0] == ["http"]
    assert asked(request(cookie="twin_8301=secret"))[0] == []
    assert len(token()) == 22  # 16 bytes in base64
    assert token() != token()


def test_tasks_of_an_open_page_are_no_message_at_the_end():
    logger = logging.getLogger("nicegui")
    before = list(logger.filters)
    try:
        silence_shutdown()
        records = [logging.makeLogRecord({"msg": text}) for text in ("Could not cancel %s tasks", "an error of a page")]
        assert [bool(logger.filter(record)) for record in records] == [False, True]
    finally:
        logger.filters[:] = before
