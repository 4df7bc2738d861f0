"""What a page asks for, checked: nothing of it is believed, whoever sent it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import TwinError
from twin.viewer.curve_data import KINDS, valued
from twin.viewer.runs import Curve
from twin.viewer.verdicts import normal

if TYPE_CHECKING:
    from twin.viewer.curve_data import Line
    from twin.viewer.runs import Runs

LONGEST = 1 << 18  # of a request [byte]
CURVES = 200  # in a request
POINTS = (16, 8000)  # of a curve
TIMES = 8  # of cursors
LETTERS = 400  # of an expression, as `expression` has it


class AskedError(TwinError):
    """A request that no page of ours sends."""


@dataclass(frozen=True)
class Wanted:
    """A curve with the part of it that is in view [s], and how it is drawn."""

    curve: Curve
    kind: str
    window: tuple[float, float]


def content(body: bytes) -> dict[str, Any]:
    """A request as a dict."""
    if len(body) > LONGEST:
        raise AskedError(f"a request of {len(body)} bytes is too long.")
    try:
        found = json.loads(body)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise AskedError("expected a JSON object.")
    return found


def items(told: dict[str, Any], key: str, most: int) -> list[Any]:
    """A list of a request."""
    found = told.get(key)
    if not isinstance(found, list) or len(found) > most:
        raise AskedError(f"{key}: expected a list of at most {most}.")
    return found


def number(value: Any, key: str) -> float:
    """A finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise AskedError(f"{key}: expected a number.")
    return float(value)


def place(value: Any, key: str, count: int) -> int:
    """The number of a case."""
    if type(value) is not int or not 0 <= value < count:
        raise AskedError(f"{key}: expected a whole number from 0 to {count - 1}.")
    return value


def text(value: Any, key: str) -> str:
    """A text that is no longer than an expression may be."""
    if not isinstance(value, str) or len(value) > LETTERS:
        raise AskedError(f"{key}: expected a text of at most {LETTERS} letters.")
    return value


def wanted(told: Any, runs: Runs) -> Wanted:
    """A curve of a request."""
    if not isinstance(told, dict):
        raise AskedError("curves: expected objects.")
    window = told.get("window")
    if not isinstance(window, list) or len(window) != 2:
        raise AskedError("window: expected two times.")
    begin, end = (number(one, "window") for one in window)
    kind = told.get("kind", "time")
    if not isinstance(kind, str) or kind not in KINDS:
        raise AskedError(f"kind: expected one of {', '.join(KINDS)}.")
    count = len(runs.cases)
    minus = told.get("minus")
    curve = Curve(
        text(told.get("signal"), "signal"),
        place(told.get("case"), "case", count),
        None if minus is None else place(minus, "minus", count),
        number(told.get("shift", 0.0), "shift"),
        text(told.get("x", ""), "x"),
    )
    return Wanted(curve, kind, (begin, end))


def lines(told: dict[str, Any], runs: Runs) -> bytes:
    """What is drawn, as `twin.web.frames` packs it; with a head for each curve, which says why where it cannot be had."""
    points = told.get("points")
    if type(points) is not int or not POINTS[0] <= points <= POINTS[1]:
        raise AskedError(f"points: expected a whole number from {POINTS[0]} to {POINTS[1]}.")
    heads: list[dict[str, Any]] = []
    arrays = []
    for one in [wanted(curve, runs) for curve in items(told, "curves", CURVES)]:
        try:
            line = KINDS[one.kind](runs, one.curve, one.window, points)
        except TwinError as error:
            heads.append({"error": error.problems[0]})
            arrays += [np.zeros(0), np.zeros(0)]
            continue
        heads.append(head(line, one.curve))
        arrays += [line.x, line.y]
    counts = [len(one) for one in arrays[::2]]
    text = json.dumps({"heads": heads, "counts": counts}, allow_nan=False).encode()
    parts = [len(text).to_bytes(4, "little"), bytes(4), text, bytes(-len(text) % 8)]
    return b"".join([*parts, *(np.ascontiguousarray(one, "<f8").tobytes() for one in arrays)])


def head(line: Line, curve: Curve) -> dict[str, Any]:
    """What a page must know of a line besides its points."""
    return {
        "count": line.count, "unit": line.unit, "x_unit": line.x_unit, "real": line.is_real,
        "truth": line.is_truth, "key": normal(curve.signal),
    }  # fmt: skip


def values(told: dict[str, Any], runs: Runs) -> dict[str, Any]:
    """The values of curves at times, those of each curve its own."""
    found: list[list[float | None]] = []
    curves = [wanted(curve, runs) for curve in items(told, "curves", CURVES)]
    times = items(told, "times", CURVES)
    if len(times) != len(curves):
        raise AskedError("times: expected a list for every curve.")
    for one, own in zip(curves, times, strict=True):
        if not isinstance(own, list) or len(own) > TIMES:
            raise AskedError(f"times: expected lists of at most {TIMES} times.")
        when = [number(time, "times") for time in own]
        try:
            found.append(valued(runs, one.curve, when))
        except AskedError:
            raise
        except TwinError:
            found.append([None] * len(when))
    return {"values": found}
