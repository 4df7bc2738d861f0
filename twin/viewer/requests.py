"""Requests of a page, checked: their content is not trusted."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import TwinError
from twin.viewer.curve_data import KINDS, values_at
from twin.viewer.runs import ViewedCurve
from twin.viewer.verdicts import normalize

if TYPE_CHECKING:
    from twin.viewer.curve_data import CurvePoints
    from twin.viewer.runs import RunCollection

MAX_BODY = 1 << 18  # largest request [byte]
MAX_CURVES = 200  # in a request
POINTS = (16, 8000)  # of a curve
MAX_TIMES = 8  # of cursors
MAX_LETTERS = 400  # of an expression, the limit of `expression`


class RequestError(TwinError):
    """An invalid request."""


@dataclass(frozen=True)
class CurveRequest:
    """A curve with its visible window [s] and kind of drawing."""

    curve: ViewedCurve
    kind: str
    window: tuple[float, float]


def parse_body(body: bytes) -> dict[str, Any]:
    """Return a request as a dict."""
    if len(body) > MAX_BODY:
        raise RequestError(f"a request of {len(body)} bytes is too long.")
    try:
        result = json.loads(body)
    except (ValueError, RecursionError):
        result = None
    if not isinstance(result, dict):
        raise RequestError("expected a JSON object.")
    return result


def check_list(request: dict[str, Any], key: str, limit: int) -> list[Any]:
    """Return a list of a request."""
    result = request.get(key)
    if not isinstance(result, list) or len(result) > limit:
        raise RequestError(f"{key}: expected a list of at most {limit}.")
    return result


def check_number(value: Any, key: str) -> float:
    """Return a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise RequestError(f"{key}: expected a number.")
    return float(value)


def check_index(value: Any, key: str, count: int) -> int:
    """Return the number of a case."""
    if type(value) is not int or not 0 <= value < count:
        raise RequestError(f"{key}: expected a whole number from 0 to {count - 1}.")
    return value


def check_text(value: Any, key: str) -> str:
    """Return a text of limited length."""
    if not isinstance(value, str) or len(value) > MAX_LETTERS:
        raise RequestError(f"{key}: expected a text of at most {MAX_LETTERS} letters.")
    return value


def parse_curve(request: Any, runs: RunCollection) -> CurveRequest:
    """Return a curve of a request."""
    if not isinstance(request, dict):
        raise RequestError("curves: expected objects.")
    window = request.get("window")
    if not isinstance(window, list) or len(window) != 2:
        raise RequestError("window: expected two times.")
    begin, end = (check_number(time, "window") for time in window)
    kind = request.get("kind", "time")
    if not isinstance(kind, str) or kind not in KINDS:
        raise RequestError(f"kind: expected one of {', '.join(KINDS)}.")
    count = len(runs.cases)
    minus = request.get("minus")
    curve = ViewedCurve(
        check_text(request.get("signal"), "signal"),
        check_index(request.get("case"), "case", count),
        None if minus is None else check_index(minus, "minus", count),
        check_number(request.get("shift", 0.0), "shift"),
        check_text(request.get("x", ""), "x"),
    )
    return CurveRequest(curve, kind, (begin, end))


def lines(request: dict[str, Any], runs: RunCollection) -> bytes:
    """Return the drawn curves in the format of `twin.web.frames`, with a head or an error for each curve."""
    points = request.get("points")
    if type(points) is not int or not POINTS[0] <= points <= POINTS[1]:
        raise RequestError(f"points: expected a whole number from {POINTS[0]} to {POINTS[1]}.")
    heads: list[dict[str, Any]] = []
    arrays = []
    for wanted in [parse_curve(curve, runs) for curve in check_list(request, "curves", MAX_CURVES)]:
        try:
            line = KINDS[wanted.kind](runs, wanted.curve, wanted.window, points)
        except TwinError as error:
            heads.append({"error": error.problems[0]})
            arrays += [np.zeros(0), np.zeros(0)]
            continue
        heads.append(head(line, wanted.curve))
        arrays += [line.x, line.y]
    counts = [len(array) for array in arrays[::2]]
    text = json.dumps({"heads": heads, "counts": counts}, allow_nan=False).encode()
    parts = [len(text).to_bytes(4, "little"), bytes(4), text, bytes(-len(text) % 8)]
    return b"".join([*parts, *(np.ascontiguousarray(array, "<f8").tobytes() for array in arrays)])


def head(line: CurvePoints, curve: ViewedCurve) -> dict[str, Any]:
    """Return the description of a curve."""
    return {
        "count": line.count,
        "unit": line.unit,
        "x_unit": line.x_unit,
        "real": line.is_real,
        "truth": line.is_boolean,
        "key": normalize(curve.signal),
    }


def values(request: dict[str, Any], runs: RunCollection) -> dict[str, Any]:
    """Return the values of curves at times, a list for each curve."""
    result: list[list[float | None]] = []
    curves = [parse_curve(curve, runs) for curve in check_list(request, "curves", MAX_CURVES)]
    times = check_list(request, "times", MAX_CURVES)
    if len(times) != len(curves):
        raise RequestError("times: expected a list for every curve.")
    for wanted, own in zip(curves, times, strict=True):
        if not isinstance(own, list) or len(own) > MAX_TIMES:
            raise RequestError(f"times: expected lists of at most {MAX_TIMES} times.")
        when = [check_number(time, "times") for time in own]
        try:
            result.append(values_at(runs, wanted.curve, when))
        except RequestError:
            raise
        except TwinError:
            result.append([None] * len(when))
    return {"values": result}
