"""Requests of a page, checked: their content is not trusted."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from twin.errors import TwinError
from twin.scenario import dotted
from twin.viewer.curve_data import KINDS, values_at
from twin.viewer.curve_data import statistics as window_statistics
from twin.viewer.runs import ViewedCurve
from twin.viewer.verdicts import normalize

if TYPE_CHECKING:
    from collections.abc import Iterable

    from twin.viewer.curve_data import CurvePoints
    from twin.viewer.runs import RunCollection
    from twin.viewer.scene_data import Scenes

Keys = TypeVar("Keys", bound="RequestKeys")

MAX_BODY = 1 << 18  # largest request [byte]
MAX_CURVES = 200  # in a request
POINTS = (16, 8000)  # of a curve
MAX_SEEDS = 1000  # of a curve
MAX_TIMES = 8  # of cursors
MAX_LETTERS = 400  # of an expression, the limit of `expression`


class RequestError(TwinError):
    """An invalid request."""


Finite = Annotated[float, Field(allow_inf_nan=False)]


class RequestKeys(BaseModel):
    """Base of the requests; values are not converted."""

    model_config = ConfigDict(strict=True)


class CurveRequest(RequestKeys):
    """A curve with its visible window [s] and kind of drawing."""

    signal: Annotated[str, Field(max_length=MAX_LETTERS)]
    case: Annotated[int, Field(ge=0)]
    window: Annotated[list[Finite], Field(min_length=2, max_length=2)]
    minus: Annotated[int, Field(ge=0)] | None = None
    shift: Finite = 0.0
    x: Annotated[str, Field(max_length=MAX_LETTERS)] = ""
    kind: str = "time"
    seeds: Annotated[list[Annotated[int, Field(ge=0)]], Field(max_length=MAX_SEEDS)] = Field(default_factory=list)
    partners: Annotated[list[Annotated[int, Field(ge=0)]], Field(max_length=MAX_SEEDS)] = Field(default_factory=list)
    part: Literal["mean", "low", "high"] = "mean"

    def curve(self, runs: RunCollection) -> ViewedCurve:
        """Return the curve; RequestError if there is no such case or kind of drawing."""
        count = len(runs.cases)
        if max(self.case, self.minus or 0, *self.seeds, *self.partners) >= count:
            raise RequestError(f"case: expected a whole number from 0 to {count - 1}.")
        if len(self.partners) not in (0, len(self.seeds)):
            raise RequestError("partners: expected none, or one for each of the seeds.")
        if self.kind not in KINDS:
            raise RequestError(f"kind: expected one of {', '.join(KINDS)}.")
        seeds, partners = tuple(self.seeds), tuple(self.partners)
        return ViewedCurve(self.signal, self.case, self.minus, self.shift, self.x, seeds, partners, self.part)


class CurvesRequest(RequestKeys):
    """Curves to draw with a number of points each."""

    points: Annotated[int, Field(ge=POINTS[0], le=POINTS[1])]
    curves: Annotated[list[CurveRequest], Field(max_length=MAX_CURVES)]


class StatisticsRequest(RequestKeys):
    """Curves whose windows are summarized."""

    curves: Annotated[list[CurveRequest], Field(max_length=MAX_CURVES)]


class SceneRequest(RequestKeys):
    """A case whose picture is moved, and the window [s] of the values."""

    case: Annotated[int, Field(ge=0)]
    window: Annotated[list[Finite], Field(min_length=2, max_length=2)]


class ValuesRequest(RequestKeys):
    """Curves, and for each of them the times of the cursors [s]."""

    curves: Annotated[list[CurveRequest], Field(max_length=MAX_CURVES)]
    times: Annotated[list[Annotated[list[Finite], Field(max_length=MAX_TIMES)]], Field(max_length=MAX_CURVES)]


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


def validate(model: type[Keys], request: dict[str, Any]) -> Keys:
    """Return a request as an object; RequestError names its first wrong value."""
    try:
        return model.model_validate(request)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise RequestError(f"{dotted(first['loc'])}: {first['msg']}.") from None


def lines(request: dict[str, Any], runs: RunCollection) -> bytes:
    """Return the drawn curves in the format of `twin.web.frames`, with a head or an error for each curve."""
    wanted = validate(CurvesRequest, request)
    heads: list[dict[str, Any]] = []
    arrays: list[Any] = []
    counts: list[int] = []
    timed: list[bool] = []
    for request_keys, curve in [(keys, keys.curve(runs)) for keys in wanted.curves]:
        try:
            line = KINDS[request_keys.kind](
                runs, curve, (request_keys.window[0], request_keys.window[1]), wanted.points
            )
        except TwinError as error:
            heads.append({"error": error.problems[0]})
            counts.append(0)
            timed.append(False)
            continue
        heads.append(head(line, curve))
        counts.append(len(line.x))
        timed.append(line.time is not None)
        arrays += [line.x, line.y, *([] if line.time is None else [line.time])]
    return pack({"heads": heads, "counts": counts, "timed": timed}, arrays)


def pack(header: dict[str, Any], arrays: Iterable[Any]) -> bytes:
    """Return a header and arrays as one answer: its length, the header as JSON padded to 8 bytes, Float64 numbers."""
    text = json.dumps(header, allow_nan=False).encode()
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
    wanted = validate(ValuesRequest, request)
    if len(wanted.times) != len(wanted.curves):
        raise RequestError("times: expected a list for every curve.")
    result: list[list[float | None]] = []
    curves = [keys.curve(runs) for keys in wanted.curves]
    for curve, times in zip(curves, wanted.times, strict=True):
        try:
            result.append(values_at(runs, curve, times))
        except TwinError:
            result.append([None] * len(times))
    return {"values": result}


def statistics(request: dict[str, Any], runs: RunCollection) -> dict[str, Any]:
    """Return statistics of the windows of curves; `count` 0 for a curve without samples."""
    wanted = validate(StatisticsRequest, request)
    result: list[dict[str, Any]] = []
    for keys, curve in [(keys, keys.curve(runs)) for keys in wanted.curves]:
        try:
            result.append(window_statistics(runs, curve, (keys.window[0], keys.window[1])))
        except TwinError:
            result.append({"count": 0})
    return {"statistics": result}


def scene(request: dict[str, Any], scenes: Scenes) -> bytes:
    """Return the views of a case and the values that move them: time, then each signal in the order of the header."""
    wanted = validate(SceneRequest, request)
    count = len(scenes.runs.cases)
    if wanted.case >= count:
        raise RequestError(f"case: expected a whole number from 0 to {count - 1}.")
    samples = scenes.samples(wanted.case, (wanted.window[0], wanted.window[1]))
    header = {
        "views": scenes.views(wanted.case),
        "count": len(samples.time),
        "signals": [{"name": name, "shape": array.shape[1:]} for name, array in samples.values.items()],
    }
    return pack(header, [samples.time, *samples.values.values()])
