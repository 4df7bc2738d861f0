"""Binary answers with curves for charts: as many points as the screen shows, with minima and maxima preserved.

    uint32 length of the header, uint32 0, header as JSON padded to 8 bytes, then for each curve x and y as Float64

A request names curves, a window (`from`, `to`; or the last `span` seconds; or all) and the number of points: see `Request`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from starlette.datastructures import QueryParams
    from starlette.requests import Request as HttpRequest
    from starlette.responses import Response

Floats = NDArray[np.float64]
MAX_CURVES = 64
POINTS = (16, 4000)  # for each curve
MAX_TIME = 1e9  # [s], of any time


class CurveSource(Protocol):
    """Source of curves: a running session, a recording."""

    def names(self) -> Collection[str]:
        """Return the available curves."""
        ...

    def span(self) -> tuple[float, float]:
        """Return the first and last time [s]."""
        ...

    def read(self, name: str, start: float, stop: float, points: int) -> tuple[Floats, Floats]:
        """Return times [s] and values in the display unit, of a window, decimated."""
        ...


@dataclass(frozen=True)
class Request:
    """A checked request: `start` and `stop` are None for all; `last` > 0 for the last seconds."""

    names: tuple[str, ...]
    start: float | None
    stop: float | None
    last: float
    points: int


def parse_request(query: QueryParams, allowed: Collection[str]) -> Request:
    """Return a request from the network; raise ValueError with one line if it is invalid."""
    names = tuple(query.getlist("name"))
    if not 0 < len(names) <= MAX_CURVES:
        raise ValueError(f"name: {len(names)} curves. Ask for 1 to {MAX_CURVES}.")
    for name in names:
        if name not in allowed:
            raise ValueError(f"name: {name[:80]!r} is not a known signal.")
    given = {key: _time(query, key) for key in ("from", "to", "span")}
    start, stop, last = given["from"], given["to"], given["span"]
    if (start is None) != (stop is None) or (start is not None and stop is not None and stop <= start):
        raise ValueError("from, to: give both, the first below the second.")
    if last is not None and last <= 0.0:
        raise ValueError("span: expected a time above zero.")
    points = query.get("points", "1000")
    if not points.isascii() or not points.isdigit() or not POINTS[0] <= int(points[:9]) <= POINTS[1]:
        raise ValueError(f"points: expected {POINTS[0]} to {POINTS[1]}, not {points[:20]!r}.")
    return Request(names, start, stop, last or 0.0, int(points))


def _time(query: QueryParams, key: str) -> float | None:
    text = query.get(key)
    if text is None:
        return None
    try:
        value = float(text[:40])
    except ValueError:
        value = math.nan
    if not abs(value) <= MAX_TIME:
        raise ValueError(f"{key}: expected a time in s, not {text[:20]!r}.")
    return value


def answer(source: CurveSource, request: Request) -> bytes:
    """Return the answer to a request."""
    first, newest = source.span()
    start, stop = (first, newest) if request.start is None or request.stop is None else (request.start, request.stop)
    if request.last:
        start, stop = max(newest, first + request.last) - request.last, max(newest, first + request.last)
    curves = [source.read(name, start, stop, request.points) for name in request.names]
    header = {"from": start, "to": max(stop, start + 1e-9), "last": newest, "counts": [len(x) for x, _ in curves]}
    text = json.dumps(header, allow_nan=False).encode()
    parts = [len(text).to_bytes(4, "little"), bytes(4), text, bytes(-len(text) % 8)]
    for x, y in curves:
        parts += [np.ascontiguousarray(x, "<f8").tobytes(), np.ascontiguousarray(y, "<f8").tobytes()]
    return b"".join(parts)


def route(app: Any, path: str, find_source: Callable[[HttpRequest], CurveSource | None]) -> None:
    """Serve curves at a path of a FastAPI or Starlette app; `find_source` returns the source of a request, or None."""
    from starlette.responses import PlainTextResponse, Response

    async def frame(request: HttpRequest) -> Response:
        source = find_source(request)
        if source is None:
            return Response(status_code=204)  # no session
        try:
            return Response(
                answer(source, parse_request(request.query_params, source.names())),
                media_type="application/octet-stream",
            )
        except ValueError as error:
            return PlainTextResponse(str(error), 400)

    app.add_route(path, frame, methods=["GET"])


def decimate(x: Floats, y: Floats, points: int, first: int = 0) -> tuple[Floats, Floats]:
    """Return the minimum and maximum of equal stretches of samples, each at its time: what a line of `points` pixels shows.

    `first`: index of the first sample. Stretches are powers of two, counted from sample 0, so that a moving window shows the
    same points and does not flicker.
    """
    count = len(x)
    stretch = 1 << max(math.ceil(math.log2(max(count, 1) / max(points, 1))), 0)
    if stretch <= 2:
        return x, y
    begin = min(-first % stretch, count)
    end = begin + (count - begin) // stretch * stretch
    middle = _extremes(y[begin:end], stretch) + begin
    indices = np.concatenate([_ends(y, 0, begin), middle, _ends(y, end, count)])
    return x[indices], y[indices]


def _extremes(y: Floats, stretch: int) -> NDArray[np.int64]:
    """Return the indices of minimum and maximum of each stretch, ordered by time."""
    from tsdownsample import MinMaxDownsampler

    if len(y) == 0:
        return np.empty(0, np.int64)
    indices = MinMaxDownsampler().downsample(  # type: ignore[no-untyped-call]
        np.ascontiguousarray(y), n_out=len(y) // stretch * 2
    )
    return np.asarray(indices, np.int64)


def _ends(y: Floats, begin: int, end: int) -> NDArray[np.int64]:
    """Return those of an incomplete stretch, with its first and last sample."""
    if end - begin <= 4:
        return np.arange(begin, end)
    part = y[begin:end]
    return np.unique([begin, begin + int(np.argmin(part)), begin + int(np.argmax(part)), end - 1])
