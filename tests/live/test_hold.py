"""The dead-man switch, on a clock of its own."""

import pytest

from twin.live.operator.dead_man_switch import HOLD, DeadManSwitch

AXIS = "command.speed"


@pytest.fixture
def hands():
    return DeadManSwitch()


def value(hands, name=AXIS):
    return hands.inputs[name].value


def test_moves_only_while_it_is_renewed(hands):
    assert hands.hold(AXIS, 0.02, 0.0, 1, 0.0, now=10.0)
    assert hands.deadline == 10.0 + HOLD
    assert hands.expire(10.0 + 0.9 * HOLD) == []
    hands.hold(AXIS, 0.02, 0.0, 1, 0.0, now=10.0 + 0.9 * HOLD)
    assert (hands.expire(10.0 + 1.8 * HOLD), value(hands)) == ([], 0.02)
    assert (hands.expire(10.0 + 2.0 * HOLD), value(hands)) == ([AXIS], 0.0)
    assert hands.deadline == float("inf")


def test_a_press_that_ended_does_not_begin_again(hands):
    hands.hold(AXIS, 0.02, 0.0, 1, 0.0, now=0.0)
    hands.expire(1.0)
    assert not hands.hold(AXIS, 0.02, 0.0, 1, 0.0, now=1.0)  # the key is still down, its network came back
    assert value(hands) == 0.0
    assert hands.hold(AXIS, 0.02, 0.0, 2, 0.0, now=1.1)
    hands.release_hold(AXIS)
    assert not hands.hold(AXIS, 0.02, 0.0, 2, 0.0, now=1.2)  # a renewal that the release overtook


def test_what_is_old_counts_from_when_it_was_meant(hands):
    assert not hands.hold(AXIS, 0.02, 0.0, 1, HOLD, now=0.0)  # of a burst behind a network that stood still
    assert hands.hold(AXIS, 0.02, 0.0, 1, 0.75 * HOLD, now=0.0)
    assert hands.deadline == pytest.approx(0.25 * HOLD)
    assert hands.hold(AXIS, 0.02, 0.0, 1, -5.0, now=0.0)  # nobody renews for the future
    assert hands.deadline == HOLD


def test_each_hand_for_itself(hands):
    hands.hold(AXIS, -0.02, 0.0, 1, 0.0, now=0.0)
    hands.hold("gripper.closed", True, False, 1, 0.0, now=0.1)
    assert hands.expire(HOLD) == [AXIS]
    assert value(hands, "gripper.closed") is True
    hands.release_hold()
    assert not any(one.moves for one in hands.inputs.values())
    hands.release_hold("nobody.holds")


def test_rest_that_is_held_says_nothing(hands):
    hands.hold(AXIS, 0.0, 0.0, 1, 0.0, now=0.0)
    assert hands.expire(1.0) == []
