"""What one drive said in a trace, without a bus."""

import pytest

from hw_bridge.hardware import NodeKeys
from hw_bridge.trace.decoder import DecodedFrame
from hw_bridge.trace.recording import Track

DISABLED, READY, ENABLED = 0x40, 0x21, 0x27  # statuswords of CiA 402


def track(**keys):
    return Track(NodeKeys.model_validate({"node": 3, "profile": "epos4", **keys}), "axis")


def hear(heard, time, **values):
    heard.hear(DecodedFrame(time, None, 3, "PDO", "", values))


def test_a_value_is_the_last_one_until_a_time():
    heard = track(scale=2.0)
    assert heard.at("velocity_actual_value", 5) is None
    for time, value in ((10, 1.0), (20, 2.0), (30, 4.0)):
        hear(heard, time, velocity_actual_value=value)
    assert [heard.at("velocity_actual_value", time) for time in (5, 10, 19, 20, 29, 99)] == [
        2.0,
        2.0,
        2.0,
        4.0,
        4.0,
        8.0,
    ]


def test_directions_and_scales():
    heard = track(scale=0.5, inverted=True)
    hear(heard, 1, position_actual_value=3.0, torque_actual_value=0.25, statusword=READY, other=1.0)
    hear(heard, 2, velocity_actual_value="7 rad/s")
    assert heard.values == {
        "position_actual_value": [-1.5],
        "velocity_actual_value": [],
        "current": [-0.25],
        "statusword": [float(READY)],
    }


def test_home_is_where_the_drive_stood_before_it_was_enabled():
    heard = track()
    for time, (word, position) in enumerate(
        ((DISABLED, 1.0), (DISABLED, 2.0), (READY, 3.0), (ENABLED, 4.0), (DISABLED, 5.0))
    ):
        hear(heard, time, position_actual_value=position, statusword=word)
        assert heard.home == pytest.approx(min(position, 2.0))
        assert heard.enabled is (word == ENABLED)
