"""When a monitored contact force makes a drive retract, where to, and when the retraction has ended."""

from math import inf, nan
from types import SimpleNamespace

import pytest

from hw_bridge.hardware import ContactKeys, LimitKeys
from hw_bridge.session.contact import ContactWatch
from tests.every_case import every_case

MS = 1_000_000
KEYS = {"signal": "sensor.force", "above": "0.4 N", "silent_for": "100 ms", "distance": "10 mm", "speed": "50 mm/s"}


def watch(position=0.0, start=0, velocity="100 mm/s", **keys):
    """A monitor of a drive between -30 and 20 mm."""
    limits = LimitKeys.model_validate({"position": ["-30 mm", "20 mm"], "velocity": velocity})
    node = SimpleNamespace(
        keys=SimpleNamespace(limits=limits), position=position, format_length=lambda value: f"{1e3 * value:.2f} mm"
    )
    return ContactWatch("axis", ContactKeys.model_validate(KEYS | keys), node, start)


@every_case(
    ("force", "reason"),
    [
        (0.4, ""),
        (-5.0, ""),
        (nan, ""),
        (0.401, "axis: sensor.force is 0.401 N, above 0.4 N."),
        (inf, "axis: sensor.force is inf N, above 0.4 N."),
    ],
)
def test_a_force_above_the_limit(force, reason):
    made = watch()
    made.look(0, force)
    assert made.reason == reason


def test_a_force_that_does_not_change_is_stuck():
    made = watch(start=20 * MS)
    made.look(120 * MS, nan)
    assert made.reason == ""
    made.look(120 * MS, 0.1)
    made.look(220 * MS, 0.1)
    assert made.reason == ""
    made.look(220 * MS, 0.2)
    made.look(320 * MS, 0.2)
    assert made.reason == ""
    made.look(321 * MS, 0.2)
    assert made.reason == "axis: sensor.force has not changed for 101 ms."
    made.look(322 * MS, 9.0)
    assert made.reason == "axis: sensor.force has not changed for 101 ms."


def test_a_sensor_that_never_sends_a_number_is_stuck():
    made = watch(start=20 * MS)
    made.look(121 * MS, nan)
    assert made.reason == "axis: sensor.force has not changed for 101 ms."


@pytest.mark.parametrize(("limit", "speed"), [("100 mm/s", 0.05), ("62.5 mm/s", 0.05), ("50 mm/s", 0.04)])
def test_it_retracts_at_80_percent_of_the_velocity_limit_at_most(limit, speed):
    made = watch(velocity=limit)
    made.look(0, 1.0)
    assert made.velocity() == pytest.approx(-speed)


@pytest.mark.parametrize(("direction", "sign"), [("negative", -1.0), ("positive", 1.0)])
def test_a_retraction_of_its_distance(direction, sign):
    made = watch(position=0.002, direction=direction)
    made.look(500 * MS, 1.0)
    moved = []
    for distance in (-0.001, 0.0, 0.0099, 0.0101):
        made.node.position = 0.002 + sign * distance
        moved.append((made.velocity(), made.done()))
    assert moved == [(sign * 0.05, False)] * 3 + [(0.0, True)]
    assert made.outcome() == "axis: sensor.force is 1.000 N, above 0.4 N. Retracted 10.10 mm."


@pytest.mark.parametrize(
    ("direction", "position", "arrived"),
    [
        ("negative", -0.0289, False),
        ("negative", -0.0291, True),
        ("positive", 0.0189, False),
        ("positive", 0.0191, True),
    ],
)
def test_a_retraction_ends_a_millimeter_before_the_position_limit(direction, position, arrived):
    made = watch(position=position, direction=direction)
    made.look(0, 1.0)
    assert made.done() is arrived
    assert (made.velocity() == 0.0) is arrived


def test_a_retraction_that_does_not_arrive_ends_after_three_times_its_duration():
    made = watch()
    made.look(1000 * MS, 1.0)
    made.look(1599 * MS, 1.0)
    assert not made.done()
    made.look(1600 * MS, 1.0)
    assert made.done()
    assert made.velocity() == pytest.approx(-0.05)
