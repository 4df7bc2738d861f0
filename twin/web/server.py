"""HTTP server for the browser on this machine: one port, one access token.

Pages are added by `register`, with decorators of NiceGUI or routes of `app`, before the server starts.
"""

from __future__ import annotations

import asyncio
import gc
import logging
import signal
import socket
import traceback
import webbrowser
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin.errors import TwinError
from twin.process import SIGNALS
from twin.web import token_auth

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType

    from fastapi import FastAPI
    from uvicorn import Server

STATIC = Path(__file__).parent / "static"
CLOSING = 1  # time limit for open connections at the end [s]
LARGEST = 1 << 16  # largest message of a web socket [byte]
PORTS = range(8300, 8400)  # the first free one, so that the URL is usually the same


def listening(port: int | None) -> socket.socket:
    """Return a listening socket on the loopback interface, at a port or at the first free one; TwinError if none is free."""
    for candidate in PORTS if port is None else [port]:
        sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            sock.bind(("127.0.0.1", candidate))
            sock.listen(64)
        except OSError as error:
            sock.close()
            if port is not None:
                raise TwinError(
                    f"--port {port}: {error.strerror}. Take another, or none: a free one is found."
                ) from None
        else:
            return sock
    raise TwinError(f"ports {PORTS.start} to {PORTS.stop - 1}: all are taken. Name another with --port.")


@dataclass
class Site:
    """A served site. `start` is the path that is opened; `stop` is called at a signal, before connections are closed."""

    title: str
    register: Callable[[FastAPI], None]
    start: str = "/"
    stop: Callable[[], None] = lambda: None
    announce: Callable[[str], None] = print
    port: int | None = None
    open_browser: bool = True
    closing_message: str = "Closed."
    tasks: list[Callable[[], Any]] = field(default_factory=list)  # started with the server

    def serve(self) -> None:
        """Print the URL and serve until Ctrl-C."""
        import uvicorn
        from fastapi import FastAPI
        from nicegui import app as pages
        from nicegui import ui

        sock = listening(self.port)
        port, token = sock.getsockname()[1], token_auth.token()
        app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
        self.register(app)
        pages.add_static_files("/web", STATIC, max_cache_age=0)
        ui.run_with(
            app,
            title=self.title,
            language="en-US",
            dark=None,
            favicon=STATIC / "favicon.svg",
            show_welcome_message=False,
            tailwind=False,  # its compiler runs in the browser, for most of the time until a page is shown
            gzip_middleware_factory=None,  # connections are local
            reconnect_timeout=30.0,  # a busy machine answers late; dead-man switches do not depend on this
        )
        for task in (ignore_malformed_messages, *self.tasks):
            pages.on_startup(task)
        config = uvicorn.Config(
            token_auth.TokenAuth(app, token, port),
            log_level="critical",
            access_log=False,
            lifespan="on",
            ws_max_size=LARGEST,
            timeout_graceful_shutdown=CLOSING,
        )
        address = f"http://127.0.0.1:{port}{self.start}{'&' if '?' in self.start else '?'}token={token}"
        self.announce(address)
        if self.open_browser:
            webbrowser.open(address)
        # NiceGUI reads the class of every garbage-collected object, which raises for one of canopen
        gc.freeze()
        silence_shutdown()
        with suppress(KeyboardInterrupt):  # uvicorn raises the signal again at its end
            server = _stopping(self.stop)(config)
            for number in SIGNALS:  # uvicorn handles only SIGINT and SIGTERM
                if signal.getsignal(number) is not signal.SIG_IGN:
                    signal.signal(number, server.handle_exit)
            server.run(sockets=[sock])
        with suppress(OSError):  # the terminal may be closed
            self.announce(self.closing_message)


def ignore_malformed_messages() -> None:
    """Suppress exceptions that libraries raise on malformed socket messages; the messages are dropped.

    Exceptions of pages do not reach this handler: NiceGUI logs them.
    """
    for name in ("engineio.server", "socketio.server"):
        logging.getLogger(name).setLevel(logging.CRITICAL)

    def handle(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        trace = getattr(context.get("exception"), "__traceback__", None)
        frames = [frame.f_globals.get("__name__", "") for frame, _ in traceback.walk_tb(trace)]
        if not any(name.startswith("socketio.") for name in frames):
            loop.default_exception_handler(context)

    asyncio.get_running_loop().set_exception_handler(handle)


def silence_shutdown() -> None:
    """Drop what NiceGUI logs on tasks that are busy when the server ends, such as the timers of an open page."""
    logging.getLogger("nicegui").addFilter(lambda record: not str(record.msg).startswith("Could not cancel"))


def _stopping(stop: Callable[[], None]) -> type[Server]:
    """Return a server class that calls `stop` at the signal, not after its connections have closed."""
    import uvicorn

    class Stopping(uvicorn.Server):
        def handle_exit(self, sig: int, frame: FrameType | None) -> None:
            if not self.should_exit:
                with suppress(RuntimeError):  # the server has not started
                    asyncio.get_running_loop().call_soon_threadsafe(stop)
            super().handle_exit(sig, frame)

    return Stopping
