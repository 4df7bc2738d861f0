"""Notable events and frames of a run, as they are shown, and values that a listener scales."""

from types import SimpleNamespace

import pytest

from hw_bridge.bus import Frame
from hw_bridge.hardware import HardwareKeys
from hw_bridge.trace.listener import BusListener
from hw_bridge.trace.watch import SHOWN, Watch
from tests.every_case import every_case

BENCH = {"simulated": True, "nodes": {"slide": {"node": 3, "profile": "epos4", "scale": 0.5, "inverted": True}}}


def watched(*frames):
    network = SimpleNamespace(observe=lambda hear: None, wall_clock=False)
    watch = Watch(HardwareKeys.model_validate(BENCH), network)
    for time, frame in frames:
        watch.hear(time, frame)
    return watch


def test_notable_events_of_a_run():
    fault = Frame(0x083, b"\x20\x73\x81\0\0\0\0\0")
    watch = watched(
        (0, Frame(0, b"\1\3")),
        (1_000_000, None),
        (2_000_000, None),
        (3_000_000, None),
        (4_000_000, Frame(0x080)),
        (5_000_000, fault),
        (6_000_000, None),
    )
    position = "EMCY slide: 7320h position sensor; register generic, manufacturer"
    assert watch.count == 7
    assert watch.events(0) == [
        "0.000000 s: NMT slide: start",
        "0.001000 s: ERROR error frame (again and again)",
        f"0.005000 s: {position}",
        "0.006000 s: ERROR error frame",
    ]
    assert watch.events(5_000_000) == [f"0.000000 s: {position}", "0.001000 s: ERROR error frame"]
    watch.close()


@pytest.mark.parametrize("number", [SHOWN, SHOWN + 1, SHOWN + 2])
def test_of_many_events_the_last_are_shown(number):
    watch = watched(*((k * 1_000_000, Frame(0, bytes([1, k + 4]))) for k in range(number)))
    events = watch.events(0)
    last = [f"{k / 1e3:.6f} s: NMT node {k + 4}: start" for k in range(number)][-SHOWN:]
    assert events == ([f"before: {number - SHOWN} more"] if number > SHOWN else []) + last


@every_case(
    ("identifier", "often"),
    [
        (0x000, False),
        (0x07F, False),
        (0x080, True),
        (0x081, False),
        (0x17F, False),
        (0x180, True),
        (0x57F, True),
        (0x580, False),
        (0x67F, False),
        (0x700, False),
        (0x701, True),
    ],
)
def test_daily_frames_do_not_push_out_rare_ones(identifier, often):
    watch = watched((1, Frame(identifier)))
    assert (len(watch.daily), len(watch.rare)) == (often, not often)


def test_frames_of_a_run_in_their_order():
    watch = watched((5, Frame(0x705, b"\5")), (5, Frame(0x585)), (5, None), (9, Frame(0x080)))
    assert [(line.time, line.service) for line in watch.lines()] == [
        (5, "HEARTBEAT"),
        (5, "SDO"),
        (5, "ERROR"),
        (9, "SYNC"),
    ]


def test_a_listener_scales_motion_and_turns_currents_round():
    listener = BusListener.__new__(BusListener)
    listener.factors = {3: ("slide", -1.0, 0.5)}
    values = {
        "position_actual_value": 4.0,
        "velocity_actual_value": 2.0,
        "profile_acceleration": 8.0,
        "following_error_actual_value": 6.0,
        "torque_actual_value": 1.5,
        "current_actual_value": 2.5,
        "statusword": 0x37,
        "name": "text",
        "digital_inputs": 3,
    }
    assert listener._scaled(3, values) == {
        "slide.position_actual_value": -2.0,
        "slide.velocity_actual_value": -1.0,
        "slide.profile_acceleration": -4.0,
        "slide.following_error_actual_value": -3.0,
        "slide.torque_actual_value": -1.5,
        "slide.current_actual_value": -2.5,
        "slide.statusword": 0x37,
        "slide.digital_inputs": 3,
    }
