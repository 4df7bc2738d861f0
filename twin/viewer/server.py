"""Serve the viewer to the browser of this machine; the folders of runs are only read."""

from __future__ import annotations

import importlib
import logging
import threading
from typing import TYPE_CHECKING, Any

from twin.installed import import_optional
from twin.viewer import page, requests
from twin.web import Site

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from fastapi import FastAPI

    from twin.viewer.runs import RunCollection


def serve(
    runs: RunCollection,
    port: int | None,
    announce: Callable[[str], None],
    *,
    open_browser: bool = False,
    signals: Sequence[str] = (),
    cases: Sequence[int] = (),
) -> None:
    """Print the URL and serve until Ctrl-C. `signals`, `cases`: shown initially."""
    import_optional("nicegui", "console", "twin view")
    is_running = bool(runs.growing)
    text = page.served_page(runs, signals, cases)  # rendered now, so that errors appear in the terminal

    def shown() -> str:
        return page.served_page(runs, signals, cases) if is_running else text

    Site(
        "Viewer",
        lambda app: register(app, runs, shown),
        start="/",
        announce=announce,
        port=port,
        open_browser=open_browser,
        closing_message="The viewer is closed.",
        tasks=[preload_scipy],
    ).serve()


def preload_scipy() -> None:
    """Import the module of spectra in the background: it takes a second."""
    threading.Thread(target=importlib.import_module, args=("scipy.signal",), daemon=True).start()


def register(app: FastAPI, runs: RunCollection, text: Callable[[], str]) -> None:
    """Add the page at `/`, samples at `/lines`, values at cursors at `/values`, statistics at `/statistics`, pictures at `/scene`, the progress of runs at `/progress`."""
    from starlette.concurrency import run_in_threadpool
    from starlette.requests import Request
    from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response

    from twin.viewer.scene_data import Scenes

    scenes = Scenes(runs)

    async def shown(_: Request) -> Response:
        return HTMLResponse(await run_in_threadpool(text))

    def answering(answer: Callable[[dict[str, Any]], Response]) -> Any:
        async def route(request: Request) -> Response:
            body = b""
            async for part in request.stream():
                body += part
                if len(body) > requests.MAX_BODY:
                    break
            try:
                return await run_in_threadpool(answer, requests.parse_body(body))
            except requests.RequestError as error:
                return PlainTextResponse(str(error), 400)
            except OSError as error:  # e.g. a network share that is gone
                logging.getLogger("twin").debug("viewer", exc_info=error)
                return PlainTextResponse(f"{error.filename or 'the run'}: cannot be read ({error.strerror}).", 503)

        return route

    def lines(request: dict[str, Any]) -> Response:
        with runs.cache.lock:  # times and values of the same moment
            return Response(requests.lines(request, runs), media_type="application/octet-stream")

    def values(request: dict[str, Any]) -> Response:
        with runs.cache.lock:
            return JSONResponse(requests.values(request, runs))

    def statistics(request: dict[str, Any]) -> Response:
        with runs.cache.lock:
            return JSONResponse(requests.statistics(request, runs))

    def scene(request: dict[str, Any]) -> Response:
        with runs.cache.lock:
            return Response(requests.scene(request, scenes), media_type="application/octet-stream")

    def progress(_: dict[str, Any]) -> Response:
        return JSONResponse(runs.progress())

    app.add_route("/", shown, methods=["GET"])
    app.add_route("/lines", answering(lines), methods=["POST"])
    app.add_route("/values", answering(values), methods=["POST"])
    app.add_route("/statistics", answering(statistics), methods=["POST"])
    app.add_route("/scene", answering(scene), methods=["POST"])
    app.add_route("/progress", answering(progress), methods=["POST"])
