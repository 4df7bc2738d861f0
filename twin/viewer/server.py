"""Serve the viewer to the browser of this machine; the folders of runs are only read."""

from __future__ import annotations

import importlib
import logging
import threading
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from twin.errors import TwinError
from twin.installed import import_optional
from twin.viewer import page, requests
from twin.viewer.runs import RunCollection, open_recorded_run
from twin.viewer.scene_data import Scenes
from twin.viewer.study_cases import study_cases
from twin.web import Site

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from fastapi import FastAPI

    from twin.viewer.study_cases import StudyCases


@dataclass
class ViewedRuns:
    """Opened runs with their page."""

    runs: RunCollection
    signals: Sequence[str] = ()
    cases: Sequence[int] = ()
    study: StudyCases | None = None

    def __post_init__(self) -> None:
        self._is_running = bool(self.runs.growing)

    @cached_property
    def scenes(self) -> Scenes:
        """Pictures of the machine."""
        return Scenes(self.runs)

    @cached_property
    def _first_text(self) -> str:
        return page.served_page(self.runs, self.signals, self.cases, self.study)

    def text(self, signals: Sequence[str] = ()) -> str:
        """Return the page, initially with other signals if given; of runs in progress at their opening, as they are now."""
        if signals or self._is_running:
            return page.served_page(self.runs, signals or self.signals, self.cases, self.study)
        return self._first_text

    def report(self, number: str) -> str:
        """Return the report of a run by its number, from 0, with links to this viewer."""
        if not number.isdigit() or int(number) >= len(self.runs.runs):
            raise requests.RequestError(f"run: {number[:20]!r} is not a number of a run.")
        path = self.runs.runs[int(number)].folder / page.REPORT
        if not path.exists():
            raise TwinError(f"{path}: does not exist. Run the scenario with a report.")
        case = f"case={self.study.current}&amp;" if self.study else ""
        return path.read_text("utf-8").replace("<html ", f'<html data-viewer="/?{case}" ', 1)


class ServedCases:
    """The runs of the command, and cases of the study that they belong to, opened when their links are followed."""

    def __init__(self, first: ViewedRuns) -> None:
        self.first = first
        self._opened: dict[int, ViewedRuns] = {}
        self._lock = threading.Lock()

    def find(self, number: str) -> ViewedRuns:
        """Return the runs of a page: the case of a study by its number, or those of the command."""
        study = self.first.study
        if not number or (study is not None and number == str(study.current)):
            return self.first
        if study is None or not number.isdigit() or int(number) not in study.folders:
            raise requests.RequestError(f"case: {number[:20]!r} is not a kept case of a study.")
        with self._lock:
            if int(number) not in self._opened:
                run = open_recorded_run(study.folders[int(number)])
                opened = RunCollection([run], self.first.runs.cache)
                signals = [name for name in self.first.signals if name in opened.runs[0].recording.column_indices]
                self._opened[int(number)] = ViewedRuns(opened, signals, (), replace(study, current=int(number)))
            return self._opened[int(number)]


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
    first = ViewedRuns(runs, signals, cases, study_cases(runs))
    first.text()  # rendered now, so that errors appear in the terminal
    Site(
        "Viewer",
        lambda app: register(app, ServedCases(first)),
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


def register(app: FastAPI, served: ServedCases) -> None:
    """Add the page at `/`, reports at `/report`, and answers to requests; `?case=713` of each is that of another case of a study."""
    from starlette.concurrency import run_in_threadpool
    from starlette.requests import Request
    from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response

    async def shown(request: Request) -> Response:
        names = request.query_params.getlist("signal")
        try:
            return HTMLResponse(
                await run_in_threadpool(lambda: served.find(request.query_params.get("case", "")).text(names))
            )
        except TwinError as error:
            return PlainTextResponse(str(error), 404)

    async def report(request: Request) -> Response:
        case, number = (request.query_params.get(key, "") for key in ("case", "run"))
        try:
            return HTMLResponse(await run_in_threadpool(lambda: served.find(case).report(number)))
        except TwinError as error:
            return PlainTextResponse(str(error), 404)

    def answering(answer: Callable[[dict[str, Any], ViewedRuns], bytes | dict[str, Any]]) -> Any:
        def locked(body: bytes, number: str) -> Response:
            wanted, viewed = requests.parse_body(body), served.find(number)
            # times and values of the same moment; finished runs are read by several requests at once
            with viewed.runs.cache.lock if viewed.runs.growing else nullcontext():
                content = answer(wanted, viewed)
            if isinstance(content, bytes):
                return Response(content, media_type="application/octet-stream")
            return JSONResponse(content)

        async def route(request: Request) -> Response:
            body = b""
            async for part in request.stream():
                body += part
                if len(body) > requests.MAX_BODY:
                    break
            try:
                return await run_in_threadpool(locked, body, request.query_params.get("case", ""))
            except requests.RequestError as error:
                return PlainTextResponse(str(error), 400)
            except OSError as error:  # e.g. a network share that is gone
                logging.getLogger("twin").debug("viewer", exc_info=error)
                return PlainTextResponse(f"{error.filename or 'the run'}: cannot be read ({error.strerror}).", 503)

        return route

    app.add_route("/", shown, methods=["GET"])
    app.add_route("/report", report, methods=["GET"])
    for path, answer in ANSWERS.items():
        app.add_route(path, answering(answer), methods=["POST"])


ANSWERS: dict[str, Callable[[dict[str, Any], ViewedRuns], bytes | dict[str, Any]]] = {
    "/lines": lambda request, viewed: requests.lines(request, viewed.runs),
    "/values": lambda request, viewed: requests.values(request, viewed.runs),
    "/statistics": lambda request, viewed: requests.statistics(request, viewed.runs),
    "/scene": lambda request, viewed: requests.scene(request, viewed.scenes),
    "/progress": lambda _, viewed: viewed.runs.progress(),
}
