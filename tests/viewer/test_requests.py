"""What comes from the network is checked before anything is done with it."""

import json
import re
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.every_case import every_case
from tests.viewer.recorded import FORCE, folder_of, runs, wave
from twin.viewer.requests import RequestError, lines, parse_body, scene, statistics, values
from twin.viewer.scene_data import Scenes

CURVE = {"signal": "sensor.force", "case": 0, "window": [0, 1]}


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    time, force = wave(1000.0, 1.0)
    cases = {("base", 1): (time, {"sensor.force": force})}
    return runs(folder_of(tmp_path_factory.mktemp("asked") / "run", cases, [FORCE]))


@pytest.mark.parametrize(
    ("told", "why"),
    [
        ({}, "points: Field required."),
        ({"points": True, "curves": []}, "points: Input should be a valid integer"),
        ({"points": 1e9, "curves": []}, "points: Input should be a valid integer"),
        ({"points": 100, "curves": {}}, "curves: Input should be a valid list."),
        ({"points": 100, "curves": [CURVE] * 201}, "curves: List should have at most 200 items"),
        ({"points": 100, "curves": ["sensor.force"]}, "curves[1]: Input should be a valid dictionary"),
        ({"points": 100, "curves": [CURVE | {"case": 1}]}, "case: expected a whole number from 0 to 0."),
        (
            {"points": 100, "curves": [CURVE | {"case": -1}]},
            "curves[1].case: Input should be greater than or equal to 0.",
        ),
        ({"points": 100, "curves": [CURVE | {"minus": "A"}]}, "curves[1].minus: Input should be a valid integer."),
        ({"points": 100, "curves": [CURVE | {"kind": "__class__"}]}, "kind: expected one of time, xy, spectrum."),
        (
            {"points": 100, "curves": [CURVE | {"signal": "x" * 401}]},
            "curves[1].signal: String should have at most 400 characters.",
        ),
        ({"points": 100, "curves": [CURVE | {"signal": None}]}, "curves[1].signal: Input should be a valid string."),
        (
            {"points": 100, "curves": [CURVE | {"window": [0, float("nan")]}]},
            "curves[1].window[2]: Input should be a finite number.",
        ),
        ({"points": 100, "curves": [CURVE | {"window": "01"}]}, "curves[1].window: Input should be a valid list."),
        ({"points": 100, "curves": [CURVE | {"shift": "1"}]}, "curves[1].shift: Input should be a valid number."),
        ({"points": 100, "curves": [CURVE | {"seeds": [0, 1]}]}, "case: expected a whole number from 0 to 0."),
        ({"points": 100, "curves": [CURVE | {"partners": [1]}]}, "case: expected a whole number from 0 to 0."),
        (
            {"points": 100, "curves": [CURVE | {"partners": [0]}]},
            "partners: expected none, or one for each of the seeds.",
        ),
        (
            {"points": 100, "curves": [CURVE | {"part": "x"}]},
            "curves[1].part: Input should be 'mean', 'low' or 'high'.",
        ),
    ],
)
def test_what_no_page_sends_is_refused(opened, told, why):
    with pytest.raises(RequestError, match=re.escape(why)):
        lines(told, opened)


@every_case("body", [b"", b"[]", b"\xff", b"[" * 100_000, b"{" + b" " * (1 << 18)])
def test_what_is_no_request_is_refused(body):
    with pytest.raises(RequestError):
        parse_body(body)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from([*CURVE, "points", "curves", "times"]), inner)
    ),
    max_leaves=8,
)


@pytest.mark.slow
@given(
    told=st.dictionaries(st.sampled_from(["points", "curves", "times"]), JSON),
    one=st.fixed_dictionaries({}, optional=dict.fromkeys([*CURVE, "x", "kind", "minus"], JSON)),
)
def test_nothing_but_a_refusal_comes_of_it(opened, told, one):
    for answer in (lines, values, statistics):
        for asked in (told, {"points": 100, "curves": [CURVE | one], "times": [[0.5]]}):
            with suppress(RequestError):
                assert answer(asked, opened)


def test_an_answer_is_as_the_chart_reads_it(opened):
    time, force = wave(1000.0, 1.0)
    answer = lines({"points": 4000, "curves": [CURVE]}, opened)
    length = int.from_bytes(answer[:4], "little")
    head = json.loads(answer[8 : 8 + length])
    assert head["counts"] == [1000]
    assert head["heads"][0] | {"count": 0} == {
        "count": 0,
        "unit": "N",
        "x_unit": "s",
        "real": True,
        "truth": False,
        "key": "sensor.force",
    }
    data = np.frombuffer(answer[8 + -(-length // 8) * 8 :])
    np.testing.assert_array_equal(data, np.concatenate([time, force]))
    loop = lines({"points": 4000, "curves": [CURVE | {"kind": "xy", "x": "-sensor.force"}]}, opened)
    np.testing.assert_array_equal(np.frombuffer(loop[-3 * 8000 :]), np.concatenate([-force, force, time]))  # with times
    assert values({"curves": [CURVE], "times": [[0.25, 9.0]]}, opened) == {
        "values": [[pytest.approx(force[250]), None]]
    }


def test_a_scene_of_what_is_not_drawn_is_empty(opened):
    answer = scene({"case": 0, "window": [0.0, 0.5]}, Scenes(opened))
    length = int.from_bytes(answer[:4], "little")
    assert json.loads(answer[8 : 8 + length]) == {"views": [], "count": 501, "signals": []}
    with pytest.raises(RequestError, match="case: expected a whole number from 0 to 0"):
        scene({"case": 1, "window": [0, 1]}, Scenes(opened))
