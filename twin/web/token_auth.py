"""Access by token: requests need the token of the printed URL, from a page of this server, under its own host name.

The first answer sets the token as a cookie, which the browser sends with later requests. Other sites in the same browser
can send neither (cookie: SameSite; `Origin`; `Host` against DNS rebinding).
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
    b"403: the URL has no token, or an old one. Open the complete URL that the command printed, "
    b"e.g. http://127.0.0.1:8300/?token=...\n"
)
# no resources of other origins, even if content is injected; Vue compiles templates: unsafe-eval
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
    """Return a new token of 128 bits."""
    return secrets.token_urlsafe(16)


class TokenAuth:
    """ASGI middleware that answers 403 to requests without the token and rejects their web sockets."""

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._cookie = f"twin_{port}"  # cookies do not distinguish ports, and several servers may run
        self._hosts = {f"{name}:{port}" for name in HERE}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle an ASGI connection."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
        elif self._is_allowed(scope):
            await self._app(scope, receive, self._set_cookie(send))
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            plain = [(b"content-type", b"text/plain; charset=utf-8"), *HEADERS]
            await send({"type": "http.response.start", "status": 403, "headers": plain})
            await send({"type": "http.response.body", "body": REFUSED})

    def _is_allowed(self, scope: Scope) -> bool:
        headers = {name.lower(): value.decode("latin-1") for name, value in scope["headers"]}
        origin = headers.get(b"origin")
        if headers.get(b"host") not in self._hosts or (origin and origin.partition("//")[2] not in self._hosts):
            return False
        return any(hmac.compare_digest(token.encode(), self._token.encode()) for token in self._tokens(scope, headers))

    def _tokens(self, scope: Scope, headers: dict[bytes, str]) -> list[str]:
        tokens = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        try:
            cookies = SimpleCookie(headers.get(b"cookie", ""))
        except CookieError:
            return tokens
        return [*tokens, *(cookie.value for name, cookie in cookies.items() if name == self._cookie)]

    def _set_cookie(self, send: Send) -> Send:
        cookie = f"{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict".encode()

        async def answer(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), (b"set-cookie", cookie), *HEADERS]
            await send(message)

        return answer
