"""What a chart is given: extremes are never lost, nothing flickers, and no request can ask for what is not there."""

import json
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.datastructures import QueryParams

from tests.every_case import every_case
from twin.web import frames

KNOWN = {"a.x", "b.y[1]"}
NUMBERS = st.floats(-1e6, 1e6, allow_nan=False)


@given(st.lists(NUMBERS, min_size=1, max_size=700), st.integers(16, 80), st.integers(0, 1000))
def test_extremes_stay(values, points, first):
    y = np.array(values)
    x = np.arange(len(y)) / 1000.0
    seen_x, seen_y = frames.decimate(x, y, points, first)
    assert len(seen_x) <= 4 * points + 10
    assert (seen_y.min(), seen_y.max()) == (y.min(), y.max())
    assert (np.diff(seen_x) >= 0).all()
    assert seen_x[-1] >= x[-1] - len(y) / points / 1000  # the newest is shown
    assert {*zip(seen_x, seen_y, strict=True)} <= {*zip(x, y, strict=True)}


def test_a_window_that_moves_shows_the_same_points():
    y = np.random.default_rng(1).standard_normal(20_000)
    x = np.arange(len(y)) * 1e-3
    for begin in range(1000, 1040, 7):
        seen = {*frames.decimate(x[begin : begin + 10_000], y[begin : begin + 10_000], 500, begin)[0]}
        later = {*frames.decimate(x[begin + 3 : begin + 10_003], y[begin + 3 : begin + 10_003], 500, begin + 3)[0]}
        inside = {one for one in seen if x[begin + 100] < one < x[begin + 9800]}
        assert inside <= later


class Line:
    """A source: y = 2 x."""

    def names(self):
        return KNOWN

    def span(self):
        return 0.0, 8.0

    def read(self, name, start, stop, points):
        x = np.arange(start, stop)
        return frames.decimate(x, 2 * x, points)


@pytest.mark.parametrize(
    ("query", "window"),
    [("", [0, 8]), ("&from=2&to=5", [2, 5]), ("&span=3", [5, 8]), ("&span=20", [0, 20])],
)
def test_an_answer(query, window):
    asked = frames.parse_request(QueryParams(f"name=a.x&name=b.y[1]{query}"), KNOWN)
    content = frames.answer(Line(), asked)
    length = struct.unpack_from("<I", content)[0]
    header = json.loads(content[8 : 8 + length])
    assert [header["from"], header["to"]] == window
    values = np.frombuffer(content[8 + -(-length // 8) * 8 :])
    count = header["counts"][0]
    assert (values[count : 2 * count] == 2 * values[:count]).all()
    assert len(values) == 2 * sum(header["counts"])


@every_case(
    ("query", "wrong"),
    [
        ("", "name: 0 curves"),
        ("name=nothing", "'nothing' is not a known signal"),
        ("&".join(["name=a.x"] * 65), "name: 65 curves"),
        ("name=a.x&from=nan&to=1", "from: expected a time"),
        ("name=a.x&from=1e300&to=2", "from: expected a time"),
        ("name=a.x&from=2&to=1", "from, to"),
        ("name=a.x&from=2", "from, to"),
        ("name=a.x&span=0", "span"),
        ("name=a.x&span=-inf", "span"),
        ("name=a.x&points=1e9", "points"),
        ("name=a.x&points=99999999999999999999", "points"),
        ("name=a.x&points=-5", "points"),
        ("name=a.x&points=²", "points"),
    ],
)
def test_what_is_refused(query, wrong):
    with pytest.raises(ValueError, match=wrong):
        frames.parse_request(QueryParams(query), KNOWN)


@given(st.text(max_size=30), st.text(max_size=30), st.text(max_size=30))
def test_any_text_is_checked(name, time, points):
    try:
        asked = frames.parse_request(QueryParams({"name": name, "span": time, "points": points}), KNOWN)
    except ValueError as error:
        assert "\n" not in str(error)  # noqa: PT017
    else:
        assert asked.names[0] in KNOWN
        assert 16 <= asked.points <= 4000


def test_a_thousand_samples_become_two_for_each_stretch():
    """Of 16 samples for 100 points, the next power of two; the last, incomplete stretch of 8 keeps its ends."""
    time = np.arange(1000.0)
    x, y = frames.decimate(time, time % 16, 100)
    assert x[:4].tolist() == [0.0, 15.0, 16.0, 31.0]
    assert (len(x), y[:2].tolist(), x[-2:].tolist()) == (2 * 62 + 2, [0.0, 15.0], [992.0, 999.0])
    assert frames.decimate(time, time, 500)[0] is time  # two samples a point are all drawn
