"""The page and what it asks for, served to the browser of this machine; reads the runs' folders and writes nothing."""

from __future__ import annotations

import importlib
import logging
import threading
from typing import TYPE_CHECKING, Any

from twin.viewer import page, requests
from twin.web import Site, needed

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from fastapi import FastAPI

    from twin.viewer.runs import Runs


def serve(
    runs: Runs,
    port: int | None,
    said: Callable[[str], None],
    *,
    opened: bool = False,
    signals: Sequence[str] = (),
    cases: Sequence[int] = (),
) -> None:
    """Serve until Ctrl-C; the address is said first. `signals`, `cases`: shown at first."""
    needed("twin view")
    goes_on = bool(runs.growing)
    text = page.of_server(runs, signals, cases)  # now: what is wrong with a run is told in the terminal

    def shown() -> str:
        return page.of_server(runs, signals, cases) if goes_on else text

    Site(
        "Viewer", lambda app: register(app, runs, shown), start="/", said=said, port=port, opened=opened,
        over="The viewer is closed.", tasks=[ahead],
    ).serve()  # fmt: skip


def ahead() -> None:
    """Import what the first spectrum needs, which takes a second, while nobody waits for it."""
    threading.Thread(target=importlib.import_module, args=("scipy.signal",), daemon=True).start()


def register(app: FastAPI, runs: Runs, text: Callable[[], str]) -> None:
    """The page at `/`, its samples at `/lines`, values at cursors at `/values`, how far runs are that go on at `/until`."""
    from starlette.concurrency import run_in_threadpool
    from starlette.requests import Request
    from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response

    async def shown(_: Request) -> Response:
        return HTMLResponse(await run_in_threadpool(text))

    def answering(answer: Callable[[dict[str, Any]], Response]) -> Any:
        async def route(request: Request) -> Response:
            body = b""
            async for part in request.stream():
                body += part
                if len(body) > requests.LONGEST:
                    break
            try:
                return await run_in_threadpool(answer, requests.content(body))
            except requests.AskedError as error:
                return PlainTextResponse(str(error), 400)
            except OSError as error:  # a share that is gone
                logging.getLogger("twin").debug("viewer", exc_info=error)
                return PlainTextResponse(f"{error.filename or 'the run'}: cannot be read ({error.strerror}).", 503)

        return route

    def lines(told: dict[str, Any]) -> Response:
        with runs.room.lock:  # times and values are of one moment
            return Response(requests.lines(told, runs), media_type="application/octet-stream")

    def values(told: dict[str, Any]) -> Response:
        with runs.room.lock:
            return JSONResponse(requests.values(told, runs))

    def until(_: dict[str, Any]) -> Response:
        return JSONResponse(runs.until())

    app.add_route("/", shown, methods=["GET"])
    app.add_route("/lines", answering(lines), methods=["POST"])
    app.add_route("/values", answering(values), methods=["POST"])
    app.add_route("/until", answering(until), methods=["POST"])
