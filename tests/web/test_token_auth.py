"""Who gets through the gate: the token in the address or as cookie, this machine's names, pages of this server."""

import asyncio

import pytest

from tests.every_case import every_case
from twin.web.token_auth import TokenAuth

TOKEN, PORT = "abcDEF123", 8300
HOST = (b"host", b"127.0.0.1:8300")
COOKIE = (b"cookie", b"other=1; twin_8300=abcDEF123")


def asked(*headers, query=b"", kind="http"):
    """Status of an answer, and whether what is behind the gate was asked."""
    sent, behind = [], []

    async def app(_scope, _receive, send):
        behind.append(True)
        await send({"type": "http.response.start", "status": 200, "headers": []})

    async def send(message):
        sent.append(message)

    scope = {"type": kind, "headers": list(headers), "query_string": query, "path": "/"}
    asyncio.run(TokenAuth(app, TOKEN, PORT)(scope, None, send))
    return sent[0].get("status", sent[0].get("code")), bool(behind), sent[0]


@pytest.mark.parametrize(
    ("headers", "query"),
    [
        ([HOST], b"token=abcDEF123"),
        ([HOST, COOKIE], b""),
        ([(b"host", b"localhost:8300"), (b"origin", b"http://localhost:8300"), COOKIE], b""),
    ],
)
def test_with_the_token(headers, query):
    status, behind, first = asked(*headers, query=query)
    assert (status, behind) == (200, True)
    told = dict(first["headers"])
    assert b"HttpOnly" in told[b"set-cookie"]
    assert b"SameSite=Strict" in told[b"set-cookie"]
    assert b"default-src 'self'" in told[b"content-security-policy"]


@every_case(
    ("headers", "query"),
    [
        ([HOST], b""),
        ([HOST], b"token="),
        ([HOST], b"token=abcDEF124"),
        ([HOST], b"token=abcDEF123x"),
        ([HOST], b"token=%ff%fe"),
        ([HOST, (b"cookie", b"twin_8301=abcDEF123")], b""),  # of another server
        ([HOST, (b"cookie", b"twin_8300=; ;;==")], b""),
        ([], b"token=abcDEF123"),
        ([(b"host", b"evil.example:8300")], b"token=abcDEF123"),  # a name that was made to point here
        ([HOST, (b"origin", b"http://evil.example"), COOKIE], b""),
        ([HOST, (b"origin", b"null"), COOKIE], b""),
    ],
)
@every_case(("kind", "refused"), [("http", 403), ("websocket", 1008)])
def test_without(headers, query, kind, refused):
    status, behind, _ = asked(*headers, query=query, kind=kind)
    assert (status, behind) == (refused, False)
