"""Who may ask: whoever has the token of the address, from a page of this server, by its own name.

The token stands in the address that the command prints; the first answer gives it to the browser as a cookie, which goes with
all that the page asks for afterwards. Another site in the same browser can send neither (cookie: same site; `Origin`; `Host`,
against a name that was made to point here).
"""

from __future__ import annotations

import hmac
import secrets
from http.cookies import CookieError, SimpleCookie
from typing import TYPE_CHECKING
from urllib.parse import parse_qs

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

HERE = ("127.0.0.1", "localhost", "[::1]")
REFUSED = (
    b"403: this address lacks the token, or has an old one. Open the whole address that the command printed, "
    b"such as http://127.0.0.1:8300/?token=...\n"
)
# nothing is fetched from anywhere else, whatever a page is made to contain; Vue compiles templates: unsafe-eval
POLICY = (
    b"default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    b"img-src 'self' data: blob:; font-src 'self' data:; frame-ancestors 'none'; form-action 'self'; base-uri 'self'"
)
HEADERS = (
    (b"content-security-policy", POLICY),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
)


def token() -> str:
    """A new token, of 128 bits."""
    return secrets.token_urlsafe(16)


class TokenAuth:
    """Lets through what has the token; all else gets 403, a web socket is closed before it opens."""

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._cookie = f"twin_{port}"  # cookies do not tell ports apart, and two servers may run
        self._hosts = {f"{name}:{port}" for name in HERE}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """As ASGI has it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
        elif self._may(scope):
            await self._app(scope, receive, self._answering(send))
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            plain = [(b"content-type", b"text/plain; charset=utf-8"), *HEADERS]
            await send({"type": "http.response.start", "status": 403, "headers": plain})
            await send({"type": "http.response.body", "body": REFUSED})

    def _may(self, scope: Scope) -> bool:
        headers = {name.lower(): value.decode("latin-1") for name, value in scope["headers"]}
        origin = headers.get(b"origin")
        if headers.get(b"host") not in self._hosts or (origin and origin.partition("//")[2] not in self._hosts):
            return False
        return any(hmac.compare_digest(one.encode(), self._token.encode()) for one in self._shown(scope, headers))

    def _shown(self, scope: Scope, headers: dict[bytes, str]) -> list[str]:
        """Tokens that a request shows."""
        shown = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        try:
            cookies = SimpleCookie(headers.get(b"cookie", ""))
        except CookieError:
            return shown
        return [*shown, *(one.value for name, one in cookies.items() if name == self._cookie)]

    def _answering(self, send: Send) -> Send:
        cookie = f"{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict".encode()

        async def answer(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), (b"set-cookie", cookie), *HEADERS]
            await send(message)

        return answer
