"""The instrument of bodies between two grippers: holds, slips, hands over, stands where the lumped one stands."""

import numpy as np
import pytest
from fmus.chain_in_grippers.model import ChainInGrippers
from fmus.instrument.model import Instrument

H = 1e-3
STIFFNESS = 4400.0
STRONG = 20.0


def made(**values):
    """A short instrument, gripper 1 closed."""
    part = ChainInGrippers(**{"segments": 60, "length": 0.42, "settling": 0.05, **values})
    part.limit_distal, part.limit_proximal = (STRONG, STRONG), (STRONG, STRONG)
    part.grip_stiffness = (STIFFNESS, 0.0)
    part.start(0.0)
    return part


def push(part, speeds, duration, begin):
    """Move both grippers; returns the end time."""
    for i in range(round(duration / H)):
        part.gripper_velocity = speeds
        part.advance(begin + i * H, H)
        part.gripper_position = part.gripper_position + H * np.array(speeds)
    part.gripper_velocity = (0.0, 0.0)
    return begin + duration


def test_stands_where_the_instrument_stands():
    """Every terminal of the rig is there, with the members that the lumped one has; but for the load on the tip."""
    for name, one in ChainInGrippers.terminals.items():
        assert set(one.members) <= set(Instrument.terminals[name].members)
    assert set(ChainInGrippers.terminals) == set(Instrument.terminals)
    for name in ("grip", "carriage", "frame"):
        assert set(ChainInGrippers.terminals[name].members) == set(Instrument.terminals[name].members)


@pytest.mark.slow
def test_a_closed_gripper_carries_the_instrument_and_an_open_one_does_not():
    part = made()
    push(part, (0.04, -0.04), 0.5, 0.0)
    assert part.tip_position == pytest.approx(0.02, abs=1e-3)
    assert part.insertion_depth == pytest.approx(0.025, abs=1e-3)
    assert part.gripper_force[1] == 0.0
    assert np.all(np.abs(part.slip_distance) == 0.0)


@pytest.mark.slow
def test_grippers_hand_over():
    part = made()
    t = push(part, (0.04, -0.04), 0.5, 0.0)
    part.grip_stiffness = (STIFFNESS, STIFFNESS)
    t = push(part, (0.04, 0.04), 0.05, t)
    part.grip_stiffness = (0.0, STIFFNESS)
    push(part, (-0.04, 0.04), 0.5, t)
    assert part.tip_position == pytest.approx(0.042, abs=2e-3)
    assert part.gripper_force[0] == 0.0


@pytest.mark.slow
def test_a_weak_grip_slips_at_its_limit():
    """In the bends it takes newtons to push; a grip of half a newton slips instead."""
    part = made(length=0.6, initial_insertion=0.3, settling=0.2)
    part.limit_distal = (0.5, 0.5)
    push(part, (0.04, 0.0), 0.3, 0.0)
    assert part.slip_distance[0] < -5e-3
    assert -0.75 < part.gripper_force[0] < -0.3
    strong = made(length=0.6, initial_insertion=0.3, settling=0.2)
    push(strong, (0.04, 0.0), 0.3, 0.0)
    assert strong.slip_distance[0] == 0.0
    assert strong.gripper_force[0] < -1.0


@pytest.mark.slow
def test_a_grip_that_stiffens_keeps_its_force():
    part = made(length=0.6, initial_insertion=0.3, settling=0.2)
    t = push(part, (0.04, 0.0), 0.2, 0.0)
    t = push(part, (0.0, 0.0), 0.3, t)
    before = float(part.gripper_force[0])
    assert before < -0.3
    part.grip_stiffness = (2.0 * STIFFNESS, 0.0)
    push(part, (0.0, 0.0), 0.002, t)
    assert part.gripper_force[0] == pytest.approx(before, rel=0.05)
